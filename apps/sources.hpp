// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "cairn/source.hpp"

namespace cairn::apps {

/// How SEQUENCE is explained to the user.
inline constexpr const char* kSequenceHelp =
    "Folder (TUM RGB-D, 7-Scenes, ICL-NUIM, nerfstudio and others, or with intrinsics.json), .oni or .sens file, "
    "openni: or openni:URI for a sensor, or synthetic:NAME";

/// A path from the root, without `.`, `..` and a slash at its end; it need not exist.
[[nodiscard]] std::filesystem::path tidy(const std::filesystem::path& path);
/// What a session remembers of it: what it shows, wherever it lies. A recording is known by its camera and its first
/// frames. `camera` as in SourceOptions.
[[nodiscard]] std::string identity(const std::string& sequence, const std::filesystem::path& camera);

}  // namespace cairn::apps
