// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// metadata.json of Record3D's exports, and where its own archives lead.
#pragma once
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "cairn/camera.hpp"

namespace cairn {

/// Whether this is what metadata.json of Record3D holds: K, w and h, and times or poses of frames.
[[nodiscard]] bool is_record3d(const nlohmann::json& metadata);
/// The camera of its `K` (column by column), `w` and `h`. Throws std::runtime_error with the key that is wrong.
[[nodiscard]] Camera camera_of_record3d(const nlohmann::json& metadata);

/// How to get a recording out of an .r3d archive, whose depth is packed with LZFSE, as one line.
[[nodiscard]] std::string how_to_read_r3d(const std::filesystem::path& archive);

}  // namespace cairn
