// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "graph/inertial_problem.hpp"

#include <ceres/loss_function.h>
#include <ceres/normal_prior.h>
#include <ceres/sphere_manifold.h>

#include "graph/inertial_cost.hpp"

namespace cairn {
namespace {

constexpr double kGyroPrior = 0.005, kAccelerationPrior = 0.04;  // rad/s, m/s^2: sigmas of the biases
constexpr double kMaxError = 6;  // in units of noise, of a step of 15 residuals with full weight: tracking may fail

}  // namespace

InertialProblem::InertialProblem(InertialGraph& inertial, const std::vector<std::size_t>& anchors,
                                 std::vector<NodePose>& poses, ceres::Problem& problem)
    : inertial_(inertial), anchors_(anchors), poses_(poses), motions_(poses.size()) {
  start_gravity();
  for (const auto& step : inertial_.steps) start_motion(step);
  std::vector<bool> is_in_chain(poses.size(), false);
  for (const auto& step : inertial_.steps) {
    if (!gravity_.contains(anchors_[step.i]) || anchors_[step.i] != anchors_[step.j]) continue;
    add_step(step, !is_in_chain[step.i], problem);
    is_in_chain[step.i] = is_in_chain[step.j] = true;
  }
}

/// Mean over the nodes of each component.
void InertialProblem::start_gravity() {
  for (std::size_t k = 0; k < inertial_.gravity.size(); ++k)
    if (const auto& known = inertial_.gravity[k])
      gravity_.try_emplace(anchors_[k], Eigen::Vector3d::Zero()).first->second += pose(poses_[k]).linear() * *known;
  std::erase_if(gravity_, [](const auto& g) { return !(g.second.norm() > 0); });
  for (auto& [anchor, gravity] : gravity_) gravity *= kStandardGravity / gravity.norm();
}

/// Velocities that explain the motion between the poses.
void InertialProblem::start_motion(const InertialGraph::Step& step) {
  const auto gravity = gravity_.find(anchors_[step.i]);
  if (gravity == gravity_.end()) return;
  const double t = step.motion.seconds;
  const auto imu = [&](std::size_t node) {
    const Eigen::Isometry3d camera = pose(poses_[node]);
    Eigen::Isometry3d t_imu(camera.linear() * inertial_.mount.imu_from_camera.conjugate());
    t_imu.translation() = camera.translation() - t_imu.linear() * inertial_.mount.lever;
    return t_imu;
  };
  const Eigen::Isometry3d from = imu(step.i), to = imu(step.j);
  const Eigen::Vector3d& g = gravity->second;
  const Eigen::Vector3d velocity =
      (to.translation() - from.translation() - from.linear() * step.motion.position) / t - 0.5 * t * g;
  const auto start = [&](std::size_t node, const Eigen::Vector3d& v) {
    Eigen::Map<Vector9d>(motions_[node].data()) << v, step.motion.bias.gyro, step.motion.bias.acceleration;
  };
  start(step.i, velocity);
  start(step.j, velocity + t * g + from.linear() * step.motion.velocity);
}

void InertialProblem::add_step(const InertialGraph::Step& step, bool starts_chain, ceres::Problem& problem) {
  double* gravity = gravity_.at(anchors_[step.i]).data();
  problem.AddResidualBlock(new InertialCost(step.motion, inertial_.mount, inertial_.noise),
                           new ceres::HuberLoss(kMaxError), poses_[step.i].data(), poses_[step.j].data(),
                           motions_[step.i].data(), motions_[step.j].data(), gravity);
  if (problem.GetManifold(gravity) == nullptr) problem.SetManifold(gravity, new ceres::SphereManifold<3>());
  if (!starts_chain) return;
  ceres::Matrix root = ceres::Matrix::Zero(6, 9);
  root.block<3, 3>(0, 3).diagonal().setConstant(1 / kGyroPrior);
  root.block<3, 3>(3, 6).diagonal().setConstant(1 / kAccelerationPrior);
  ceres::Vector mean = ceres::Vector::Zero(9);
  mean.segment<3>(3) = step.motion.bias.gyro;
  problem.AddResidualBlock(new ceres::NormalPrior(root, mean), nullptr, motions_[step.i].data());
}

void InertialProblem::finish() {
  for (std::size_t k = 0; k < inertial_.gravity.size(); ++k)
    if (const auto gravity = gravity_.find(anchors_[k]); gravity != gravity_.end())
      inertial_.gravity[k] = pose(poses_[k]).linear().transpose() * gravity->second;
}

}  // namespace cairn
