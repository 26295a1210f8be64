// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <vector>

namespace cairn {

/// Connection of a session to the earlier sessions of a merge.
struct MergedSession {
  int compared = 0, loops = 0;  ///< keyframes of the session; loop closures to the earlier sessions
  bool merged = false;          ///< connected by consistent loop closures
};

/// Merges the sessions in `maps` into a session in `to`. Compares each session with the earlier ones, aligns the maps
/// by loop closures, and optimizes all keyframe poses jointly. Memory holds at most two sessions at a time. The input
/// sessions stay unchanged and are not needed afterwards. Returns, per map, the connection to earlier maps. Throws
/// std::runtime_error if cameras or voxel sizes differ, and, without `allow_unmerged`, for a map not connected to most
/// of the others; then no file is written.
std::vector<MergedSession> merge_sessions(const std::vector<std::filesystem::path>& maps,
                                          const std::filesystem::path& to, bool allow_unmerged = false,
                                          int device = -1);

}  // namespace cairn
