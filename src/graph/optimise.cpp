// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <ceres/ceres.h>
#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>

#include "cairn/pose_graph.hpp"
#include "graph/components.hpp"

namespace cairn {
namespace {

using Parameters = std::array<double, 7>;  // quaternion x y z w, translation

constexpr double kGrowth = 1.4;  // of the convexity parameter (Yang et al. 2020, remark 5)
constexpr int kMaxRounds = 100;
constexpr std::size_t kNeighbours = 5;               // nodes between the ends of edges that may agree
constexpr double kFewAlone = 10, kShareAlone = 0.1;  // edges without agreement, of those with it, that are no surprise
constexpr int kRoundIterations = 5;                  // of Levenberg-Marquardt, between two changes of the weights

Parameters parameters(const Eigen::Isometry3d& t) {
  const Eigen::Quaterniond q(t.linear());
  return {q.x(), q.y(), q.z(), q.w(), t.translation().x(), t.translation().y(), t.translation().z()};
}

Eigen::Isometry3d pose(const Parameters& p) {
  Eigen::Isometry3d t = Eigen::Isometry3d::Identity();
  t.linear() = Eigen::Quaterniond(p[3], p[0], p[1], p[2]).normalized().toRotationMatrix();
  t.translation() << p[4], p[5], p[6];
  return t;
}

/// The error of an edge in units of its noise; rotation as twice the sine of half its angle.
struct EdgeError {
  Eigen::Quaterniond measured_turn;
  Eigen::Vector3d measured_shift;
  Matrix6d root;  // of the weighted information: root^T root

  template <class T>
  bool operator()(const T* from, const T* to, T* error) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Eigen::Quaternion<T>> qi(from), qj(to);
    const Eigen::Map<const Vector> ti(from + 4), tj(to + 4);
    const Eigen::Quaternion<T> turn = measured_turn.conjugate().cast<T>() * (qi.conjugate() * qj);
    Eigen::Matrix<T, 6, 1> e;
    e.template head<3>() = (turn.w() < T(0) ? T(-2) : T(2)) * turn.vec();
    e.template tail<3>() =
        measured_turn.conjugate().cast<T>() * (qi.conjugate() * (tj - ti) - measured_shift.cast<T>());
    Eigen::Map<Eigen::Matrix<T, 6, 1>>(error, 6) = root.cast<T>() * e;
    return true;
  }
};

struct GravityError {
  Eigen::Vector3d up;
  double inverse_sigma;
  template <class T>
  bool operator()(const T* node, T* error) const {
    const Eigen::Map<const Eigen::Quaternion<T>> q(node);
    Eigen::Map<Eigen::Matrix<T, 3, 1>> e(error, 3);
    e = T(inverse_sigma) * (q * up.cast<T>() + Eigen::Vector3d::UnitY().cast<T>());
    return true;
  }
};

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

/// Holds the place and the heading of a node that gravity may tilt.
struct AnchorError {
  Parameters at;
  template <class T>
  bool operator()(const T* node, T* error) const {
    constexpr double kHold = 1e3;
    const Eigen::Map<const Eigen::Quaternion<T>> q(node);
    const Eigen::Quaternion<T> turn = q * Eigen::Quaterniond(at[3], at[0], at[1], at[2]).conjugate().cast<T>();
    error[0] = T(kHold) * turn.y();
    for (int i = 0; i < 3; ++i) error[1 + i] = T(kHold) * (node[4 + i] - T(at[static_cast<std::size_t>(4 + i)]));
    return true;
  }
};

EdgeError error_of(const PoseGraph::Edge& edge, double weight) {
  return {Eigen::Quaterniond(edge.i_from_j.linear()), edge.i_from_j.translation(),
          std::sqrt(weight) * Matrix6d(Eigen::LLT<Matrix6d>(edge.information).matrixU())};
}

/// In units of the edges' noise.
std::vector<double> squared_errors(const PoseGraph& graph, const std::vector<Parameters>& poses) {
  std::vector<double> squared;
  for (const auto& edge : graph.edges) {
    Vector6d e;
    error_of(edge, 1)(poses[edge.i].data(), poses[edge.j].data(), e.data());
    squared.push_back(e.squaredNorm());
  }
  return squared;
}

double cost(const PoseGraph& graph, const std::vector<Parameters>& poses, const std::vector<double>& weights) {
  const auto squared = squared_errors(graph, poses);
  double sum = 0;
  for (std::size_t k = 0; k < squared.size(); ++k) sum += 0.5 * weights[k] * squared[k];
  for (const auto& g : graph.gravity) {
    Eigen::Vector3d e;
    GravityError{g.up, 1 / g.sigma}(poses[g.node].data(), e.data());
    sum += 0.5 * e.squaredNorm();
  }
  return sum;
}

/// Takes the chordal initialisation if it costs less. Returns whether it does.
bool start_from_chordal(const PoseGraph& graph, const std::vector<double>& weights, std::vector<Parameters>& poses) {
  std::vector<Parameters> chordal;
  for (const auto& t : chordal_initialisation(graph, weights)) chordal.push_back(parameters(t));
  if (!(cost(graph, chordal, weights) < cost(graph, poses, weights))) return false;
  poses = std::move(chordal);
  return true;
}

/// Levenberg-Marquardt over the edges of more than no weight. Returns its iterations.
int solve(const PoseGraph& graph, const std::vector<double>& weights, int iterations, std::vector<Parameters>& poses) {
  ceres::Problem problem;
  for (std::size_t k = 0; k < graph.edges.size(); ++k)
    if (const auto& edge = graph.edges[k]; weights[k] > 0)
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<EdgeError, 6, 7, 7>(new EdgeError(error_of(edge, weights[k]))), nullptr,
          poses[edge.i].data(), poses[edge.j].data());
  for (const auto& g : graph.gravity)
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<GravityError, 3, 7>(new GravityError{g.up, 1 / g.sigma}),
                             nullptr, poses[g.node].data());
  const auto anchors = component_of(graph, weights);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (!problem.HasParameterBlock(poses[i].data())) continue;
    problem.SetManifold(poses[i].data(),
                        new ceres::ProductManifold<ceres::EigenQuaternionManifold, ceres::EuclideanManifold<3>>());
    if (anchors[i] != i) continue;
    if (graph.gravity.empty())
      problem.SetParameterBlockConstant(poses[i].data());
    else
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<AnchorError, 4, 7>(new AnchorError{poses[i]}), nullptr,
                               poses[i].data());
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.max_num_iterations = iterations;
  options.num_threads = 1;  // several add the residuals up in the order in which they come by
  options.function_tolerance = 1e-7;
  options.gradient_tolerance = 1e-12;
  options.parameter_tolerance = 1e-12;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable()) throw std::runtime_error("pose graph: " + summary.message);
  return static_cast<int>(summary.iterations.size()) - 1;
}

