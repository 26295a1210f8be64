// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "loop_closing/components.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <optional>
#include <utility>

namespace cairn {
namespace {

constexpr std::size_t kMinClusterSize = 3;  // min. loop closures to merge two components
// Rad, m: max. difference of agreeing loop closures, by drift.
constexpr double kMaxAgreeingRotation = 0.1, kMaxAgreeingTranslation = 0.3;
// Rad, m: max. drift of merged components. A group of at least kMinClusterSize loop closures is accepted up to this
// deviation; similar rooms are farther from each other.
constexpr double kMaxDriftRotation = 0.2, kMaxDriftTranslation = 1;
constexpr double kMinInlierRatio = 1.0 / 3;  // min. ratio to the feature inliers of the clearest group of loop closures
constexpr double kMinStrengthRatio = 2;      // min. ratio of strength to a conflicting group
// Min. number of views, and limits on the share of contradicting pixels. On two floors of similar offices with doors in
// different states, correct alignments of maps have at most 0.7 %, one pair 1.2 %. Wrong alignments of similar rooms
// with different surroundings have at least 1.0 %, mostly 3 to 10 %.
constexpr int kMinComparedViews = 20;
constexpr double kMaxCleanContradiction = 0.01, kMaxDoubtfulContradiction = 0.015, kMaxContradiction = 0.03;

// Pattern test: a loop closure differs in pattern if the share of differing patches exceeds kMinDifferentPatterns plus
// kMedianFactor times the median of the clearest group. A group with a share of more than kMaxDifferentShare of these
// loop closures is rejected, and so is a contradicting group with more than half of that share. In two synthetic
// buildings the share is 0 to 25 % for true groups, due to single false loop closures, and 27 to 100 % for similar
// rooms with different pictures on their walls.
constexpr double kMinDifferentPatterns = 0.002, kMedianFactor = 3, kMaxDifferentShare = 0.28;
constexpr std::size_t kMaxComparedLoops = 32;  // per group
constexpr int kMinPatches = 50;                // min. patches to judge a loop closure

constexpr double kSameRotation = 2e-3, kSameTranslation = 0.02;  // rad, m: alignments with equal contradiction
constexpr double kWalkingSpeed = 1;                              // m/s; upper limit of the speed of scanning
constexpr double kMaxSpeedRatio = 2;  // max. ratio to the camera's speed before it was lost, if larger
constexpr double kSpeedWindow = 2;    // s over which this speed is measured
// Number and share of rejected loop closures between components of a run that trigger a merge from scratch.
constexpr std::size_t kMinRejectedLoops = 20;
constexpr double kMinRejectedShare = 0.1;

/// Agreeing loop closures between two components. The first one agrees with the most others.
using Cluster = std::vector<const Loop*>;

bool is_within(const Eigen::Isometry3d& motion, double rotation, double translation) {
  const Vector6d v = local_coordinates(motion);
  return v.head<3>().norm() < rotation && v.tail<3>().norm() < translation;
}

/// world_from_camera of a loop closure's second keyframe, predicted by the loop closure.
Eigen::Isometry3d predicted_pose(const Atlas& atlas, const Loop& loop) {
  return atlas.world_from_camera[loop.edge.i] * loop.edge.i_from_j;
}

/// Rigid motion of the second keyframe's component, predicted by a loop closure.
Eigen::Isometry3d move_of(const Atlas& atlas, const Loop& loop) {
  return predicted_pose(atlas, loop) * atlas.world_from_camera[loop.edge.j].inverse();
}

/// True if a loop closure agrees with a motion of its second keyframe's component. Compared at this keyframe, so that a
/// rotation about a distant point causes no translation error.
bool agrees_with_motion(const Atlas& atlas, const Loop& loop, const Eigen::Isometry3d& move, double rotation,
                        double translation) {
  const Eigen::Isometry3d moved = move * atlas.world_from_camera[loop.edge.j];
  return is_within(moved.inverse() * predicted_pose(atlas, loop), rotation, translation);
}

bool agree(const Atlas& atlas, const Loop& a, const Loop& b) {
  return agrees_with_motion(atlas, b, move_of(atlas, a), kMaxAgreeingRotation, kMaxAgreeingTranslation);
}

std::vector<Cluster> clusters_of(const Atlas& atlas, std::vector<const Loop*> loops) {
  std::vector<Cluster> clusters;
  while (!loops.empty()) {
    Cluster largest;
    for (const Loop* loop : loops) {
      Cluster cluster{loop};
      for (const Loop* other : loops)
        if (other != loop && agree(atlas, *loop, *other)) cluster.push_back(other);
      if (cluster.size() > largest.size()) largest = std::move(cluster);
    }
    std::erase_if(loops, [&](const Loop* l) { return std::find(largest.begin(), largest.end(), l) != largest.end(); });
    clusters.push_back(std::move(largest));
  }
  return clusters;
}

/// Mean motion over a cluster.
Eigen::Isometry3d move_of(const Atlas& atlas, const Cluster& cluster) {
  Eigen::Vector4d rotation = Eigen::Vector4d::Zero();
  Eigen::Vector3d source_sum = Eigen::Vector3d::Zero(), target_sum = source_sum;
  const Eigen::Quaterniond first(move_of(atlas, *cluster.front()).linear());
  for (const Loop* loop : cluster) {
    const Eigen::Quaterniond q(move_of(atlas, *loop).linear());
    rotation += q.dot(first) < 0 ? Eigen::Vector4d(-q.coeffs()) : Eigen::Vector4d(q.coeffs());
    source_sum += atlas.world_from_camera[loop->edge.j].translation();
    target_sum += predicted_pose(atlas, *loop).translation();
  }
  const auto count = static_cast<double>(cluster.size());
  Eigen::Isometry3d move = Eigen::Isometry3d::Identity();
  move.linear() = Eigen::Quaterniond(rotation.normalized()).toRotationMatrix();
  move.translation() = target_sum / count - move.linear() * (source_sum / count);
  return move;
}

/// Loop closure with the mean relative pose of a cluster.
Loop mean_of(const Atlas& atlas, const Cluster& cluster) {
  Loop loop = *cluster.front();
  loop.edge.i_from_j =
      atlas.world_from_camera[loop.edge.i].inverse() * move_of(atlas, cluster) * atlas.world_from_camera[loop.edge.j];
  return loop;
}

int median_feature_inliers(const Cluster& cluster) {
  std::vector<int> feature_inliers;
  for (const Loop* loop : cluster) feature_inliers.push_back(loop->feature_inliers);
  const auto middle = feature_inliers.begin() + static_cast<std::ptrdiff_t>(feature_inliers.size() / 2);
  std::nth_element(feature_inliers.begin(), middle, feature_inliers.end());
  return *middle;
}

/// Views of the same place from the same side have many features in common.
double strength(const Cluster& cluster) {
  return static_cast<double>(cluster.size()) * median_feature_inliers(cluster);
}

/// Loop closures between two components. A component is identified by its first keyframe.
struct Pair {
  std::size_t first = 0, second = 0;
  std::vector<Cluster> clusters;  // strongest first
};

std::vector<Pair> pairs_of(const Atlas& atlas, const std::vector<Loop>& loops) {
  const auto component = atlas.components();
  std::map<std::pair<std::size_t, std::size_t>, std::vector<const Loop*>> between;
  for (const Loop& loop : loops) {
    const std::size_t i = component[loop.edge.i], j = component[loop.edge.j];
    between[{std::min(i, j), std::max(i, j)}].push_back(&loop);
  }
  std::vector<Pair> pairs;
  pairs.reserve(between.size());
  for (auto& [components, of_pair] : between)
    pairs.push_back({components.first, components.second, clusters_of(atlas, std::move(of_pair))});
  for (Pair& pair : pairs)
    std::stable_sort(pair.clusters.begin(), pair.clusters.end(),
                     [](const Cluster& a, const Cluster& b) { return strength(a) > strength(b); });
  return pairs;
}

/// Speed in meters per second, up to and at a keyframe.
double speed(const std::vector<Keyframe>& keyframes, std::size_t k) {
  double distance = 0, seconds = 0;
  for (; keyframes[k].follows && seconds < kSpeedWindow; --k) {
    distance +=
        (keyframes[k - 1].odometry_from_camera.inverse() * keyframes[k].odometry_from_camera).translation().norm();
    seconds += keyframes[k].timestamp - keyframes[k - 1].timestamp;
  }
  return seconds > 0 ? distance / seconds : 0;
}

/// Max. distance in meters that the camera can have moved while it was lost, from the last keyframe of a component to
/// the first keyframe of the next. Infinite for keyframes of different recordings, as detected by timestamps and frame
/// indices.
double reach(const std::vector<Keyframe>& keyframes, std::size_t next) {
  const Keyframe &before = keyframes[next - 1], &after = keyframes[next];
  if (after.timestamp <= before.timestamp || after.frame <= before.frame)
    return std::numeric_limits<double>::infinity();
  return (after.timestamp - before.timestamp) * std::max(kWalkingSpeed, kMaxSpeedRatio * speed(keyframes, next - 1));
}

/// Components before the merge, with tests against the merged state.
class ComponentTests {
 public:
  ComponentTests(Atlas& atlas, FreeSpaceConflicts& views)
      : atlas_(atlas), free_space_(views), before_(atlas.components()) {
    for (std::size_t k = 0; k < before_.size(); ++k) keyframes_[before_[k]].push_back(k);
  }
  /// Number of components before the merge.
  [[nodiscard]] std::size_t count() const { return keyframes_.size(); }
  /// Maximum free-space contradiction between two original components, one on each side of a loop closure; 1 if the
  /// camera would have jumped.
  [[nodiscard]] double contradiction(const Loop& loop) {
    const auto now = atlas_.components();
    const Eigen::Isometry3d move = move_of(atlas_, loop);
    if (jumps(now, loop, move)) return 1;
    const auto size = [&](std::size_t k) { return std::count(now.begin(), now.end(), now[k]); };
    // Components only grow: at equal size they are equal, and the cached results hold until one moves.
    CacheEntry& entry = cache_[{now[loop.edge.i], now[loop.edge.j]}];
    const std::pair sizes{size(loop.edge.i), size(loop.edge.j)};
    if (entry.sizes != sizes) entry = {sizes, {}};
    for (const auto& [cached_move, share] : entry.shares)
      if (is_within(cached_move.inverse() * move, kSameRotation, kSameTranslation)) return share;
    return entry.shares.emplace_back(move, compare(now, loop, move)).second;
  }

