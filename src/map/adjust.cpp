// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/adjust.hpp"

#include <cmath>
#include <optional>

#include "adjust/bundle.hpp"
#include "base/velocity.hpp"

namespace cairn {
namespace {

constexpr double kSign = 0.001, kSigmas = 4;  // seconds; standard deviations: a readout that is worth a second look
constexpr double kBetter = 0.003;             // of what held-out surfels are off, that a readout must take away

/// The main piece's keyframes.
std::vector<std::size_t> main_keyframes(const Atlas& atlas) {
  const auto component = atlas.components();
  std::vector<std::size_t> keyframes;
  for (std::size_t k = 0; k < atlas.keyframes.size(); ++k)
    if (component[k] == component[atlas.main_component()]) keyframes.push_back(k);
  return keyframes;
}

Bundle bundle_of(const BackEnd& back_end, const Rig& rig, double clock_offset,
                 const std::vector<std::size_t>& keyframes) {
  const Atlas& atlas = back_end.atlas();
  const Trajectory path = atlas.trajectory(atlas.main_component(), 0, atlas.frames.size());
  Bundle bundle(rig);
  std::vector<std::optional<std::size_t>> view_of(atlas.keyframes.size());
  for (std::size_t view = 0; view < keyframes.size(); ++view) {
    const std::size_t k = keyframes[view];
    Frame frame = back_end.images().get(k);
    frame.colour_delay = atlas.keyframes[k].colour_delay - clock_offset;
    bundle.add(frame, velocity_at(path, atlas.keyframes[k].timestamp), atlas.world_from_camera[k]);
    view_of[k] = view;
  }
  for (PoseGraph::Edge edge : atlas.graph().edges) {
    const auto i = view_of[edge.i], j = view_of[edge.j];
    if (edge.is_loop_closure || !i || !j) continue;
    edge.i = *i, edge.j = *j;
    bundle.tie(edge);
  }
  return bundle;
}

}  // namespace

Adjusted adjust(BackEnd& back_end, const Rig& rig, double clock_offset) {
  back_end.settle();
  Atlas& atlas = back_end.atlas();
  if (atlas.keyframes.size() < 2) return {.keyframes = static_cast<int>(atlas.keyframes.size())};
  const std::vector<std::size_t> keyframes = main_keyframes(atlas);
  Adjusted adjusted{.keyframes = static_cast<int>(keyframes.size())};
  if (keyframes.size() < 2) return adjusted;
  Bundle bundle = bundle_of(back_end, rig, clock_offset, keyframes), global = bundle;
  bundle.adjust(true);
  adjusted.readout = bundle.shutter().readout;
  adjusted.readout_sigma = bundle.readout_sigma();
  if (std::abs(adjusted.readout) > std::max(kSign, kSigmas * adjusted.readout_sigma)) {
    global.adjust(false);
    const double with = bundle.held_out_error(), without = global.held_out_error();
    if (without > 0) adjusted.predicts_better = 1 - with / without;
    if (adjusted.predicts_better < kBetter) bundle = std::move(global);
  }
  adjusted.has_readout = adjusted.predicts_better >= kBetter;
  adjusted.surfels = static_cast<int>(bundle.surfels());
  adjusted.observations = static_cast<int>(bundle.observations());
  adjusted.clock_offset = clock_offset + bundle.shutter().clock;
  for (std::size_t view = 0; view < keyframes.size(); ++view)
    atlas.world_from_camera[keyframes[view]] = bundle.world_from_view()[view];
  return adjusted;
}

}  // namespace cairn
