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

constexpr std::size_t kAgreeing = 3;                   // loops that join two pieces
constexpr double kAgreeTurn = 0.1, kAgreeShift = 0.3;  // radians, metres that these may differ by: both have drifted
// Radians, metres by which pieces that others have joined may have drifted: as many loops as join two are believed up
// to here, and rooms that look alike are farther from each other.
constexpr double kDriftTurn = 0.2, kDriftShift = 1;
constexpr double kUnclear = 1.0 / 3;  // of the corners of the clearest loops: what has fewer joins nothing
constexpr double kClear = 2;          // times as strong as what tells something else
// Views that tell, and the share of their pixels that contradicts. On two floors of offices, most of them alike, with
// other doors open: between maps that lie right at most 0.7 %, of one pair 1.2 %; where they do not, and something
// around the rooms that look alike differs, from 1.0 % on, mostly 3 to 10 %.
constexpr int kViews = 20;
constexpr double kContradicting = 0.01, kDoubtful = 0.015, kRefuted = 0.03;

// A loop whose views have other patterns on the same surface: the share of patches from which on they do, beside what
// is usual, so many times that of the clearest loops of all. A group of which more than kOthers are such joins nothing,
// nor one that contradicts as well and has more than half as many. In two synthetic buildings 0 to 25 % of true groups
// are, where single loops are false, and 27 to 100 % of rooms that look alike, which pictures on their walls tell
// apart.
constexpr double kOtherPatterns = 0.002, kUsual = 3, kOthers = 0.28;
constexpr std::size_t kLoopsCompared = 32;  // of a group
constexpr int kPatches = 50;                // that tell something of a loop

constexpr double kSameTurn = 2e-3, kSameShift = 0.02;  // radians, metres: views contradict each other as much
constexpr double kWalk = 1;                            // m/s: who scans goes slower
constexpr double kHurry = 2;   // times as fast as the camera went before it was lost, if that is more
constexpr double kBefore = 2;  // seconds that tell how fast that was
// Loops between pieces of a run that the pose graph does not believe, from which number and share on all is begun anew.
constexpr std::size_t kUnbelieved = 20;
constexpr double kMuchUnbelieved = 0.1;

/// Loops between two pieces that agree with each other, the one first that most of them agree with.
using Cluster = std::vector<const Loop*>;

bool is_within(const Eigen::Isometry3d& motion, double turn, double shift) {
  const Vector6d v = local_coordinates(motion);
  return v.head<3>().norm() < turn && v.tail<3>().norm() < shift;
}

/// Where a loop's second keyframe lies in the world, by it.
Eigen::Isometry3d told(const Atlas& atlas, const Loop& loop) {
  return atlas.world_from_camera[loop.edge.i] * loop.edge.i_from_j;
}

/// How the piece of a loop's second keyframe is to be moved, by it.
Eigen::Isometry3d move_of(const Atlas& atlas, const Loop& loop) {
  return told(atlas, loop) * atlas.world_from_camera[loop.edge.j].inverse();
}

/// Whether a loop tells that its second keyframe's piece is to be moved so. Compared where that keyframe is, so that a
/// turn far away is no shift.
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

/// The same by all loops of a cluster together.
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

/// A loop of a cluster that says what all of it say.
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

/// Views of the same place from the same side have many corners in common.
double strength(const Cluster& cluster) { return static_cast<double>(cluster.size()) * median_corners(cluster); }

/// Loops between two pieces. Pieces have their first keyframe's number.
struct Pair {
  std::size_t first = 0, second = 0;
  std::vector<Cluster> clusters;  // the strongest first
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

/// Metres a second, before and at a keyframe.
double speed(const std::vector<Keyframe>& keyframes, std::size_t k) {
  double way = 0, seconds = 0;
  for (; keyframes[k].follows && seconds < kBefore; --k) {
    way += (keyframes[k - 1].odometry_from_camera.inverse() * keyframes[k].odometry_from_camera).translation().norm();
    seconds += keyframes[k].timestamp - keyframes[k - 1].timestamp;
  }
  return seconds > 0 ? way / seconds : 0;
}

/// Metres that the camera can have gone while it was lost between two keyframes, the first one of a piece and the one
/// before it. Infinite where they are of two recordings, as far as times and frames tell.
double reach(const std::vector<Keyframe>& keyframes, std::size_t next) {
  const Keyframe &before = keyframes[next - 1], &after = keyframes[next];
  if (after.timestamp <= before.timestamp || after.frame <= before.frame)
    return std::numeric_limits<double>::infinity();
  return (after.timestamp - before.timestamp) * std::max(kWalk, kHurry * speed(keyframes, next - 1));
}

/// What the pieces were before anything was joined, and what they are now.
class Pieces {
 public:
  Pieces(Atlas& atlas, ViewsApart& views) : atlas_(atlas), views_(views), before_(atlas.components()) {
    for (std::size_t k = 0; k < before_.size(); ++k) keyframes_[before_[k]].push_back(k);
  }
  /// That there were.
  [[nodiscard]] std::size_t count() const { return keyframes_.size(); }
  /// By how much two of the pieces before contradict each other at most, where a loop joins what they are in; wholly,
  /// where the camera would have jumped.
  [[nodiscard]] double contradiction(const Loop& loop) {
    const auto now = atlas_.components();
    const Eigen::Isometry3d move = move_of(atlas_, loop);
    if (jumps(now, loop, move)) return 1;
    const auto size = [&](std::size_t k) { return std::count(now.begin(), now.end(), now[k]); };
    // Pieces only grow: of the same size they are the same, and so is what is told of them until one moves.
    Known& known = known_[{now[loop.edge.i], now[loop.edge.j]}];
    const std::pair sizes{size(loop.edge.i), size(loop.edge.j)};
    if (known.sizes != sizes) known = {sizes, {}};
    for (const auto& [there, share] : known.shares)
      if (is_within(there.inverse() * move, kSameTurn, kSameShift)) return share;
    return known.shares.emplace_back(move, compare(now, loop, move)).second;
  }

