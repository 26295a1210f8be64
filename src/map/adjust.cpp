// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/adjust.hpp"

#include <cmath>

#include "adjust/bundle.hpp"
#include "map/velocity.hpp"

namespace cairn {
namespace {

constexpr double kSign = 0.001, kSigmas = 4;  // seconds; standard deviations: a readout that is worth a second look
constexpr double kBetter = 0.003;             // of what held-out surfels are off, that a readout must take away

/// The keyframes of the main piece as a bundle.
struct Main {
  std::vector<std::size_t> members;
  std::vector<std::size_t> place;  // in the bundle, by keyframe
};

Main main_of(const Atlas& atlas) {
  const auto component = atlas.components();
  const std::size_t main = atlas.main_component();
  Main m;
  m.place.resize(atlas.keyframes.size());
  for (std::size_t k = 0; k < atlas.keyframes.size(); ++k) {
    if (component[k] != main) continue;
    m.place[k] = m.members.size();
    m.members.push_back(k);
  }
  return m;
}

Bundle solve(const BackEnd& back_end, const Rig& rig, double clock_offset, const Main& main, bool finds_readout) {
  const Atlas& atlas = back_end.atlas();
  const Trajectory path = atlas.trajectory(atlas.main_component(), 0, atlas.frames.size());
  Bundle bundle(rig, {.finds_readout = finds_readout});
  for (const std::size_t k : main.members) {
    const Keyframe& keyframe = atlas.keyframes[k];
    Frame frame = back_end.images().get(k);
    frame.colour_delay = keyframe.colour_delay - clock_offset;
    bundle.add(frame, velocity_at(path, keyframe.timestamp), atlas.world_from_camera[k]);
  }
  for (PoseGraph::Edge edge : atlas.graph().edges) {
    if (edge.is_loop_closure || edge.j >= main.place.size()) continue;
    const std::size_t i = main.place[edge.i], j = main.place[edge.j];
    if (i >= main.members.size() || main.members[i] != edge.i || main.members[j] != edge.j) continue;
    edge.i = i, edge.j = j;
    bundle.tie(edge);
  }
  bundle.adjust();
  return bundle;
}

}  // namespace

Adjusted adjust(BackEnd& back_end, const Rig& rig, double clock_offset) {
  back_end.settle();
  const Main main = main_of(back_end.atlas());
  Adjusted adjusted{.keyframes = static_cast<int>(main.members.size())};
  if (main.members.size() < 2) return adjusted;
  Bundle bundle = solve(back_end, rig, clock_offset, main, true);
  adjusted.readout = bundle.shutter().readout;
  adjusted.readout_sigma = bundle.readout_sigma();
  if (std::abs(adjusted.readout) > std::max(kSign, kSigmas * adjusted.readout_sigma)) {
    Bundle global = solve(back_end, rig, clock_offset, main, false);
    const double with = bundle.held_out_error(), without = global.held_out_error();
    if (without > 0) adjusted.predicts_better = 1 - with / without;
    if (adjusted.predicts_better < kBetter) bundle = std::move(global);
  }
  adjusted.has_readout = adjusted.predicts_better >= kBetter;
  adjusted.surfels = static_cast<int>(bundle.surfels());
  adjusted.observations = static_cast<int>(bundle.observations());
  adjusted.clock_offset = clock_offset + bundle.shutter().clock;
  Atlas& atlas = back_end.atlas();
  for (std::size_t m = 0; m < main.members.size(); ++m)
    atlas.world_from_camera[main.members[m]] = bundle.world_from_view()[m];
  return adjusted;
}

}  // namespace cairn
