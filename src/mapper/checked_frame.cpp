// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mapper/checked_frame.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string_view>
#include <utility>

namespace cairn {
namespace {

constexpr double kRotationTolerance = 1e-3;  // max. deviation of R * R^T from the identity
// Voxels from the origin: single precision still separates neighboring voxels.
constexpr double kMaxDistanceVoxels = 4e6;
constexpr int kMaxRepeats = 2;  // of a depth image

/// Reason why a frame is unusable as a whole, or none.
FrameCause unusable(const Frame& frame, const Camera& camera, std::optional<double> previous) {
  const auto pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  if (frame.problem) return FrameCause::unreadable;
  if (frame.depth.empty() || frame.depth.size() != pixels) return FrameCause::wrong_size;
  float min_depth = frame.depth[0], max_depth = min_depth;
  bool is_depth = true;
  for (const float z : frame.depth) {
    min_depth = std::min(min_depth, z), max_depth = std::max(max_depth, z);
    is_depth &= z >= 0 && z <= std::numeric_limits<float>::max();
  }
  if (!is_depth) return FrameCause::bad_depth;
  if (min_depth > 0 && min_depth == max_depth) return FrameCause::constant_depth;
  if (!std::isfinite(frame.timestamp)) return FrameCause::bad_timestamp;
  if (previous && frame.timestamp <= *previous) return FrameCause::timestamp_goes_back;
  return FrameCause::none;
}

}  // namespace

CheckedFrame::CheckedFrame(const Frame& given, const Rig& rig, std::optional<double> previous) : given_(&given) {
  const auto drop = [&](const char* reason, const auto& remove) {
    if (!corrected_) corrected_ = given;
    remove(*corrected_);
    cause_ = FrameCause::partly_used;
    reason_ += (reason_.empty() ? "" : "; ") + std::string(reason);
  };
  if (std::any_of(given.gyro.begin(), given.gyro.end(),
                  [](const AngularRate& r) { return !std::isfinite(r.timestamp) || !r.rate.allFinite(); }))
    drop("gyroscope rates are not finite: ignored", [](Frame& f) { f.gyro.clear(); });
  if (std::any_of(given.accelerations.begin(), given.accelerations.end(),
                  [](const Acceleration& a) { return !std::isfinite(a.timestamp) || !a.value.allFinite(); }))
    drop("accelerations are not finite: ignored", [](Frame& f) { f.accelerations.clear(); });
  if (const FrameCause cause = unusable(given, rig.depth, previous); cause != FrameCause::none) {
    reject(cause, given.problem.value_or(""));
    return;
  }
  if (!given.color.empty() && given.color.size() != static_cast<std::size_t>(rig.color_view().width) *
                                                        static_cast<std::size_t>(rig.color_view().height))
    drop("color image size differs from the camera's: only depth is used", [](Frame& f) { f.color.clear(); });
  if (!given.confidence.empty() && given.confidence.size() != given.depth.size())
    drop("confidence image size differs from the depth image's: ignored", [](Frame& f) { f.confidence.clear(); });
  else if (!given.confidence.empty())
    drop_low_confidence(rig.sensor.min_confidence);
  if (!std::isfinite(given.color_delay))
    drop("color timestamp is not finite: only depth is used", [](Frame& f) {
      f.color.clear();
      f.color_delay = 0;
    });
  if (given.acceleration && !given.acceleration->allFinite())
    drop("acceleration is not finite: ignored", [](Frame& f) { f.acceleration.reset(); });
  if (rig.depth_correction.empty()) return;
  if (!corrected_) corrected_ = given;
  rig.depth_correction.apply(rig.depth.width, rig.depth.height, corrected_->depth);
}

void CheckedFrame::expect_pose(float voxel_size) {
  if (!is_usable()) return;
  const auto& pose = given_->world_from_camera;
  if (!pose) return reject(FrameCause::no_pose);
  const Eigen::Matrix3d rotation = pose->linear();
  if (!pose->matrix().allFinite() || !(rotation * rotation.transpose()).isIdentity(kRotationTolerance) ||
      rotation.determinant() < 0)
    return reject(FrameCause::bad_pose);
  if (pose->translation().norm() > kMaxDistanceVoxels * static_cast<double>(voxel_size)) reject(FrameCause::far_pose);
}

void CheckedFrame::drop_low_confidence(std::uint8_t min_confidence) {
  if (!corrected_) corrected_ = *given_;
  for (std::size_t i = 0; i < corrected_->depth.size(); ++i)
    if (corrected_->confidence[i] < min_confidence) corrected_->depth[i] = 0;
  corrected_->confidence.clear();
}

void CheckedFrame::reject(FrameCause cause, std::string reason) {
  cause_ = cause;
  reason_ = reason.empty() ? std::string(to_string(cause)) : std::move(reason);
}

/// Sensor noise never repeats exactly. A driver may deliver an image twice, but not more often.
bool RepeatedImages::is_stuck(const Frame& frame) {
  const std::size_t image = std::hash<std::string_view>()(
      {reinterpret_cast<const char*>(frame.depth.data()), frame.depth.size() * sizeof(float)});
  count = image == last_depth_hash ? count + 1 : 0;
  last_depth_hash = image;
  return count > kMaxRepeats;
}

}  // namespace cairn
