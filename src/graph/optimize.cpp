// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>

#include "cairn/mapping/pose_graph.hpp"
#include "geometry/student_t.hpp"
#include "graph/coarse.hpp"
#include "graph/components.hpp"
#include "graph/consistency.hpp"
#include "graph/inertial_graph.hpp"
#include "graph/least_squares.hpp"

namespace cairn {
namespace {

constexpr double kGrowth = 1.4;  // of the convexity parameter (Yang et al. 2020, remark 5)
constexpr int kMaxRounds = 100;
constexpr int kRoundIterations = 5;          // of Levenberg-Marquardt, between two updates of the weights
constexpr std::size_t kMinNodesPerLoop = 1;  // min. nodes per loop closure to use a coarse graph
constexpr std::size_t kSpacing = 8;          // nodes of a chain between kept nodes
constexpr double kMaxRetryError = 100;  // times the limit of a squared error: loop closures up to here are judged again
constexpr int kMaxRetryRounds = 5;
constexpr int kLoopIterations = 5;         // of Levenberg-Marquardt, for a loop closure
constexpr double kNoiseFactor = 10;        // factor on the noise of heavy-tailed edges while loop closures are judged
constexpr double kNoiseFactorStep = 1.4;   // divisor of this factor per later round
constexpr int kMaxReweightRounds = 20;     // max. rounds at factor 1
constexpr double kWeightTolerance = 0.01;  // convergence of the weights in these rounds
constexpr double kMaxCostRatio = 9;  // times the cost that a loop closure may have by chance: noise is underestimated

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
    if (e.i >= nodes || e.j >= nodes) throw wrong("refers to a missing node");
    if (e.i == e.j) throw wrong("connects a node to itself");
    if (!e.i_from_j.matrix().allFinite()) throw wrong("its measurement is not finite");
    if (!e.information.allFinite() || Eigen::LLT<Matrix6d>(e.information).info() != Eigen::Success)
      throw wrong("its information matrix is not positive definite");
  }
  for (const auto& g : graph.gravity)
    if (g.node >= nodes || !(g.sigma > 0) || std::abs(g.up.norm() - 1) > 1e-6)
      throw std::runtime_error(
          fmt::format("pose graph: the gravity of node {} is not a unit vector with a positive sigma", g.node));
}

/// Current estimate of a graph: poses and edge weights.
struct Estimate {
  std::vector<NodePose> poses;
  std::vector<double> weights;
  InertialGraph* inertial = nullptr;
  int iterations = 0;
  bool from_chordal = false;

  void solve(const PoseGraph& graph, int max_iterations) {
    iterations += cairn::solve(graph, weights, max_iterations, poses, inertial);
  }
};

/// Uses the chordal initialization if its cost is lower. Returns true in this case.
bool start_from_chordal(const PoseGraph& graph, const std::vector<double>& weights, std::vector<NodePose>& poses) {
  std::vector<NodePose> chordal = node_poses(chordal_initialization(graph, weights));
  if (!(cost(graph, chordal, weights) < cost(graph, poses, weights))) return false;
  poses = std::move(chordal);
  return true;
}

/// Reweights the heavy-tailed edges by their squared errors, with their noise scaled by `noise_factor`. Returns the
/// largest change.
double reweight_heavy_tailed(const PoseGraph& graph, const std::vector<double>& squared, double noise_factor,
                             std::vector<double>& weights) {
  double change = 0;
  for (std::size_t k = 0; k < weights.size(); ++k) {
    if (!graph.edges[k].heavy_tailed) continue;
    const double weight = weight_of_step(squared[k] / (noise_factor * noise_factor)) / (noise_factor * noise_factor);
    change = std::max(change, std::abs(weight - weights[k]));
    weights[k] = weight;
  }
  return change;
}

