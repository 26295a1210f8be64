// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What the colour camera saw along the path of a finished map.
#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cairn/trajectory.hpp"
#include "session/session_files.hpp"

namespace cairn {

/// The session that a map in a folder was made with: its keyframes are those that report.json lists with these times.
/// Nothing where there is none, it is another run's or it cannot be read.
[[nodiscard]] std::optional<SessionPictures> pictures_of(const std::filesystem::path& folder,
                                                         const std::vector<double>& timestamps);

struct KeyframePicture {
  double time = 0;  // seconds, as in the trajectory
  std::filesystem::path file;
};
/// Of the keyframes that a trajectory passes, in its order; those of earlier recordings and of other pieces of the map
/// are left out. `clock_offset`: see trajectory.txt in docs/formats.md.
[[nodiscard]] std::vector<KeyframePicture> pictures_along(const Trajectory& path, const SessionPictures& pictures,
                                                          double clock_offset);

/// The picture as a JPEG of at most this width, pixels. Throws std::runtime_error for a file that is none.
[[nodiscard]] std::string small_picture(const std::filesystem::path& file, int width, int quality);

}  // namespace cairn
