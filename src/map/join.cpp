// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/join.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <optional>
#include <utility>

namespace cairn {
namespace {

constexpr std::size_t kAgreeing = 3;                   // min. loop closures to merge two components
constexpr double kAgreeTurn = 0.1, kAgreeShift = 0.3;  // rad, m: max. difference of agreeing loop closures, by drift
// Rad, m: max. drift of merged components. A group of at least kAgreeing loop closures is accepted up to this
// deviation; similar rooms are farther from each other.
constexpr double kDriftTurn = 0.2, kDriftShift = 1;
constexpr double kUnclear = 1.0 / 3;  // min. ratio to the feature inliers of the clearest group of loop closures
constexpr double kClear = 2;          // min. ratio of strength to a conflicting group
// Min. number of views, and limits on the share of contradicting pixels. On two floors of similar offices with doors in
// different states, correct alignments of maps have at most 0.7 %, one pair 1.2 %. Wrong alignments of similar rooms
// with different surroundings have at least 1.0 %, mostly 3 to 10 %.
constexpr int kViews = 20;
constexpr double kContradicting = 0.01, kDoubtful = 0.015, kRefuted = 0.03;

// Pattern test: a loop closure differs in pattern if the share of differing patches exceeds kOtherPatterns plus kUsual
// times the median of the clearest group. A group with a share of more than kOthers of these loop closures is rejected,
// and so is a contradicting group with more than half of that share. In two synthetic buildings the share is 0 to 25 %
// for true groups, due to single false loop closures, and 27 to 100 % for similar rooms with different pictures on
// their walls.
constexpr double kOtherPatterns = 0.002, kUsual = 3, kOthers = 0.28;
constexpr std::size_t kLoopsCompared = 32;  // per group
constexpr int kPatches = 50;                // min. patches to judge a loop closure

constexpr double kSameTurn = 2e-3, kSameShift = 0.02;  // rad, m: alignments with equal contradiction
constexpr double kWalk = 1;                            // m/s; upper limit of the speed of scanning
constexpr double kHurry = 2;                           // max. ratio to the camera's speed before it was lost, if larger
constexpr double kBefore = 2;                          // s over which this speed is measured
// Number and share of rejected loop closures between components of a run that trigger a merge from scratch.
constexpr std::size_t kUnbelieved = 20;
constexpr double kMuchUnbelieved = 0.1;

/// Agreeing loop closures between two components. The first one agrees with the most others.
using Cluster = std::vector<const Loop*>;

bool is_within(const Eigen::Isometry3d& motion, double turn, double shift) {
  const Vector6d v = local_coordinates(motion);
  return v.head<3>().norm() < turn && v.tail<3>().norm() < shift;
}

/// world_from_camera of a loop closure's second keyframe, predicted by the loop closure.
Eigen::Isometry3d told(const Atlas& atlas, const Loop& loop) {
  return atlas.world_from_camera[loop.edge.i] * loop.edge.i_from_j;
}

/// Rigid motion of the second keyframe's component, predicted by a loop closure.
Eigen::Isometry3d move_of(const Atlas& atlas, const Loop& loop) {
  return told(atlas, loop) * atlas.world_from_camera[loop.edge.j].inverse();
}

/// True if a loop closure agrees with a motion of its second keyframe's component. Compared at this keyframe, so that a
/// rotation about a distant point causes no translation error.
bool tells(const Atlas& atlas, const Loop& loop, const Eigen::Isometry3d& move, double turn, double shift) {
  const Eigen::Isometry3d moved = move * atlas.world_from_camera[loop.edge.j];
  return is_within(moved.inverse() * told(atlas, loop), turn, shift);
}

bool agree(const Atlas& atlas, const Loop& a, const Loop& b) {
  return tells(atlas, b, move_of(atlas, a), kAgreeTurn, kAgreeShift);
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
  Eigen::Vector4d turn = Eigen::Vector4d::Zero();
  Eigen::Vector3d is = Eigen::Vector3d::Zero(), shall_be = is;
  const Eigen::Quaterniond first(move_of(atlas, *cluster.front()).linear());
  for (const Loop* loop : cluster) {
    const Eigen::Quaterniond q(move_of(atlas, *loop).linear());
    turn += q.dot(first) < 0 ? Eigen::Vector4d(-q.coeffs()) : Eigen::Vector4d(q.coeffs());
    is += atlas.world_from_camera[loop->edge.j].translation();
    shall_be += told(atlas, *loop).translation();
  }
  const auto count = static_cast<double>(cluster.size());
  Eigen::Isometry3d move = Eigen::Isometry3d::Identity();
  move.linear() = Eigen::Quaterniond(turn.normalized()).toRotationMatrix();
  move.translation() = shall_be / count - move.linear() * (is / count);
  return move;
}

/// Loop closure with the mean relative pose of a cluster.
Loop mean_of(const Atlas& atlas, const Cluster& cluster) {
  Loop loop = *cluster.front();
  loop.edge.i_from_j =
      atlas.world_from_camera[loop.edge.i].inverse() * move_of(atlas, cluster) * atlas.world_from_camera[loop.edge.j];
  return loop;
}

int median_corners(const Cluster& cluster) {
  std::vector<int> corners;
  for (const Loop* loop : cluster) corners.push_back(loop->corners);
  const auto middle = corners.begin() + static_cast<std::ptrdiff_t>(corners.size() / 2);
  std::nth_element(corners.begin(), middle, corners.end());
  return *middle;
}

/// Views of the same place from the same side have many features in common.
double strength(const Cluster& cluster) { return static_cast<double>(cluster.size()) * median_corners(cluster); }

/// Loop closures between two components. A component is identified by its first keyframe.
struct Pair {
  std::size_t first = 0, second = 0;
  std::vector<Cluster> clusters;  // strongest first
};

std::vector<Pair> pairs_of(const Atlas& atlas, const std::vector<Loop>& loops) {
  const auto piece = atlas.components();
  std::map<std::pair<std::size_t, std::size_t>, std::vector<const Loop*>> between;
  for (const Loop& loop : loops) {
    const std::size_t i = piece[loop.edge.i], j = piece[loop.edge.j];
    between[{std::min(i, j), std::max(i, j)}].push_back(&loop);
  }
  std::vector<Pair> pairs;
  pairs.reserve(between.size());
  for (auto& [pieces, of_pair] : between)
    pairs.push_back({pieces.first, pieces.second, clusters_of(atlas, std::move(of_pair))});
  for (Pair& pair : pairs)
    std::stable_sort(pair.clusters.begin(), pair.clusters.end(),
                     [](const Cluster& a, const Cluster& b) { return strength(a) > strength(b); });
  return pairs;
}

/// Speed in meters per second, up to and at a keyframe.
double speed(const std::vector<Keyframe>& keyframes, std::size_t k) {
  double way = 0, seconds = 0;
  for (; keyframes[k].follows && seconds < kBefore; --k) {
    way += (keyframes[k - 1].odometry_from_camera.inverse() * keyframes[k].odometry_from_camera).translation().norm();
    seconds += keyframes[k].timestamp - keyframes[k - 1].timestamp;
  }
  return seconds > 0 ? way / seconds : 0;
}

/// Max. distance in meters that the camera can have moved while it was lost, from the last keyframe of a component to
/// the first keyframe of the next. Infinite for keyframes of different recordings, as detected by timestamps and frame
/// indices.
double reach(const std::vector<Keyframe>& keyframes, std::size_t next) {
  const Keyframe &before = keyframes[next - 1], &after = keyframes[next];
  if (after.timestamp <= before.timestamp || after.frame <= before.frame)
    return std::numeric_limits<double>::infinity();
  return (after.timestamp - before.timestamp) * std::max(kWalk, kHurry * speed(keyframes, next - 1));
}

/// Components before the merge, with tests against the merged state.
class Pieces {
 public:
  Pieces(Atlas& atlas, ViewsApart& views) : atlas_(atlas), views_(views), before_(atlas.components()) {
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
    Known& known = known_[{now[loop.edge.i], now[loop.edge.j]}];
    const std::pair sizes{size(loop.edge.i), size(loop.edge.j)};
    if (known.sizes != sizes) known = {sizes, {}};
    for (const auto& [there, share] : known.shares)
      if (is_within(there.inverse() * move, kSameTurn, kSameShift)) return share;
    return known.shares.emplace_back(move, compare(now, loop, move)).second;
  }