/// Graduated non-convexity with truncated least squares (Yang, Antonante, Tzoumas & Carlone 2020, sec. III). Edges with
/// zero initial weight stay rejected.
void graduated_non_convexity(const PoseGraph& graph, const OptimizeOptions& options, Estimate& estimate) {
  std::vector<double>& weights = estimate.weights;
  const double limit = options.inlier_threshold;
  std::vector<std::size_t> judged;
  for (std::size_t k = 0; k < weights.size(); ++k)
    if (graph.edges[k].is_loop_closure && weights[k] > 0) judged.push_back(k);
  std::vector<double> squared = squared_errors(graph, estimate.poses);
  double max_squared = 0;
  for (const std::size_t k : judged) max_squared = std::max(max_squared, squared[k]);
  if (max_squared <= limit) return;
  double mu = limit / (2 * max_squared - limit);
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
    reweight_heavy_tailed(graph, squared, kNoiseFactor, weights);
    estimate.solve(graph, kRoundIterations);
    if (decided && round > 0) break;
    squared = squared_errors(graph, estimate.poses);
  }
}

bool is_mostly_odometry(const PoseGraph& graph) {
  const auto loops = static_cast<std::size_t>(
      std::count_if(graph.edges.begin(), graph.edges.end(), [](const auto& e) { return e.is_loop_closure; }));
  return graph.world_from_node.size() >= kLargeGraph && kMinNodesPerLoop * loops <= graph.world_from_node.size();
}

void optimize_weighted(const PoseGraph& graph, const OptimizeOptions& options, Estimate& estimate) {
  estimate.from_chordal = start_from_chordal(graph, estimate.weights, estimate.poses);
  estimate.solve(graph, options.max_iterations);
}

/// Iteratively reweighted least squares for heavy-tailed edges. Their noise is inflated at first, so that an outlier
/// edge absorbs the whole error. With full weights from the start, its neighbors would share the error, in a local
/// minimum with as much support.
void optimize_heavy_tailed(const PoseGraph& graph, Estimate& estimate) {
  if (std::none_of(graph.edges.begin(), graph.edges.end(), [](const auto& e) { return e.heavy_tailed; })) return;
  double noise_factor = kNoiseFactor;
  for (int round = 0; round < kMaxReweightRounds; noise_factor = std::max(1.0, noise_factor / kNoiseFactorStep)) {
    const double change =
        reweight_heavy_tailed(graph, squared_errors(graph, estimate.poses), noise_factor, estimate.weights);
    if (noise_factor == 1 && round++ > 0 && change < kWeightTolerance) return;
    estimate.solve(graph, kRoundIterations);
  }
}

void optimize_robustly(const PoseGraph& graph, const OptimizeOptions& options, Estimate& estimate) {
  optimize_weighted(graph, options, estimate);
  const bool from_chordal = estimate.from_chordal;
  graduated_non_convexity(graph, options, estimate);
  optimize_weighted(graph, options, estimate);  // a false edge may have moved the poses too far to recover
  optimize_heavy_tailed(graph, estimate);
  estimate.from_chordal = from_chordal;
}

/// Judges rejected loop closures with a moderate error again, at the poses of the accepted ones. Returns true if more
/// are accepted, since these change the poses again.
bool retry_rejected(const PoseGraph& graph, const OptimizeOptions& options, Estimate& estimate) {
  const auto inlier_count = [](const std::vector<double>& weights) {
    return std::count_if(weights.begin(), weights.end(), [](double w) { return w > 0.5; });
  };
  const auto before = inlier_count(estimate.weights);
  const auto squared = squared_errors(graph, estimate.poses);
  for (std::size_t k = 0; k < estimate.weights.size(); ++k)
    if (squared[k] <= kMaxRetryError * options.inlier_threshold) estimate.weights[k] = 1;
  graduated_non_convexity(graph, options, estimate);
  return inlier_count(estimate.weights) > before;
}

/// Weights of the coarse edges, from the fine edges they represent.
std::vector<double> coarse_weights(const CoarseGraph& coarse, const std::vector<double>& fine) {
  std::vector<double> weights(coarse.graph.edges.size(), 1.0);
  for (std::size_t k = 0; k < fine.size(); ++k)
    if (const std::size_t e = coarse.edge_of[k]; e != CoarseGraph::kNone) weights[e] = fine[k];
  return weights;
}