  /// Of loops of a cluster, the share of the patches of pattern that their two views do not have in common, sorted.
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
  /// Whether the camera would have gone farther than it can while it was lost between the two pieces.
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
  /// Until it is refuted.
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
    std::vector<std::pair<Eigen::Isometry3d, double>> shares;  // by how the second is moved
  };
  std::map<std::pair<std::size_t, std::size_t>, Known> known_;  // by two pieces
};

/// Whether two clusters tell the same but for what pieces may have drifted by.
bool may_be_drift(const Atlas& atlas, const Cluster& a, const Cluster& b) {
  return tells(atlas, mean_of(atlas, b), move_of(atlas, a), kDriftTurn, kDriftShift);
}

/// What joins pieces, by the clearest loops of all.
struct Limits {
  double corners = 0, other_patterns = 0;  // at least, at most
};

/// The share of a cluster's loops that take for one place what has other pictures on its walls.
double others_in(const Cluster& cluster, Pieces& pieces, const Limits& limits) {
  const std::vector<double> shares = pieces.other_patterns(cluster);
  if (shares.size() < kAgreeing) return 0;
  const auto others = shares.end() - std::upper_bound(shares.begin(), shares.end(), limits.other_patterns);
  return static_cast<double>(others) / static_cast<double>(shares.size());
}

/// The cluster of a pair that may join it now: the only one that contradicts nothing of what was seen, among those of
/// much the same strength. What is refuted does not count; what contradicts a little does, for doors that stood
/// otherwise may contradict the true one, and what is far weaker is not taken in its place.
/// `doubtful`: so may that true one be taken, where no other is nearly as strong.
const Cluster* joining(const Atlas& atlas, const Pair& pair, Pieces& pieces, bool doubtful, const Limits& limits) {
  const Cluster *strongest = nullptr, *clean = nullptr;
  int clean_ones = 0, standing = 0;
  bool is_little = false;  // what the strongest contradicts
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

/// Loops between two pieces as they are now, each from the first one to the second one.
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

/// Which two pieces are joined first: those whose clearest loops have most corners in common, where all are about as
/// large; of a run, whose pieces may be of some keyframes or of thousands, those with most and clearest loops.
enum class Order : std::uint8_t { corners, strength };

/// How the next two pieces are joined, if any. What a piece has grown by tells as well: where the loops of one map
/// leave open in which of two rooms that look alike it is, those of all that see it do not.
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

/// Puts the loops between pieces as they were that agree with how these lie now in the place of those from `begin` on,
/// which tie them. Returns how many.
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

/// Optimises the poses, of which each step may have slipped.
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

/// Joins pieces one after the other, and adds the loops that agree with how all lie then. Returns how many.
std::size_t join_all(Atlas& atlas, const std::vector<Loop>& loops, ViewsApart& views, Order order) {
  const std::vector<Pair> pairs = pairs_of(atlas, loops);  // of the pieces as they are now
  Pieces pieces(atlas, views);
  const Limits limits = limits_of(pairs, pieces);
  const std::size_t before = atlas.loops.size();
  for (std::size_t joined = 1; joined < pieces.count(); ++joined) {
    const auto loop = next_join(atlas, loops, pieces, order, limits);
    if (!loop) break;
    const auto now = atlas.components();
    atlas.join(loop->edge);
    // What drifted in one of the two contradicts what the other saw, until their loops have taken it out: also single
    // ones, which the pose graph judges.
    for (const Loop& other : loops)
      if (std::minmax(now[other.edge.i], now[other.edge.j]) == std::minmax(now[loop->edge.i], now[loop->edge.j]) &&
          tells(atlas, other, Eigen::Isometry3d::Identity(), kDriftTurn, kDriftShift))
        atlas.loops.push_back(other);
    settle(atlas);
  }
  return add_agreeing(atlas, pairs, before);
}

/// By keyframe: the first one of its piece, that was tracked without a break.
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
  std::vector<Loop> loops;  // between pieces
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
