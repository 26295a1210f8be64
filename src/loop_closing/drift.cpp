// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "loop_closing/drift.hpp"

#include "graph/inflate_information.hpp"

namespace cairn {
namespace {

constexpr std::size_t kBlock = 8;  // steps, or blocks of the level below

/// Covariance of the pose at `to`, from the covariance of the pose at `middle` and the covariance of `to` relative to
/// `middle`.
Matrix6d chained(const Matrix6d& until_middle, const Eigen::Isometry3d& middle, const Matrix6d& since,
                 const Eigen::Isometry3d& to) {
  const Matrix6d ad = adjoint(to.inverse() * middle);
  return ad * until_middle * ad.transpose() + since;
}

}  // namespace

void Drift::update(const std::vector<Keyframe>& keyframes) {
  for (std::size_t k = first_of_component_.size(); k < keyframes.size(); ++k) {
    first_of_component_.push_back(k > 0 && keyframes[k].follows ? first_of_component_.back() : k);
    std::size_t length = kBlock;
    for (std::size_t level = 0; k > 0 && k % length == 0; ++level, length *= kBlock) {
      const Matrix6d block = sum(keyframes, k - length, k, level);
      if (blocks_.size() == level) blocks_.emplace_back();
      blocks_[level].push_back(block);
    }
  }
}

std::optional<Matrix6d> Drift::covariance(const std::vector<Keyframe>& keyframes, std::size_t from,
                                          std::size_t to) const {
  if (first_of_component_[from] != first_of_component_[to]) return std::nullopt;
  return sum(keyframes, from, to, blocks_.size());
}

Matrix6d Drift::sum(const std::vector<Keyframe>& keyframes, std::size_t from, std::size_t to,
                    std::size_t levels) const {
  Matrix6d covariance = Matrix6d::Zero();
  for (std::size_t k = from; k < to;) {
    std::size_t level = 0, length = 1;  // of the longest block that starts here
    while (level < levels && k % (kBlock * length) == 0 && k + kBlock * length <= to) ++level, length *= kBlock;
    const Matrix6d step = level == 0 ? Matrix6d(inflate_information(keyframes[k + 1].information).inverse())
                                     : blocks_[level - 1][k / length];
    covariance =
        chained(covariance, keyframes[k].odometry_from_camera, step, keyframes[k + length].odometry_from_camera);
    k += length;
  }
  return covariance;
}

}  // namespace cairn
