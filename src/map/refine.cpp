// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/refine.hpp"

#include <algorithm>
#include <deque>
#include <set>

namespace cairn {
namespace {

constexpr double kCovisibleTurn = 0.6, kCovisibleDistance = 0.8;  // radians, metres between views of much of the same
constexpr std::size_t kCovisible = 6;                             // pairs a keyframe, beside the one with the next

struct Pair {
  std::size_t from, to;
  Eigen::Isometry3d i_from_j;  // guess
  int corners;                 // that agree; 0: chosen by their poses
};

std::vector<Pair> choose_pairs(const BackEnd& back_end) {
  const Atlas& atlas = back_end.atlas();
  const KeyframeDatabase& database = back_end.keyframes();
  const auto component_of = atlas.components();
  std::set<std::pair<std::size_t, std::size_t>> known;
  for (const Loop& loop : atlas.loops) known.emplace(loop.edge.i, loop.edge.j);
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < database.size(); ++i) {
    std::vector<std::pair<double, std::size_t>> near;
    std::set<std::size_t> all_near;
    for (std::size_t j = i + 1; j < database.size(); ++j) {
      if (component_of[i] != component_of[j]) continue;
      const Eigen::Isometry3d motion = atlas.world_from_camera[i].inverse() * atlas.world_from_camera[j];
      const double turn = Eigen::AngleAxisd(motion.linear()).angle() / kCovisibleTurn,
                   shift = motion.translation().norm() / kCovisibleDistance;
      if (turn >= 1 || shift >= 1) continue;
      near.emplace_back(j == i + 1 ? 0.0 : turn + shift, j);
      all_near.insert(j);
    }
    std::sort(near.begin(), near.end());
    for (std::size_t k = 0; k < std::min(near.size(), kCovisible + 1); ++k) {
      const std::size_t j = near[k].second;
      if (!known.contains({i, j}))
        pairs.push_back({i, j, atlas.world_from_camera[i].inverse() * atlas.world_from_camera[j], 0});
    }
    std::size_t compared = 0;
    const auto features = back_end.images().features(i);
    for (const auto& candidate : database.query(*features, 4 * kCandidates, i + 1)) {
      if (all_near.contains(candidate.entry) || compared == kCandidates) continue;
      ++compared;
      const auto located = solve_pnp(*features, *back_end.images().features(candidate.entry), back_end.camera());
      if (located && located->inliers >= kLoopCorners && !known.contains({i, candidate.entry}) &&
          back_end.is_possible(i, candidate.entry, located->known_from_seen))
        pairs.push_back({i, candidate.entry, located->known_from_seen, located->inliers});
    }
  }
  return pairs;
}

/// The last images that were asked for: pairs follow each other by their keyframes.
class Cache {
 public:
  explicit Cache(const KeyframeStore& images) : images_(images) {}
  const Frame& operator()(std::size_t keyframe) {
    for (const auto& [known, frame] : kept_)
      if (known == keyframe) return frame;
    if (kept_.size() == kKept) kept_.pop_front();
    return kept_.emplace_back(keyframe, images_.get(keyframe)).second;
  }

 private:
  static constexpr std::size_t kKept = 24;  // 2.4 MB each
  const KeyframeStore& images_;
  std::deque<std::pair<std::size_t, Frame>> kept_;
};

}  // namespace

Refined refine(BackEnd& back_end) {
  back_end.settle();
  Atlas atlas = back_end.atlas();  // what fails on the way leaves the map as it is
  Refined refined{.keyframes = static_cast<int>(atlas.keyframes.size())};
  if (atlas.keyframes.size() < 2) return refined;
  const auto pairs = choose_pairs(back_end);
  Cache image(back_end.images());
  SurfaceMatcher& matcher = back_end.matcher();
  std::optional<std::size_t> from;
  for (const Pair& pair : pairs) {
    std::optional<Match> found;
    if (pair.corners > 0) {
      const Frame first = image(pair.from);
      found = matcher.both_ways(first, image(pair.to), pair.i_from_j);
      from.reset();
    } else {
      if (from != pair.from) matcher.set_from(image(pair.from));
      from = pair.from;
      found = matcher.match(image(pair.to), pair.i_from_j);
    }
    if (!found) continue;
    atlas.loops.push_back({.edge = {.i = pair.from,
                                    .j = pair.to,
                                    .i_from_j = found->i_from_j,
                                    .information = found->information,
                                    .is_loop_closure = true},
                           .corners = pair.corners,
                           .inlier_share = found->inlier_share,
                           .rmse = found->rmse});
  }
  PoseGraph graph = atlas.graph();
  const OptimiseReport report = optimise(graph);
  atlas.take(graph, report);
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