  /// Sorted shares of the pattern patches that differ between the two views, for loop closures of a cluster.
  [[nodiscard]] std::vector<double> other_patterns(const Cluster& cluster) {
    std::vector<double> shares;
    const std::size_t step = 1 + (cluster.size() - 1) / kLoopsCompared;
    for (std::size_t i = 0; i < cluster.size(); i += step) {
      const auto [agree, differ] = views_.patterns(*cluster[i]);
      if (agree + differ >= kPatches) shares.push_back(static_cast<double>(differ) / (agree + differ));
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
      if ((moved(k - 1).inverse() * moved(k)).translation().norm() > reach(atlas_.keyframes, k) + kDriftShift)
        return true;
    }
    return false;
  }
  /// Stops once the alignment is refuted.
  [[nodiscard]] double compare(const std::vector<std::size_t>& now, const Loop& loop, const Eigen::Isometry3d& move) {
    double most = 0;
    for (const auto& [a, of_a] : keyframes_)
      for (const auto& [b, of_b] : keyframes_) {
        if (now[a] != now[loop.edge.i] || now[b] != now[loop.edge.j]) continue;
        const auto compared = views_.compare(atlas_, of_a, of_b, move);
        if (compared.views >= kViews) most = std::max(most, compared.share);
        if (most > kRefuted) return most;
      }
    return most;
  }

