// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>

#include "base/long_tails.hpp"
#include "cairn/pose_graph.hpp"
#include "graph/coarse.hpp"
#include "graph/components.hpp"
#include "graph/consistency.hpp"
#include "graph/least_squares.hpp"

namespace cairn {
namespace {

constexpr double kGrowth = 1.4;  // of the convexity parameter (Yang et al. 2020, remark 5)
constexpr int kMaxRounds = 100;
constexpr int kRoundIterations = 5;  // of Levenberg-Marquardt, between two updates of the weights
constexpr std::size_t kTracked = 1;  // min. nodes per loop closure to use a coarse graph
constexpr std::size_t kSpacing = 8;  // nodes of a chain between kept nodes
constexpr double kNearly = 100;      // times the limit of a squared error: loop closures up to here are judged again
constexpr int kBelieveRounds = 5;
constexpr int kLoopIterations = 5;    // of Levenberg-Marquardt, for a loop closure
constexpr double kLoose = 10;         // factor on the noise of heavy-tailed edges while loop closures are judged
constexpr double kTighter = 1.4;      // divisor of this factor per later round
constexpr int kSlipRounds = 20;       // max. rounds at factor 1
constexpr double kSameWeight = 0.01;  // convergence of the weights in these rounds
constexpr double kTrust = 9;          // times the cost that a loop closure may have by chance: noise is underestimated

void check(const PoseGraph& graph) {
  const std::size_t nodes = graph.world_from_node.size();
  for (std::size_t i = 0; i < nodes; ++i)
    if (!graph.world_from_node[i].matrix().allFinite())
      throw std::runtime_error(fmt::format("pose graph: the pose of node {} is not finite", i));
  for (std::size_t k = 0; k < graph.edges.size(); ++k) {
    const auto& e = graph.edges[k];
    const auto wrong = [&](const char* what) {
      return std::runtime_error(fmt::format("pose graph: edge {} from node {} to {}: {}", k, e.i, e.j, what));
    };
    if (e.i >= nodes || e.j >= nodes) throw wrong("there is no such node");
    if (e.i == e.j) throw wrong("joins a node with itself");
    if (!e.i_from_j.matrix().allFinite()) throw wrong("its measurement is not finite");
    if (!e.information.allFinite() || Eigen::LLT<Matrix6d>(e.information).info() != Eigen::Success)
      throw wrong("its information matrix is not positive definite");
  }
  for (const auto& g : graph.gravity)
    if (g.node >= nodes || !(g.sigma > 0) || std::abs(g.up.norm() - 1) > 1e-6)
      throw std::runtime_error(
          fmt::format("pose graph: the gravity of node {} is no unit vector with a noise", g.node));
}

/// Uses the chordal initialization if its cost is lower. Returns true in this case.
bool start_from_chordal(const PoseGraph& graph, const std::vector<double>& weights, std::vector<NodePose>& poses) {
  std::vector<NodePose> chordal = node_poses(chordal_initialisation(graph, weights));
  if (!(cost(graph, chordal, weights) < cost(graph, poses, weights))) return false;
  poses = std::move(chordal);
  return true;
}

/// Reweights the heavy-tailed edges by their squared errors, with their noise scaled by `looser`. Returns the largest
/// change.
double weigh_slips(const PoseGraph& graph, const std::vector<double>& squared, double looser,
                   std::vector<double>& weights) {
  double change = 0;
  for (std::size_t k = 0; k < weights.size(); ++k) {
    if (!graph.edges[k].may_slip) continue;
    const double weight = weight_of_step(squared[k] / (looser * looser)) / (looser * looser);
    change = std::max(change, std::abs(weight - weights[k]));
    weights[k] = weight;
  }
  return change;
}

/// Graduated non-convexity with truncated least squares (Yang, Antonante, Tzoumas & Carlone 2020, sec. III). Edges with
/// zero initial weight stay rejected.
int graduated_non_convexity(const PoseGraph& graph, const OptimiseOptions& options, std::vector<NodePose>& poses,
                            std::vector<double>& weights) {
  const double limit = options.inlier_threshold;
  std::vector<std::size_t> judged;
  for (std::size_t k = 0; k < weights.size(); ++k)
    if (graph.edges[k].is_loop_closure && weights[k] > 0) judged.push_back(k);
  std::vector<double> squared = squared_errors(graph, poses);
  double most = 0;
  for (const std::size_t k : judged) most = std::max(most, squared[k]);
  int iterations = 0;
  if (most <= limit) return iterations;
  double mu = limit / (2 * most - limit);
  for (int round = 0; round < kMaxRounds; ++round, mu *= kGrowth) {
    bool decided = true;
    for (const std::size_t k : judged) {
      double& w = weights[k];
      if (squared[k] >= (mu + 1) / mu * limit)
        w = 0;
      else if (squared[k] <= mu / (mu + 1) * limit)
        w = 1;
      else
        w = std::sqrt(limit * mu * (mu + 1) / squared[k]) - mu, decided = false;
    }
    weigh_slips(graph, squared, kLoose, weights);
    iterations += solve(graph, weights, kRoundIterations, poses);
    if (decided && round > 0) break;
    squared = squared_errors(graph, poses);
  }
  return iterations;
}

bool is_mostly_tracked(const PoseGraph& graph) {
  const auto loops = static_cast<std::size_t>(
      std::count_if(graph.edges.begin(), graph.edges.end(), [](const auto& e) { return e.is_loop_closure; }));
  return graph.world_from_node.size() >= kLargeGraph && kTracked * loops <= graph.world_from_node.size();
}

/// Current estimate of a graph: poses and edge weights.
struct Belief {
  std::vector<NodePose> poses;
  std::vector<double> weights;
  int iterations = 0;
  bool from_chordal = false;
};

void settle(const PoseGraph& graph, const OptimiseOptions& options, Belief& belief) {
  belief.from_chordal = start_from_chordal(graph, belief.weights, belief.poses);
  belief.iterations += solve(graph, belief.weights, options.max_iterations, belief.poses);
}

/// Iteratively reweighted least squares for heavy-tailed edges. Their noise is inflated at first, so that a slipped
/// edge absorbs the whole error. With full weights from the start, its neighbors would share the error, in a local
/// minimum with as much support.
void settle_slips(const PoseGraph& graph, Belief& belief) {
  if (std::none_of(graph.edges.begin(), graph.edges.end(), [](const auto& e) { return e.may_slip; })) return;
  double looser = kLoose;
  for (int round = 0; round < kSlipRounds; looser = std::max(1.0, looser / kTighter)) {
    const double change = weigh_slips(graph, squared_errors(graph, belief.poses), looser, belief.weights);
    if (looser == 1 && round++ > 0 && change < kSameWeight) return;
    belief.iterations += solve(graph, belief.weights, kRoundIterations, belief.poses);
  }
}

void settle_robustly(const PoseGraph& graph, const OptimiseOptions& options, Belief& belief) {
  settle(graph, options, belief);
  const bool from_chordal = belief.from_chordal;
  belief.iterations += graduated_non_convexity(graph, options, belief.poses, belief.weights);
  settle(graph, options, belief);  // a false edge may have moved the poses too far to recover
  settle_slips(graph, belief);
  belief.from_chordal = from_chordal;
}

/// Judges rejected loop closures with a moderate error again, at the poses of the accepted ones. Returns true if more
/// are accepted, since these change the poses again.
bool believe_again(const PoseGraph& graph, const OptimiseOptions& options, Belief& belief) {
  const auto believed = [](const std::vector<double>& weights) {
    return std::count_if(weights.begin(), weights.end(), [](double w) { return w > 0.5; });
  };
  const auto before = believed(belief.weights);
  const auto squared = squared_errors(graph, belief.poses);
  for (std::size_t k = 0; k < belief.weights.size(); ++k)
    if (squared[k] <= kNearly * options.inlier_threshold) belief.weights[k] = 1;
  belief.iterations += graduated_non_convexity(graph, options, belief.poses, belief.weights);
  return believed(belief.weights) > before;
}

/// Weights of the coarse edges, from the fine edges they represent.
std::vector<double> coarse_weights(const CoarseGraph& coarse, const std::vector<double>& fine) {
  std::vector<double> weights(coarse.graph.edges.size(), 1.0);
  for (std::size_t k = 0; k < fine.size(); ++k)
    if (const std::size_t e = coarse.edge_of[k]; e != CoarseGraph::kNone) weights[e] = fine[k];
  return weights;
}

/// Robust solution that starts from a coarse graph.
void settle_from_afar(const PoseGraph& graph, const OptimiseOptions& options, Belief& belief) {
  CoarseGraph coarse(graph, kSpacing);
  Belief afar{.poses = node_poses(coarse.graph.world_from_node), .weights = coarse_weights(coarse, belief.weights)};
  settle_robustly(coarse.graph, options, afar);
  for (int round = 0; round < kBelieveRounds && believe_again(coarse.graph, options, afar); ++round) continue;
  coarse.graph.world_from_node = poses(afar.poses);
  for (std::size_t k = 0; k < belief.weights.size(); ++k)
    if (const std::size_t e = coarse.edge_of[k]; e != CoarseGraph::kNone && graph.edges[k].is_loop_closure)
      belief.weights[k] = afar.weights[e];
  belief.poses = node_poses(coarse.spread(graph));
  belief.from_chordal = afar.from_chordal;
  belief.iterations += afar.iterations + solve(graph, belief.weights, options.max_iterations, belief.poses);
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

OptimiseReport optimise(PoseGraph& graph, const OptimiseOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  check(graph);
  OptimiseReport report;
  std::vector<double> weights(graph.edges.size(), 1.0);
  const auto anchors = component_of(graph, weights);
  for (std::size_t i = 0; i < anchors.size(); ++i) report.components += anchors[i] == i;
  report.edge_weights = weights;
  if (graph.edges.empty() && graph.gravity.empty()) return report;

  Belief belief{.poses = node_poses(graph.world_from_node), .weights = weights};
  if (options.robust) {
    belief.weights = first_weights(graph, options.inlier_threshold);
    for (std::size_t k = 0; k < weights.size(); ++k)
      if (graph.edges[k].may_slip) belief.weights[k] = 1 / (kLoose * kLoose);
  }
  report.cost_before = cost(graph, belief.poses, belief.weights);
  if (!options.robust) {
    settle(graph, options, belief);
  } else {
    const bool is_large = is_mostly_tracked(graph);
    if (is_large)
      settle_from_afar(graph, options, belief);
    else
      settle_robustly(graph, options, belief);
    // Final decision: loop closures are inliers if they fit, including initially rejected ones.
    const auto squared = squared_errors(graph, belief.poses);
    for (std::size_t k = 0; k < belief.weights.size(); ++k)
      if (graph.edges[k].is_loop_closure) belief.weights[k] = squared[k] <= options.inlier_threshold ? 1.0 : 0.0;
    if (is_large)
      belief.iterations += solve(graph, belief.weights, options.max_iterations, belief.poses);
    else
      settle(graph, options, belief), settle_slips(graph, belief);
  }
  graph.world_from_node = poses(belief.poses);
  report.cost = cost(graph, belief.poses, belief.weights);
  report.from_chordal = belief.from_chordal;
  report.iterations = belief.iterations;
  report.edge_weights = belief.weights;
  report.seconds = seconds_since(start);
  return report;
}

OptimiseReport close_loop(PoseGraph& graph, const std::vector<double>& edge_weights) {
  const auto start = std::chrono::steady_clock::now();
  check(graph);
  OptimiseReport report{.edge_weights = edge_weights};
  CoarseGraph coarse(graph, kSpacing);
  const std::size_t loop = coarse.edge_of.back();
  std::vector<NodePose> nodes = node_poses(coarse.graph.world_from_node);
  std::vector<double> weights = coarse_weights(coarse, edge_weights);
  report.cost_before = cost(coarse.graph, nodes, weights);
  const double of_loop =
      loop != CoarseGraph::kNone ? 0.5 * weights[loop] * squared_error(coarse.graph.edges[loop], nodes) : 0;
  report.iterations = solve(coarse.graph, weights, kLoopIterations, nodes);
  report.cost = cost(coarse.graph, nodes, weights);
  if (report.cost - (report.cost_before - of_loop) > kTrust * 0.5 * OptimiseOptions{}.inlier_threshold) {
    report.edge_weights.back() = 0;
    report.cost = report.cost_before;
  } else {
    coarse.graph.world_from_node = poses(nodes);
    graph.world_from_node = coarse.spread(graph);
  }
  report.seconds = seconds_since(start);
  return report;
}

}  // namespace cairn
