// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "graph/least_squares.hpp"

#include <ceres/ceres.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "graph/components.hpp"
#include "graph/inertial_problem.hpp"

namespace cairn {
namespace {

/// Edge error in units of its noise; rotation as twice the sine of half its angle.
struct EdgeError {
  Eigen::Quaterniond measured_rotation;
  Eigen::Vector3d measured_translation;
  Matrix6d root;  // of the weighted information: root^T root

  template <class T>
  bool operator()(const T* from, const T* to, T* error) const {
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Eigen::Quaternion<T>> qi(from), qj(to);
    const Eigen::Map<const Vector> ti(from + 4), tj(to + 4);
    const Eigen::Quaternion<T> rotation = measured_rotation.conjugate().cast<T>() * (qi.conjugate() * qj);
    Eigen::Matrix<T, 6, 1> e;
    e.template head<3>() = (rotation.w() < T(0) ? T(-2) : T(2)) * rotation.vec();
    e.template tail<3>() =
        measured_rotation.conjugate().cast<T>() * (qi.conjugate() * (tj - ti) - measured_translation.cast<T>());
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

/// Fixes the position and the heading of a node; gravity may tilt the node.
struct AnchorError {
  NodePose at;
  template <class T>
  bool operator()(const T* node, T* error) const {
    constexpr double kAnchorWeight = 1e3;
    const Eigen::Map<const Eigen::Quaternion<T>> q(node);
    const Eigen::Quaternion<T> rotation = q * Eigen::Quaterniond(at[3], at[0], at[1], at[2]).conjugate().cast<T>();
    error[0] = T(kAnchorWeight) * rotation.y();
    for (int i = 0; i < 3; ++i)
      error[1 + i] = T(kAnchorWeight) * (node[4 + i] - T(at[static_cast<std::size_t>(4 + i)]));
    return true;
  }
};

EdgeError error_of(const PoseGraph::Edge& edge, double weight) {
  return {Eigen::Quaterniond(edge.i_from_j.linear()), edge.i_from_j.translation(),
          std::sqrt(weight) * Matrix6d(Eigen::LLT<Matrix6d>(edge.information).matrixU())};
}

}  // namespace

NodePose node_pose(const Eigen::Isometry3d& t) {
  const Eigen::Quaterniond q(t.linear());
  return {q.x(), q.y(), q.z(), q.w(), t.translation().x(), t.translation().y(), t.translation().z()};
}

Eigen::Isometry3d pose(const NodePose& p) {
  Eigen::Isometry3d t = Eigen::Isometry3d::Identity();
  t.linear() = Eigen::Quaterniond(p[3], p[0], p[1], p[2]).normalized().toRotationMatrix();
  t.translation() << p[4], p[5], p[6];
  return t;
}

std::vector<NodePose> node_poses(const std::vector<Eigen::Isometry3d>& poses) {
  std::vector<NodePose> nodes;
  nodes.reserve(poses.size());
  for (const auto& t : poses) nodes.push_back(node_pose(t));
  return nodes;
}

std::vector<Eigen::Isometry3d> poses(const std::vector<NodePose>& nodes) {
  std::vector<Eigen::Isometry3d> poses;
  poses.reserve(nodes.size());
  for (const NodePose& node : nodes) poses.push_back(pose(node));
  return poses;
}

double squared_error(const PoseGraph::Edge& edge, const std::vector<NodePose>& poses) {
  Vector6d e;
  error_of(edge, 1)(poses[edge.i].data(), poses[edge.j].data(), e.data());
  return e.squaredNorm();
}

std::vector<double> squared_errors(const PoseGraph& graph, const std::vector<NodePose>& poses) {
  std::vector<double> squared;
  squared.reserve(graph.edges.size());
  for (const auto& edge : graph.edges) squared.push_back(squared_error(edge, poses));
  return squared;
}

double cost(const PoseGraph& graph, const std::vector<NodePose>& poses, const std::vector<double>& weights) {
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

int solve(const PoseGraph& graph, const std::vector<double>& weights, int iterations, std::vector<NodePose>& poses,
          InertialGraph* inertial) {
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
  std::optional<InertialProblem> inertial_problem;
  if (inertial != nullptr) inertial_problem.emplace(*inertial, anchors, poses, problem);
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
  options.num_threads = 1;  // several threads would sum the residuals in random order
  options.function_tolerance = 1e-7;
  options.gradient_tolerance = 1e-12;
  options.parameter_tolerance = 1e-12;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable()) throw std::runtime_error("pose graph: " + summary.message);
  if (inertial_problem) inertial_problem->finish();
  return static_cast<int>(summary.iterations.size()) - 1;
}

}  // namespace cairn
