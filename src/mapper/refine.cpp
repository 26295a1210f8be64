// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mapper/refine.hpp"

#include <algorithm>
#include <set>
#include <stdexcept>

#include "loop_closing/pairs.hpp"

namespace cairn {
namespace {

constexpr double kChoosing = 0.1;  // share of the time to choose pairs

std::vector<KeyframePair> choose_pairs(const BackEnd& back_end, const std::function<void(double)>& check_canceled) {
  const Atlas& atlas = back_end.atlas();
  const KeyframeDatabase& database = back_end.keyframes();
  const auto component_of = atlas.components();
  std::set<std::pair<std::size_t, std::size_t>> known;
  for (const Loop& loop : atlas.loops) known.emplace(loop.edge.i, loop.edge.j);
  std::vector<KeyframePair> pairs;
  for (std::size_t i = 0; i < database.size(); ++i) {
    check_canceled(kChoosing * static_cast<double>(i) / static_cast<double>(database.size()));
    const std::vector<std::size_t> near = covisible_keyframes(atlas, component_of, i);
    for (std::size_t k = 0; k < std::min(near.size(), kMaxCovisible + 1); ++k) {  // including the next keyframe
      const std::size_t j = near[k];
      if (!known.contains({i, j}))
        pairs.push_back({i, j, atlas.world_from_camera[i].inverse() * atlas.world_from_camera[j], 0});
    }
    std::size_t compared = 0;
    const auto features = back_end.images().features(i);
    for (const auto& candidate : database.query(*features, 4 * kMaxLoopCandidates, i + 1)) {
      if (std::find(near.begin(), near.end(), candidate.entry) != near.end() || compared == kMaxLoopCandidates)
        continue;
      ++compared;
      const auto located = solve_pnp(*features, *back_end.images().features(candidate.entry), back_end.camera());
      if (located && located->inliers >= kMinLoopInliers && !known.contains({i, candidate.entry}) &&
          back_end.is_possible(i, candidate.entry, located->known_from_seen))
        pairs.push_back({i, candidate.entry, located->known_from_seen, located->inliers});
    }
  }
  return pairs;
}

}  // namespace

RefineReport refine(BackEnd& back_end, const std::function<bool(double)>& progress) {
  const auto check_canceled = [&](double share) {
    if (progress && !progress(share)) throw std::runtime_error(kInterrupted);
  };
  back_end.finish_optimization();
  Atlas atlas = back_end.atlas();  // an error on the way must leave the map unchanged
  RefineReport refined{.keyframes = static_cast<int>(atlas.keyframes.size())};
  if (atlas.keyframes.size() < 2) return refined;
  const auto pairs = choose_pairs(back_end, check_canceled);
  const std::vector<Loop> loops = align_pairs(pairs, back_end.images(), back_end.matcher(), [&](std::size_t number) {
    check_canceled(kChoosing + (1 - kChoosing) * static_cast<double>(number) / static_cast<double>(pairs.size()));
  });
  atlas.loops.insert(atlas.loops.end(), loops.begin(), loops.end());
  PoseGraph graph = atlas.graph();
  std::optional<InertialGraph> inertial = atlas.inertial_graph(atlas.keyframes.size());
  const OptimizeReport report = optimize(graph, inertial ? &*inertial : nullptr);
  atlas.update_poses(graph, report, inertial);
  back_end.atlas() = atlas;
  refined.cost_before = report.cost_before, refined.cost = report.cost;
  refined.pairs_tried = static_cast<int>(pairs.size());
  for (const Loop& loop : atlas.loops) {
    ++refined.pairs_aligned;
    refined.pairs_inlier += loop.inlier;
  }
  return refined;
}

}  // namespace cairn
