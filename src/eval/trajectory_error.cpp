// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Definitions of the TUM RGB-D benchmark's evaluate_ate and evaluate_rpe (Sturm et al. 2012).
#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <tuple>

#include "cairn/eval/evaluation.hpp"
#include "eval/statistics.hpp"

namespace cairn {
namespace {

/// Index pairs (estimate, truth), one to one, in ascending time difference.
std::vector<std::pair<std::size_t, std::size_t>> associate(const Trajectory& estimate, const Trajectory& truth,
                                                           double max_difference) {
  std::vector<std::tuple<double, std::size_t, std::size_t>> candidates;
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    const double t = estimate[i].timestamp;
    auto it = std::lower_bound(truth.begin(), truth.end(), t - max_difference,
                               [](const StampedPose& p, double time) { return p.timestamp < time; });
    for (; it != truth.end() && it->timestamp <= t + max_difference; ++it)
      candidates.emplace_back(std::abs(it->timestamp - t), i, static_cast<std::size_t>(it - truth.begin()));
  }
  std::sort(candidates.begin(), candidates.end());
  std::vector<bool> used_estimate(estimate.size()), used_truth(truth.size());
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (const auto& [difference, i, j] : candidates) {
    if (used_estimate[i] || used_truth[j]) continue;
    used_estimate[i] = used_truth[j] = true;
    pairs.emplace_back(i, j);
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

std::size_t nearest(const Trajectory& trajectory, double time) {
  const auto after = std::lower_bound(trajectory.begin(), trajectory.end(), time,
                                      [](const StampedPose& p, double t) { return p.timestamp < t; });
  if (after == trajectory.begin()) return 0;
  if (after == trajectory.end()) return trajectory.size() - 1;
  const auto before = after - 1;
  return static_cast<std::size_t>((time - before->timestamp <= after->timestamp - time ? before : after) -
                                  trajectory.begin());
}

}  // namespace

TrajectoryError evaluate_trajectory(const Trajectory& estimate, const Trajectory& truth, double rpe_interval,
                                    double max_time_difference) {
  for (const double seconds : {rpe_interval, max_time_difference})
    if (!(seconds > 0 && std::isfinite(seconds)))
      throw std::runtime_error(std::to_string(seconds) +
                               " s is not a valid time between poses: it must be more than 0");
  const auto pairs = associate(estimate, truth, max_time_difference);
  if (pairs.size() < 3)
    throw std::runtime_error("only " + std::to_string(pairs.size()) + " of " + std::to_string(estimate.size()) +
                             " poses have a true pose within " + std::to_string(max_time_difference) +
                             " s: do both files use the same clock?");
  TrajectoryError error{.rpe_interval = rpe_interval,
                        .estimated_poses = static_cast<int>(estimate.size()),
                        .matched_poses = static_cast<int>(pairs.size())};
  Eigen::Matrix3Xd from(3, static_cast<Eigen::Index>(pairs.size())), to(3, static_cast<Eigen::Index>(pairs.size()));
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    from.col(static_cast<Eigen::Index>(k)) = estimate[pairs[k].first].world_from_camera.translation();
    to.col(static_cast<Eigen::Index>(k)) = truth[pairs[k].second].world_from_camera.translation();
  }
  error.truth_from_estimate = Eigen::Isometry3d(Eigen::umeyama(from, to, false));
  std::vector<double> distances;
  for (Eigen::Index k = 0; k < from.cols(); ++k)
    distances.push_back((error.truth_from_estimate * from.col(k) - to.col(k)).norm());
  error.ate = statistics(std::move(distances));

  // Pairs each estimate with the estimate one interval later, both with the true pose nearest in time. True poses more
  // than two usual steps away are rejected.
  std::vector<double> steps;
  for (std::size_t i = 1; i < truth.size(); ++i) steps.push_back(truth[i].timestamp - truth[i - 1].timestamp);
  std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2), steps.end());
  const double max_gap = 2.0 * steps[steps.size() / 2];
  std::vector<double> translations, rotations;
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    const std::size_t j = nearest(estimate, estimate[i].timestamp + rpe_interval);
    if (j == estimate.size() - 1) continue;
    const std::size_t a = nearest(truth, estimate[i].timestamp), b = nearest(truth, estimate[j].timestamp);
    if (std::abs(truth[a].timestamp - estimate[i].timestamp) > max_gap ||
        std::abs(truth[b].timestamp - estimate[j].timestamp) > max_gap)
      continue;
    const Eigen::Isometry3d estimated_motion = estimate[i].world_from_camera.inverse() * estimate[j].world_from_camera;
    const Eigen::Isometry3d true_motion = truth[a].world_from_camera.inverse() * truth[b].world_from_camera;
    const Eigen::Isometry3d difference = estimated_motion * true_motion.inverse();
    translations.push_back(difference.translation().norm());
    rotations.push_back(Eigen::AngleAxisd(difference.linear()).angle());
  }
  error.rpe_translation = statistics(std::move(translations));
  error.rpe_rotation = statistics(std::move(rotations));
  return error;
}

Eigen::Isometry3d estimate_from_truth(const Trajectory& estimate, const Trajectory& truth) {
  Eigen::Vector4d rotation = Eigen::Vector4d::Zero();
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> positions;
  for (const StampedPose& pose : estimate) {
    const auto exact = pose_at(truth, pose.timestamp);
    if (!exact) continue;
    const Eigen::Vector4d q =
        Eigen::Quaterniond(pose.world_from_camera.linear() * exact->linear().transpose()).coeffs();
    rotation += rotation.dot(q) < 0 ? Eigen::Vector4d(-q) : q;
    positions.emplace_back(pose.world_from_camera.translation(), exact->translation());
  }
  if (positions.empty()) throw std::runtime_error("no pose of the estimate has a true pose at its time");
  Eigen::Isometry3d move = Eigen::Isometry3d::Identity();
  move.linear() = Eigen::Quaterniond(rotation.normalized()).toRotationMatrix();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  for (const auto& [found, exact] : positions) translation += found - move.linear() * exact;
  move.translation() = translation / static_cast<double>(positions.size());
  return move;
}

}  // namespace cairn