  /// Sorted shares of the pattern patches that differ between the two views, for loop closures of a cluster.
  [[nodiscard]] std::vector<double> different_patterns(const Cluster& cluster) {
    std::vector<double> shares;
    const std::size_t step = 1 + (cluster.size() - 1) / kMaxComparedLoops;
    for (std::size_t i = 0; i < cluster.size(); i += step) {
      const auto [agree, differ] = free_space_.patterns(*cluster[i]);
      if (agree + differ >= kMinPatches) shares.push_back(static_cast<double>(differ) / (agree + differ));
    }
    std::sort(shares.begin(), shares.end());
    return shares;
  }

 private:
  /// True if the camera would have moved farther than possible while lost between the two components.
  [[nodiscard]] bool jumps(const std::vector<std::size_t>& now, const Loop& loop, const Eigen::Isometry3d& move) const {
    const std::size_t first = now[loop.edge.i], second = now[loop.edge.j];
    const auto moved = [&](std::size_t k) -> Eigen::Isometry3d {
      return now[k] == second ? move * atlas_.world_from_camera[k] : atlas_.world_from_camera[k];
    };
    for (std::size_t k = 1; k < now.size(); ++k) {
      if (atlas_.keyframes[k].follows || std::minmax(now[k - 1], now[k]) != std::minmax(first, second)) continue;
      if ((moved(k - 1).inverse() * moved(k)).translation().norm() > reach(atlas_.keyframes, k) + kMaxDriftTranslation)
        return true;
    }
    return false;
  }
  /// Stops once the alignment is refuted.
  [[nodiscard]] double compare(const std::vector<std::size_t>& now, const Loop& loop, const Eigen::Isometry3d& move) {
    double max_share = 0;
    for (const auto& [a, of_a] : keyframes_)
      for (const auto& [b, of_b] : keyframes_) {
        if (now[a] != now[loop.edge.i] || now[b] != now[loop.edge.j]) continue;
        const auto compared = free_space_.compare(atlas_, of_a, of_b, move);
        if (compared.views >= kMinComparedViews) max_share = std::max(max_share, compared.share);
        if (max_share > kMaxContradiction) return max_share;
      }
    return max_share;
  }

