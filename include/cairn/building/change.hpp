// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Changes between two maps of the same place.
#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <vector>

#include "cairn/mapping/export.hpp"

namespace cairn {

struct ChangeOptions {
  float distance = 0;      ///< meters of distance up to which a surface counts as unchanged; 0: four voxels
  float min_area = 0.03f;  ///< m2; smaller changes are ignored
};

/// Connected region of surface with the same kind of change.
struct ChangedRegion {
  bool is_new = false;                               ///< true: new; false: gone
  double area = 0;                                   ///< m2
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  ///< center of the bounding box, meters, in the exported world
                                                     ///< frame
  Eigen::Vector3d extent = Eigen::Vector3d::Zero();  ///< size of the bounding box, meters
};

struct ExportedChange {
  double distance = 0;                 ///< meters, see ChangeOptions
  double new_area = 0, gone_area = 0;  ///< m2
  double common_area = 0;              ///< m2 of the later map's surface at places observed by the earlier map
  std::vector<ChangedRegion> regions;  ///< sorted by area, largest first
  std::size_t triangles = 0;
};

/// Writes the surface of `after`, and the parts of `before` that are gone, as .glb or .gltf. New surface is blue: free
/// space in the other map. Gone surface is orange: surface of `before` in the free space of `after`. Surface in both
/// maps, or unobserved by one of them, is gray. Both paths are folders or map.vdb files, as for Map::open, in the same
/// frame: made with the same given poses, or one map before and after adding a recording. Throws std::runtime_error for
/// different voxel sizes, and if the maps disagree where they overlap.
ExportedChange export_change(const std::filesystem::path& before, const std::filesystem::path& after,
                             const std::filesystem::path& file, const ChangeOptions& options = {},
                             const ExportProgress& progress = {}, int device = -1);
/// Same comparison within a project's map: its recordings from `recording` on, counted from 0, against the earlier
/// recordings.
ExportedChange export_change_since(const std::filesystem::path& plan, std::size_t recording,
                                   const std::filesystem::path& file, const ChangeOptions& options = {},
                                   const ExportProgress& progress = {}, int device = -1);

}  // namespace cairn