/// A way from one node to another.
struct Way {
  Eigen::Isometry3d pose;  // of the end in the frame of the begin
  Matrix6d covariance;     // in the frame of the end
};
Way then(const Way& a, const Way& b) {
  const Matrix6d ad = adjoint(b.pose.inverse());
  return {a.pose * b.pose, Matrix6d(ad * a.covariance * ad.transpose() + b.covariance)};
}
Way reverse(const Way& a) {
  const Matrix6d ad = adjoint(a.pose);
  return {a.pose.inverse(), Matrix6d(ad * a.covariance * ad.transpose())};
}
Way along(const PoseGraph::Edge& edge) { return {edge.i_from_j, edge.information.inverse()}; }

/// From node `a` to node `b` by `step`, the edges from node i to node i + 1; nothing where one is missing.
std::optional<Way> along(const std::vector<const PoseGraph::Edge*>& step, std::size_t a, std::size_t b) {
  Way way{Eigen::Isometry3d::Identity(), Matrix6d::Zero()};
  for (std::size_t i = std::min(a, b); i < std::max(a, b); ++i) {
    if (step[i] == nullptr) return std::nullopt;
    way = then(way, along(*step[i]));
  }
  return a <= b ? way : reverse(way);
}

/// Edges that may be false and have a neighbour, from near their one end to near their other, that says the same within
/// the noise of both and of the way between their ends (pairwise consistency: Mangelson et al. 2018); or that have such
/// neighbours which all say something else.
enum class Consistency { none, agrees, contradicts };
std::vector<Consistency> pairwise_consistency(const PoseGraph& graph, double limit) {
  std::vector<Consistency> found(graph.edges.size(), Consistency::none);
  const std::size_t nodes = graph.world_from_node.size();
  std::vector<const PoseGraph::Edge*> step(nodes, nullptr);  // from node i to node i + 1
  std::vector<std::vector<std::size_t>> from(nodes);
  for (std::size_t k = 0; k < graph.edges.size(); ++k) {
    const auto& e = graph.edges[k];
    if (e.is_loop_closure)
      from[e.i].push_back(k);
    else if (e.j == e.i + 1)
      step[e.i] = &e;
  }
  for (std::size_t k = 0; k < graph.edges.size(); ++k) {
    const auto& e = graph.edges[k];
    if (!e.is_loop_closure) continue;
    const Way loop = along(e);
    for (std::size_t i = e.i - std::min(e.i, kNeighbours); i <= std::min(e.i + kNeighbours, nodes - 1); ++i)
      for (const std::size_t other : from[i]) {
        const auto& o = graph.edges[other];
        if (other == k || (found[k] == Consistency::agrees && found[other] == Consistency::agrees)) continue;
        if (std::max(o.j, e.j) - std::min(o.j, e.j) > kNeighbours) continue;
        const auto there = along(step, e.i, o.i), back = along(step, o.j, e.j);
        if (!there || !back) continue;
        // Round trip: along the other edge, then back along this one.
        const Way around = then(then(then(*there, along(o)), *back), reverse(loop));
        const Vector6d error = local_coordinates(around.pose);
        const bool agree = error.dot(around.covariance.ldlt().solve(error)) < limit;
        for (const std::size_t edge : {k, other})
          if (found[edge] != Consistency::agrees) found[edge] = agree ? Consistency::agrees : Consistency::contradicts;
      }
  }
  return found;
}

