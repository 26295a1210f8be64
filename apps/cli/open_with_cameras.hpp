// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>
#include <string>

#include "cairn/io/source.hpp"

namespace cairn::apps {

/// Opens a recording with the cameras of its map, unless they are its own. `camera_file` may be missing.
[[nodiscard]] std::unique_ptr<Source> open_with_cameras(const std::string& recording,
                                                        const std::filesystem::path& camera_file);

}  // namespace cairn::apps