/// Robust solution that starts from a coarse graph.
void optimize_coarse_to_fine(const PoseGraph& graph, const OptimizeOptions& options, Estimate& estimate) {
  CoarseGraph coarse(graph, kSpacing);
  Estimate coarse_estimate{.poses = node_poses(coarse.graph.world_from_node),
                           .weights = coarse_weights(coarse, estimate.weights)};
  optimize_robustly(coarse.graph, options, coarse_estimate);
  for (int round = 0; round < kMaxRetryRounds && retry_rejected(coarse.graph, options, coarse_estimate); ++round)
    continue;
  coarse.graph.world_from_node = poses(coarse_estimate.poses);
  for (std::size_t k = 0; k < estimate.weights.size(); ++k)
    if (const std::size_t e = coarse.edge_of[k]; e != CoarseGraph::kNone && graph.edges[k].is_loop_closure)
      estimate.weights[k] = coarse_estimate.weights[e];
  estimate.poses = node_poses(coarse.interpolate(graph));
  estimate.from_chordal = coarse_estimate.from_chordal;
  estimate.iterations += coarse_estimate.iterations;
  estimate.solve(graph, options.max_iterations);
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

OptimizeReport optimize(PoseGraph& graph, const OptimizeOptions& options) { return optimize(graph, nullptr, options); }

OptimizeReport optimize(PoseGraph& graph, InertialGraph* inertial, const OptimizeOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  check(graph);
  OptimizeReport report;
  std::vector<double> weights(graph.edges.size(), 1.0);
  const auto anchors = component_of(graph, weights);
  for (std::size_t i = 0; i < anchors.size(); ++i) report.components += anchors[i] == i;
  report.edge_weights = weights;
  if (graph.edges.empty() && graph.gravity.empty()) return report;

  Estimate estimate{.poses = node_poses(graph.world_from_node), .weights = weights, .inertial = inertial};
  if (options.robust) {
    estimate.weights = initial_weights(graph, options.inlier_threshold);
    for (std::size_t k = 0; k < weights.size(); ++k)
      if (graph.edges[k].heavy_tailed) estimate.weights[k] = 1 / (kNoiseFactor * kNoiseFactor);
  }
  report.cost_before = cost(graph, estimate.poses, estimate.weights);
  if (!options.robust) {
    optimize_weighted(graph, options, estimate);
  } else {
    const bool is_large = is_mostly_odometry(graph);
    if (is_large)
      optimize_coarse_to_fine(graph, options, estimate);
    else
      optimize_robustly(graph, options, estimate);
    // Final decision: loop closures are inliers if they fit, including initially rejected ones.
    const auto squared = squared_errors(graph, estimate.poses);
    for (std::size_t k = 0; k < estimate.weights.size(); ++k)
      if (graph.edges[k].is_loop_closure) estimate.weights[k] = squared[k] <= options.inlier_threshold ? 1.0 : 0.0;
    if (is_large)
      estimate.solve(graph, options.max_iterations);
    else
      optimize_weighted(graph, options, estimate), optimize_heavy_tailed(graph, estimate);
  }
  graph.world_from_node = poses(estimate.poses);
  report.cost = cost(graph, estimate.poses, estimate.weights);
  report.from_chordal = estimate.from_chordal;
  report.iterations = estimate.iterations;
  report.edge_weights = estimate.weights;
  report.seconds = seconds_since(start);
  return report;
}

OptimizeReport close_loop(PoseGraph& graph, const std::vector<double>& edge_weights) {
  const auto start = std::chrono::steady_clock::now();
  check(graph);
  OptimizeReport report{.edge_weights = edge_weights};
  CoarseGraph coarse(graph, kSpacing);
  const std::size_t loop = coarse.edge_of.back();
  std::vector<NodePose> nodes = node_poses(coarse.graph.world_from_node);
  std::vector<double> weights = coarse_weights(coarse, edge_weights);
  report.cost_before = cost(coarse.graph, nodes, weights);
  const double of_loop =
      loop != CoarseGraph::kNone ? 0.5 * weights[loop] * squared_error(coarse.graph.edges[loop], nodes) : 0;
  report.iterations = solve(coarse.graph, weights, kLoopIterations, nodes);
  report.cost = cost(coarse.graph, nodes, weights);
  if (report.cost - (report.cost_before - of_loop) > kMaxCostRatio * 0.5 * OptimizeOptions{}.inlier_threshold) {
    report.edge_weights.back() = 0;
    report.cost = report.cost_before;
  } else {
    coarse.graph.world_from_node = poses(nodes);
    graph.world_from_node = coarse.interpolate(graph);
  }
  report.seconds = seconds_since(start);
  return report;
}

}  // namespace cairn