  Atlas& atlas_;
  FreeSpaceConflicts& free_space_;
  std::vector<std::size_t> before_;
  std::map<std::size_t, std::vector<std::size_t>> keyframes_;
  struct CacheEntry {
    std::pair<std::ptrdiff_t, std::ptrdiff_t> sizes;
    std::vector<std::pair<Eigen::Isometry3d, double>> shares;  // by the motion of the second component
  };
  std::map<std::pair<std::size_t, std::size_t>, CacheEntry> cache_;  // by pairs of components
};

/// True if two clusters differ by no more than drift.
bool may_be_drift(const Atlas& atlas, const Cluster& a, const Cluster& b) {
  return agrees_with_motion(atlas, mean_of(atlas, b), move_of(atlas, a), kMaxDriftRotation, kMaxDriftTranslation);
}

/// Limits for merging, from the clearest cluster.
struct Limits {
  double feature_inliers = 0, different_patterns = 0;  // minimum, maximum
};

/// Share of a cluster's loop closures whose views differ in pattern.
double different_share(const Cluster& cluster, ComponentTests& tests, const Limits& limits) {
  const std::vector<double> shares = tests.different_patterns(cluster);
  if (shares.size() < kMinClusterSize) return 0;
  const auto different = shares.end() - std::upper_bound(shares.begin(), shares.end(), limits.different_patterns);
  return static_cast<double>(different) / static_cast<double>(shares.size());
}

/// Cluster that may merge a pair now: the only one without contradictions among clusters of similar strength. Refuted
/// clusters are ignored. A slightly contradicting cluster still counts, since moved doors may contradict the true one,
/// and no much weaker cluster may replace it. `accept_doubtful`: also accepts a slightly contradicting cluster if no
/// other has similar strength.
const Cluster* best_cluster(const Atlas& atlas, const Pair& pair, ComponentTests& tests, bool accept_doubtful,
                            const Limits& limits) {
  const Cluster *strongest = nullptr, *clean = nullptr;
  int clean_count = 0, candidate_count = 0;
  bool is_doubtful = false;  // contradiction of the strongest is small
  for (const Cluster& cluster : pair.clusters) {
    if (cluster.size() < kMinClusterSize) continue;
    if (strongest != nullptr && kMinStrengthRatio * strength(cluster) <= strength(*strongest)) break;
    if (strongest != nullptr && may_be_drift(atlas, *strongest, cluster)) continue;
    const double contradiction = tests.contradiction(mean_of(atlas, cluster));
    if (contradiction > kMaxContradiction) continue;
    const double different = different_share(cluster, tests, limits);
    if (different > kMaxDifferentShare) continue;
    if (++candidate_count == 1)
      strongest = &cluster,
      is_doubtful = contradiction <= kMaxDoubtfulContradiction && different <= kMaxDifferentShare / 2;
    if (contradiction <= kMaxCleanContradiction) clean = &cluster, ++clean_count;
  }
  if (clean_count == 1 && median_feature_inliers(*clean) >= limits.feature_inliers) return clean;
  return accept_doubtful && candidate_count == 1 && is_doubtful &&
                 median_feature_inliers(*strongest) >= limits.feature_inliers
             ? strongest
             : nullptr;
}

/// Loop closures between different components, each directed from the first to the second component.
std::vector<Loop> oriented(const Atlas& atlas, const std::vector<Loop>& loops) {
  const auto component = atlas.components();
  std::vector<Loop> between;
  for (const Loop& loop : loops) {
    const std::size_t i = component[loop.edge.i], j = component[loop.edge.j];
    if (i == j) continue;
    between.push_back(loop);
    PoseGraph::Edge& edge = between.back().edge;
    if (j < i) std::swap(edge.i, edge.j), edge.i_from_j = edge.i_from_j.inverse();
  }
  return between;
}

/// Merge order of pairs. feature_inliers: by the most feature inliers, for components of similar size. strength: by
/// number times inliers, for the components of a run, with a few to thousands of keyframes.
enum class Order : std::uint8_t { feature_inliers, strength };

/// Next merge, if any. Uses the merged components: loop closures of one map may fit two similar rooms, while all loop
/// closures of the merged component are unambiguous.
std::optional<Loop> next_merge(const Atlas& atlas, const std::vector<Loop>& loops, ComponentTests& tests, Order by,
                               const Limits& limits) {
  const std::vector<Loop> between = oriented(atlas, loops);
  const std::vector<Pair> pairs = pairs_of(atlas, between);
  std::vector<std::pair<double, const Pair*>> order;
  for (const Pair& pair : pairs) {
    double max_order = 0;
    for (const Cluster& cluster : pair.clusters)
      if (cluster.size() >= kMinClusterSize)
        max_order =
            std::max(max_order, by == Order::feature_inliers ? median_feature_inliers(cluster) : strength(cluster));
    if (max_order > 0) order.emplace_back(-max_order, &pair);
  }
  std::stable_sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const bool accept_doubtful : {false, true})
    for (const auto& [max_order, pair] : order)
      if (const Cluster* cluster = best_cluster(atlas, *pair, tests, accept_doubtful, limits))
        return mean_of(atlas, *cluster);
  return std::nullopt;
}

/// Replaces the loop closures from index `begin` on by all loop closures of merged pairs that agree with the current
/// alignment. Returns their number.
std::size_t add_agreeing(Atlas& atlas, const std::vector<Pair>& pairs, std::size_t begin) {
  const auto component = atlas.components();
  atlas.loops.resize(begin);
  for (const Pair& pair : pairs) {
    if (component[pair.first] != component[pair.second]) continue;
    for (const Cluster& cluster : pair.clusters) {
      const bool is_cluster = cluster.size() >= kMinClusterSize;
      for (const Loop* loop : cluster)
        if (agrees_with_motion(atlas, *loop, Eigen::Isometry3d::Identity(),
                               is_cluster ? kMaxDriftRotation : kMaxAgreeingRotation,
                               is_cluster ? kMaxDriftTranslation : kMaxAgreeingTranslation))
          atlas.loops.push_back(*loop);
    }
  }
  return atlas.loops.size() - begin;
}

/// Optimizes the poses; each odometry step is heavy-tailed.
void optimize_robustly(Atlas& atlas) {
  PoseGraph graph = atlas.graph();
  for (PoseGraph::Edge& edge : graph.edges) edge.heavy_tailed = !edge.is_loop_closure;
  atlas.update_poses(graph, optimize(graph));
}

Limits limits_of(const std::vector<Pair>& pairs, ComponentTests& tests) {
  const Cluster* clearest = nullptr;
  for (const Pair& pair : pairs)
    for (const Cluster& cluster : pair.clusters)
      if (cluster.size() >= kMinClusterSize &&
          (clearest == nullptr || median_feature_inliers(cluster) > median_feature_inliers(*clearest)))
        clearest = &cluster;
  if (clearest == nullptr) return {};
  const std::vector<double> shares = tests.different_patterns(*clearest);
  return {
      .feature_inliers = kMinInlierRatio * median_feature_inliers(*clearest),
      .different_patterns = kMinDifferentPatterns + (shares.empty() ? 0 : kMedianFactor * shares[shares.size() / 2])};
}

/// Merges components one by one, and then adds the loop closures that agree with the result. Returns their number.
std::size_t merge_all(Atlas& atlas, const std::vector<Loop>& loops, FreeSpaceConflicts& views, Order order) {
  const std::vector<Pair> pairs = pairs_of(atlas, loops);  // of the initial components
  ComponentTests tests(atlas, views);
  const Limits limits = limits_of(pairs, tests);
  const std::size_t before = atlas.loops.size();
  for (std::size_t merged = 1; merged < tests.count(); ++merged) {
    const auto loop = next_merge(atlas, loops, tests, order, limits);
    if (!loop) break;
    const auto now = atlas.components();
    atlas.align_components(loop->edge);
    // Drift within the two components contradicts the free-space test until their loop closures correct it. Single loop
    // closures are included; the pose graph judges them.
    for (const Loop& other : loops)
      if (std::minmax(now[other.edge.i], now[other.edge.j]) == std::minmax(now[loop->edge.i], now[loop->edge.j]) &&
          agrees_with_motion(atlas, other, Eigen::Isometry3d::Identity(), kMaxDriftRotation, kMaxDriftTranslation))
        atlas.loops.push_back(other);
    optimize_robustly(atlas);
  }
  return add_agreeing(atlas, pairs, before);
}

/// For each keyframe, the first keyframe of its continuously tracked component.
std::vector<std::size_t> tracked_components(const Atlas& atlas) {
  std::vector<std::size_t> first;
  for (std::size_t k = 0; k < atlas.keyframes.size(); ++k)
    first.push_back(k > 0 && atlas.keyframes[k].follows ? first.back() : k);
  return first;
}

}  // namespace

