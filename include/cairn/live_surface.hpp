// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <memory>
#include <optional>
#include <vector>

#include "cairn/mesh.hpp"

namespace cairn {

class GrowingSurface;
class Mapper;
struct MapState;

/// A part of the surface: what lies in one cube of the submap's frame. It replaces what was told of this cube before.
struct SurfacePart {
  int submap = 0;
  Eigen::Vector3i cell = Eigen::Vector3i::Zero();  ///< the cube's number
  /// In the submap's frame; may be empty. The fourth byte of its colours tells how well a vertex has been seen: 255
  /// after some eight observations at 1 m (32 at 2 m), less in proportion to the certainty of its place.
  Mesh mesh;
};

/// What of the surface changed, and where the submaps lie now.
struct SurfaceChanges {
  std::vector<SurfacePart> parts;
  std::vector<Eigen::Isometry3d> world_from_submap;  ///< by submap; loops move them
  std::optional<double> coverage;  ///< mean of the same, 0..1, over the cubes that the last frame changed
};

/// The surface as it grows, for a viewer that follows it, as any number may. Used by the mapper's thread; it ends with
/// the mapper and tells nothing afterwards.
class LiveSurface {
 public:
  /// Begins to follow the mapper's surface, with all that it has on the device.
  explicit LiveSurface(Mapper& mapper);
  ~LiveSurface();
  LiveSurface(const LiveSurface&) = delete;
  LiveSurface& operator=(const LiveSurface&) = delete;

  /// Parts that changed since they were asked for, new ones first, as many as `max_bricks` cubes of 8 voxels hold;
  /// well-known places come rarely. `all`: also those. Submaps lie as rigid bodies; Map::mesh bends them. When the
  /// surface cannot be made, as without memory, nothing comes any more, and a warning of the mapper tells why.
  [[nodiscard]] SurfaceChanges changes(int max_bricks = 1000, bool all = false);

 private:
  std::weak_ptr<MapState> state_;      ///< gone with the mapper
  GrowingSurface* surface_ = nullptr;  ///< of `state_`
  bool is_made_ = true;                ///< it could be so far
};

}  // namespace cairn
