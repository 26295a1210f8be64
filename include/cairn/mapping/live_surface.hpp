// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <memory>
#include <optional>
#include <vector>

#include "cairn/mapping/surface_block.hpp"

namespace cairn {

class IncrementalMesher;
class Mapper;
struct MapState;

/// Changed parts of the surface, and the current poses of the submaps.
struct SurfaceChanges {
  std::vector<SurfaceBlock> parts;
  std::vector<Eigen::Isometry3d> world_from_submap;  ///< indexed by submap; updated by loop closures
  std::optional<double> coverage;  ///< mean vertex confidence, 0..1, over the cubes changed by the last frame
};

/// Incremental surface of a growing map for a viewer; several may exist at once. Used from the mapper's thread. After
/// the mapper is destroyed it returns no more changes.
class LiveSurface {
 public:
  /// Starts with the entire surface on the device.
  explicit LiveSurface(Mapper& mapper);
  ~LiveSurface();
  LiveSurface(const LiveSurface&) = delete;
  LiveSurface& operator=(const LiveSurface&) = delete;

  /// Parts changed since the previous call, new parts first, up to `max_bricks` cubes of 8 voxels; well-observed parts
  /// are updated less often, unless `all` is set. Submaps are placed as rigid bodies; Map::mesh deforms them. If
  /// surface extraction fails, for example without memory, updates stop and a warning of the mapper gives the reason.
  [[nodiscard]] SurfaceChanges changes(int max_bricks = 1000, bool all = false);

 private:
  std::weak_ptr<MapState> state_;         ///< expires with the mapper
  IncrementalMesher* surface_ = nullptr;  ///< owned by `state_`
  bool is_made_ = true;                   ///< false: surface extraction has failed
};

}  // namespace cairn
