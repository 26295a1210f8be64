// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Color images along the path of a finished map.
#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cairn/mapping/trajectory.hpp"
#include "session/session_files.hpp"

namespace cairn {

/// Session of the map in a folder: its keyframes match the timestamps listed in report.json. Empty if there is none, if
/// it belongs to another run, or if it cannot be read.
[[nodiscard]] std::optional<SessionPictures> pictures_of(const std::filesystem::path& folder,
                                                         const std::vector<double>& timestamps);

struct KeyframePicture {
  double time = 0;  // seconds, as in the trajectory
  std::filesystem::path file;
};
/// Pictures of the keyframes along a trajectory, in its order, without keyframes of earlier recordings and of other
/// components. `clock_offset`: see trajectory.txt in docs/outputs.md.
[[nodiscard]] std::vector<KeyframePicture> pictures_along(const Trajectory& path, const SessionPictures& pictures,
                                                          double clock_offset);

/// Picture as a JPEG of at most `width` pixels. Throws std::runtime_error for a file that is not a picture.
[[nodiscard]] std::string small_picture(const std::filesystem::path& file, int width, int quality);

}  // namespace cairn
