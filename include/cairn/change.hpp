// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What is otherwise in one map than in another one of the same place.
#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <vector>

#include "cairn/export.hpp"

namespace cairn {

struct ChangeOptions {
  float distance = 0;      ///< metres that a surface may be off without having changed; 0: four voxels
  float min_area = 0.03f;  ///< m2; what is smaller has not changed
};

/// Surface that lies together and changed alike.
struct ChangedPiece {
  bool is_new = false;                               ///< else gone
  double area = 0;                                   ///< m2
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  ///< metres, in the world that is written
  Eigen::Vector3d extent = Eigen::Vector3d::Zero();  ///< metres, of the box around it
};

struct ExportedChange {
  double distance = 0;                 ///< metres, see ChangeOptions
  double new_area = 0, gone_area = 0;  ///< m2
  double both_seen = 0;                ///< m2 of the later map's surface of whose place the earlier map knows
  std::vector<ChangedPiece> pieces;    ///< the largest first
  std::size_t triangles = 0;
};

/// Writes the surface of `after`, and what of that of `before` is gone, as .glb or .gltf. New, blue, is surface where
/// the other map saw free space; gone, orange, is surface of `before` where `after` saw free space; what both have, or
/// one did not see, is grey. Both are folders, or map.vdb files, as Map::open takes them, in one frame: that of the
/// poses both were made with, or of a map and the same one with another recording. Throws std::runtime_error for
/// another voxel size, and where what both saw does not agree.
ExportedChange export_change(const std::filesystem::path& before, const std::filesystem::path& after,
                             const std::filesystem::path& file, const ChangeOptions& options = {},
                             const ExportProgress& progress = {}, int device = -1);
/// The same within a plan's map: its recordings from `recording` on, counted from 0, against those before.
ExportedChange export_change_since(const std::filesystem::path& plan, std::size_t recording,
                                   const std::filesystem::path& file, const ChangeOptions& options = {},
                                   const ExportProgress& progress = {}, int device = -1);

}  // namespace cairn
