// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/live_surface.hpp"

#include "mapper/access.hpp"
#include "mapper/map_state.hpp"

namespace cairn {

LiveSurface::LiveSurface(Mapper& mapper) : state_(MapperAccess::state(mapper)) {
  MapState& s = *MapperAccess::state(mapper);
  surface_ = &s.surfaces.emplace_back();
  surface_->change(s.volume.bricks());
}

LiveSurface::~LiveSurface() {
  if (const auto state = state_.lock()) state->surfaces.remove_if([&](const auto& s) { return &s == surface_; });
}

SurfaceChanges LiveSurface::changes(int max_bricks, bool all) {
  const auto state = state_.lock();
  if (!state) return {};
  MapState& s = *state;
  const Atlas& atlas = s.back_end.atlas();
  const int submap = static_cast<int>(s.back_end.submaps().size());
  SurfaceChanges changes;
  if (is_made_)
    is_made_ = s.warnings().attempt("the surface is no longer displayed", [&] {
      changes.parts = surface_->take(s.volume, s.polygonizer, submap, max_bricks, all);
    });
  changes.coverage = surface_->coverage();
  changes.world_from_submap.assign(static_cast<std::size_t>(submap) + 1, Eigen::Isometry3d::Identity());
  for (std::size_t k = atlas.keyframes.size(); k-- > 0;)  // a submap moves with its first keyframe
    changes.world_from_submap[atlas.keyframes[k].submap] = atlas.correction(k);
  return changes;
}

}  // namespace cairn