/// Loops that others contradict have no weight; nor have those that none agrees with, where these are too many.
std::vector<double> first_weights(const PoseGraph& graph, double limit) {
  std::vector<double> weights(graph.edges.size(), 1.0);
  const std::vector<Consistency> found = pairwise_consistency(graph, limit);
  const auto agreeing = static_cast<double>(std::count(found.begin(), found.end(), Consistency::agrees));
  double alone = 0;
  for (std::size_t k = 0; k < weights.size(); ++k)
    alone += graph.edges[k].is_loop_closure && found[k] == Consistency::none;
  const bool too_many_alone = alone > kFewAlone + kShareAlone * agreeing;
  for (std::size_t k = 0; k < weights.size(); ++k)
    if (graph.edges[k].is_loop_closure &&
        (found[k] == Consistency::contradicts || (found[k] == Consistency::none && too_many_alone)))
      weights[k] = 0;
  return weights;
}

/// Graduated non-convexity with truncated least squares (Yang, Antonante, Tzoumas & Carlone 2020, sec. III). Edges that
/// have no weight at the start keep none.
int graduated_non_convexity(const PoseGraph& graph, const OptimiseOptions& options, std::vector<Parameters>& poses,
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
    iterations += solve(graph, weights, kRoundIterations, poses);
    if (decided && round > 0) break;
    squared = squared_errors(graph, poses);
  }
  return iterations;
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

  if (options.robust) weights = first_weights(graph, options.inlier_threshold);
  std::vector<Parameters> poses;
  for (const auto& t : graph.world_from_node) poses.push_back(parameters(t));
  report.cost_before = cost(graph, poses, weights);
  const auto settle = [&] {
    const bool from_chordal = start_from_chordal(graph, weights, poses);
    report.iterations += solve(graph, weights, options.max_iterations, poses);
    return from_chordal;
  };
  report.from_chordal = settle();
  if (options.robust) {
    report.iterations += graduated_non_convexity(graph, options, poses, weights);
    settle();  // a false edge may have torn the poses too far apart to come back
    // What was left out at the start and fits is believed after all; what does not fit is not.
    const auto squared = squared_errors(graph, poses);
    for (std::size_t k = 0; k < weights.size(); ++k)
      if (graph.edges[k].is_loop_closure) weights[k] = squared[k] <= options.inlier_threshold ? 1.0 : 0.0;
    settle();
  }
  for (std::size_t i = 0; i < poses.size(); ++i) graph.world_from_node[i] = pose(poses[i]);
  report.cost = cost(graph, poses, weights);
  report.edge_weights = weights;
  report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

}  // namespace cairn
