// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/trajectory.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <sstream>
#include <stdexcept>

#include "base/atomic_file.hpp"
#include "base/lines.hpp"
#include "base/words.hpp"

namespace cairn {

Trajectory read_trajectory(const std::filesystem::path& file) {
  Trajectory trajectory;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    const auto error = [&](const std::string& why) {
      return std::runtime_error(file.string() + ":" + std::to_string(line) + ": " + why +
                                "; expected `timestamp tx ty tz qx qy qz qw`");
    };
    std::vector<double> v;
    for (std::string word : words) {
      std::replace(word.begin(), word.end(), ',', ' ');
      std::istringstream parts(word);
      for (std::string part; parts >> part;) {
        const auto value = number_in(part);
        if (!value) throw error("'" + shown(part) + "' is not a number");
        if (!std::isfinite(*value)) throw error("a number is not finite");
        v.push_back(*value);
      }
    }
    if (v.size() != 8) throw error(v.size() < 8 ? "fewer than 8 numbers" : "more than 8 numbers");
    const Eigen::Quaterniond q(v[7], v[4], v[5], v[6]);
    if (!is_rotation(q)) throw error("the quaternion is zero or too large");
    StampedPose pose{.timestamp = v[0]};
    pose.world_from_camera.linear() = q.normalized().toRotationMatrix();
    pose.world_from_camera.translation() = Eigen::Vector3d(v[1], v[2], v[3]);
    trajectory.push_back(pose);
  });
  if (trajectory.empty()) throw std::runtime_error(file.string() + ": holds no pose");
  std::stable_sort(trajectory.begin(), trajectory.end(),
                   [](const StampedPose& a, const StampedPose& b) { return a.timestamp < b.timestamp; });
  return trajectory;
}

void write_trajectory(const std::filesystem::path& file, const Trajectory& trajectory) {
  write_whole(file, [&](std::ostream& out) {
    out << "# timestamp tx ty tz qx qy qz qw: world_from_camera, seconds and meters\n" << std::fixed;
    for (const auto& [timestamp, pose] : trajectory) {
      Eigen::Quaterniond q(pose.linear());
      if (q.w() < 0) q.coeffs() = -q.coeffs();
      out << std::setprecision(6) << timestamp << std::setprecision(9);
      for (const double v :
           {pose.translation().x(), pose.translation().y(), pose.translation().z(), q.x(), q.y(), q.z(), q.w()})
        out << ' ' << v;
      out << '\n';
    }
  });
}

std::optional<Eigen::Isometry3d> pose_at(const Trajectory& trajectory, double timestamp, double max_gap) {
  const auto after = std::lower_bound(trajectory.begin(), trajectory.end(), timestamp,
                                      [](const StampedPose& p, double t) { return p.timestamp < t; });
  if (after != trajectory.end() && after->timestamp == timestamp) return after->world_from_camera;
  if (after == trajectory.begin() || after == trajectory.end()) return std::nullopt;
  const auto before = after - 1;
  const double gap = after->timestamp - before->timestamp;
  if (gap > max_gap) return std::nullopt;
  const double s = (timestamp - before->timestamp) / gap;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::Quaterniond(before->world_from_camera.linear())
                      .slerp(s, Eigen::Quaterniond(after->world_from_camera.linear()))
                      .toRotationMatrix();
  pose.translation() = (1 - s) * before->world_from_camera.translation() + s * after->world_from_camera.translation();
  return pose;
}

}  // namespace cairn
