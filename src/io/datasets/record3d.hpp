// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// metadata.json of Record3D exports, and advice for Record3D's own archives.
#pragma once
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "cairn/mapping/camera.hpp"

namespace cairn {

/// True for the metadata.json of Record3D: K, w and h, and times or poses of frames.
[[nodiscard]] bool is_record3d(const nlohmann::json& metadata);
/// Returns the camera from `K` (column-major), `w` and `h`. Throws std::runtime_error with the invalid key.
[[nodiscard]] Camera camera_of_record3d(const nlohmann::json& metadata);

/// Explains in one line how to export a recording from an .r3d archive, whose depth is compressed with LZFSE.
[[nodiscard]] std::string r3d_advice(const std::filesystem::path& archive);

}  // namespace cairn