std::size_t merge_components(Atlas& atlas, const std::vector<Loop>& loops, FreeSpaceConflicts& views) {
  return merge_all(atlas, loops, views, Order::feature_inliers);
}

bool has_inconsistent_loops(const Atlas& atlas) {
  const auto first = tracked_components(atlas);
  std::size_t between = 0, rejected = 0;
  for (const Loop& loop : atlas.loops) {
    if (first[loop.edge.i] == first[loop.edge.j]) continue;
    ++between;
    rejected += !loop.inlier;
  }
  return rejected >= kMinRejectedLoops &&
         static_cast<double>(rejected) > kMinRejectedShare * static_cast<double>(between);
}

void remerge_components(Atlas& atlas, FreeSpaceConflicts& views) {
  const auto first = tracked_components(atlas);
  std::vector<Loop> loops;  // between components
  for (Loop& loop : atlas.loops) {
    loop.inlier = true;
    if (first[loop.edge.i] != first[loop.edge.j]) loops.push_back(loop);
  }
  std::erase_if(atlas.loops, [&](const Loop& loop) { return first[loop.edge.i] != first[loop.edge.j]; });
  for (std::size_t k = 1; k < atlas.keyframes.size(); ++k)
    if (atlas.keyframes[k].follows)
      atlas.world_from_camera[k] = atlas.world_from_camera[k - 1] *
                                   atlas.keyframes[k - 1].odometry_from_camera.inverse() *
                                   atlas.keyframes[k].odometry_from_camera;
  optimize_robustly(atlas);
  merge_all(atlas, loops, views, Order::strength);
  optimize_robustly(atlas);
}

}  // namespace cairn