  Atlas& atlas_;
  ViewsApart& views_;
  std::vector<std::size_t> before_;
  std::map<std::size_t, std::vector<std::size_t>> keyframes_;
  struct Known {
    std::pair<std::ptrdiff_t, std::ptrdiff_t> sizes;
    std::vector<std::pair<Eigen::Isometry3d, double>> shares;  // by the motion of the second component
  };
  std::map<std::pair<std::size_t, std::size_t>, Known> known_;  // by pairs of components
};

/// True if two clusters differ by no more than drift.
bool may_be_drift(const Atlas& atlas, const Cluster& a, const Cluster& b) {
  return tells(atlas, mean_of(atlas, b), move_of(atlas, a), kDriftTurn, kDriftShift);
}

/// Limits for merging, from the clearest cluster.
struct Limits {
  double corners = 0, other_patterns = 0;  // minimum, maximum
};

/// Share of a cluster's loop closures whose views differ in pattern.
double others_in(const Cluster& cluster, Pieces& pieces, const Limits& limits) {
  const std::vector<double> shares = pieces.other_patterns(cluster);
  if (shares.size() < kAgreeing) return 0;
  const auto others = shares.end() - std::upper_bound(shares.begin(), shares.end(), limits.other_patterns);
  return static_cast<double>(others) / static_cast<double>(shares.size());
}

/// Cluster that may merge a pair now: the only one without contradictions among clusters of similar strength. Refuted
/// clusters are ignored. A slightly contradicting cluster still counts, since moved doors may contradict the true one,
/// and no much weaker cluster may replace it. `doubtful`: also accepts a slightly contradicting cluster if no other has
/// similar strength.
const Cluster* joining(const Atlas& atlas, const Pair& pair, Pieces& pieces, bool doubtful, const Limits& limits) {
  const Cluster *strongest = nullptr, *clean = nullptr;
  int clean_ones = 0, standing = 0;
  bool is_little = false;  // contradiction of the strongest is small
  for (const Cluster& cluster : pair.clusters) {
    if (cluster.size() < kAgreeing) continue;
    if (strongest != nullptr && kClear * strength(cluster) <= strength(*strongest)) break;
    if (strongest != nullptr && may_be_drift(atlas, *strongest, cluster)) continue;
    const double contradiction = pieces.contradiction(mean_of(atlas, cluster));
    if (contradiction > kRefuted) continue;
    const double others = others_in(cluster, pieces, limits);
    if (others > kOthers) continue;
    if (++standing == 1) strongest = &cluster, is_little = contradiction <= kDoubtful && others <= kOthers / 2;
    if (contradiction <= kContradicting) clean = &cluster, ++clean_ones;
  }
  if (clean_ones == 1 && median_corners(*clean) >= limits.corners) return clean;
  return doubtful && standing == 1 && is_little && median_corners(*strongest) >= limits.corners ? strongest : nullptr;
}

/// Loop closures between different components, each directed from the first to the second component.
std::vector<Loop> oriented(const Atlas& atlas, const std::vector<Loop>& loops) {
  const auto piece = atlas.components();
  std::vector<Loop> between;
  for (const Loop& loop : loops) {
    const std::size_t i = piece[loop.edge.i], j = piece[loop.edge.j];
    if (i == j) continue;
    between.push_back(loop);
    PoseGraph::Edge& edge = between.back().edge;
    if (j < i) std::swap(edge.i, edge.j), edge.i_from_j = edge.i_from_j.inverse();
  }
  return between;
}

/// Merge order of pairs. corners: by the most feature inliers, for components of similar size. strength: by number
/// times inliers, for the components of a run, with a few to thousands of keyframes.
enum class Order : std::uint8_t { corners, strength };

/// Next merge, if any. Uses the merged components: loop closures of one map may fit two similar rooms, while all loop
/// closures of the merged component are unambiguous.
std::optional<Loop> next_join(const Atlas& atlas, const std::vector<Loop>& loops, Pieces& pieces, Order by,
                              const Limits& limits) {
  const std::vector<Loop> between = oriented(atlas, loops);
  const std::vector<Pair> pairs = pairs_of(atlas, between);
  std::vector<std::pair<double, const Pair*>> order;
  for (const Pair& pair : pairs) {
    double most = 0;
    for (const Cluster& cluster : pair.clusters)
      if (cluster.size() >= kAgreeing)
        most = std::max(most, by == Order::corners ? median_corners(cluster) : strength(cluster));
    if (most > 0) order.emplace_back(-most, &pair);
  }
  std::stable_sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const bool doubtful : {false, true})
    for (const auto& [most, pair] : order)
      if (const Cluster* cluster = joining(atlas, *pair, pieces, doubtful, limits)) return mean_of(atlas, *cluster);
  return std::nullopt;
}

/// Replaces the loop closures from index `begin` on by all loop closures of merged pairs that agree with the current
/// alignment. Returns their number.
std::size_t add_agreeing(Atlas& atlas, const std::vector<Pair>& pairs, std::size_t begin) {
  const auto piece = atlas.components();
  atlas.loops.resize(begin);
  for (const Pair& pair : pairs) {
    if (piece[pair.first] != piece[pair.second]) continue;
    for (const Cluster& cluster : pair.clusters) {
      const bool are_many = cluster.size() >= kAgreeing;
      for (const Loop* loop : cluster)
        if (tells(atlas, *loop, Eigen::Isometry3d::Identity(), are_many ? kDriftTurn : kAgreeTurn,
                  are_many ? kDriftShift : kAgreeShift))
          atlas.loops.push_back(*loop);
    }
  }
  return atlas.loops.size() - begin;
}

/// Optimizes the poses; each odometry step is heavy-tailed.
void settle(Atlas& atlas) {
  PoseGraph graph = atlas.graph();
  for (PoseGraph::Edge& edge : graph.edges) edge.may_slip = !edge.is_loop_closure;
  atlas.take(graph, optimise(graph));
}

Limits limits_of(const std::vector<Pair>& pairs, Pieces& pieces) {
  const Cluster* clearest = nullptr;
  for (const Pair& pair : pairs)
    for (const Cluster& cluster : pair.clusters)
      if (cluster.size() >= kAgreeing && (clearest == nullptr || median_corners(cluster) > median_corners(*clearest)))
        clearest = &cluster;
  if (clearest == nullptr) return {};
  const std::vector<double> usual = pieces.other_patterns(*clearest);
  return {.corners = kUnclear * median_corners(*clearest),
          .other_patterns = kOtherPatterns + (usual.empty() ? 0 : kUsual * usual[usual.size() / 2])};
}

/// Merges components one by one, and then adds the loop closures that agree with the result. Returns their number.
std::size_t join_all(Atlas& atlas, const std::vector<Loop>& loops, ViewsApart& views, Order order) {
  const std::vector<Pair> pairs = pairs_of(atlas, loops);  // of the initial components
  Pieces pieces(atlas, views);
  const Limits limits = limits_of(pairs, pieces);
  const std::size_t before = atlas.loops.size();
  for (std::size_t joined = 1; joined < pieces.count(); ++joined) {
    const auto loop = next_join(atlas, loops, pieces, order, limits);
    if (!loop) break;
    const auto now = atlas.components();
    atlas.join(loop->edge);
    // Drift within the two components contradicts the free-space test until their loop closures correct it. Single loop
    // closures are included; the pose graph judges them.
    for (const Loop& other : loops)
      if (std::minmax(now[other.edge.i], now[other.edge.j]) == std::minmax(now[loop->edge.i], now[loop->edge.j]) &&
          tells(atlas, other, Eigen::Isometry3d::Identity(), kDriftTurn, kDriftShift))
        atlas.loops.push_back(other);
    settle(atlas);
  }
  return add_agreeing(atlas, pairs, before);
}

/// For each keyframe, the first keyframe of its continuously tracked component.
std::vector<std::size_t> tracked_pieces(const Atlas& atlas) {
  std::vector<std::size_t> first;
  for (std::size_t k = 0; k < atlas.keyframes.size(); ++k)
    first.push_back(k > 0 && atlas.keyframes[k].follows ? first.back() : k);
  return first;
}

}  // namespace

std::size_t join_pieces(Atlas& atlas, const std::vector<Loop>& loops, ViewsApart& views) {
  return join_all(atlas, loops, views, Order::corners);
}

bool contradict_each_other(const Atlas& atlas) {
  const auto first = tracked_pieces(atlas);
  std::size_t between = 0, unbelieved = 0;
  for (const Loop& loop : atlas.loops) {
    if (first[loop.edge.i] == first[loop.edge.j]) continue;
    ++between;
    unbelieved += !loop.inlier;
  }
  return unbelieved >= kUnbelieved && static_cast<double>(unbelieved) > kMuchUnbelieved * static_cast<double>(between);
}

void join_anew(Atlas& atlas, ViewsApart& views) {
  const auto first = tracked_pieces(atlas);
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
  settle(atlas);
  join_all(atlas, loops, views, Order::strength);
  settle(atlas);
}

}  // namespace cairn
