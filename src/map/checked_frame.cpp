// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/checked_frame.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace cairn {
namespace {

constexpr double kRigid = 1e-3;         // max. deviation of R * R^T from the identity
constexpr double kFarthestVoxel = 4e6;  // voxels from the origin: single precision still separates neighboring voxels

/// Reason why a frame is unusable as a whole, or none.
FrameCause unusable(const Frame& frame, const Camera& camera, std::optional<double> before) {
  const auto pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  if (frame.problem) return FrameCause::unreadable;
  if (frame.depth.empty() || frame.depth.size() != pixels) return FrameCause::wrong_size;
  float least = frame.depth[0], most = least;
  bool is_depth = true;
  for (const float z : frame.depth) {
    least = std::min(least, z), most = std::max(most, z);
    is_depth &= z >= 0 && z <= std::numeric_limits<float>::max();
  }
  if (!is_depth) return FrameCause::bad_depth;
  if (least > 0 && least == most) return FrameCause::constant_depth;
  if (!std::isfinite(frame.timestamp)) return FrameCause::bad_timestamp;
  if (before && frame.timestamp <= *before) return FrameCause::timestamp_goes_back;
  return FrameCause::none;
}

}  // namespace

CheckedFrame::CheckedFrame(const Frame& given, const Rig& rig, std::optional<double> before) : given_(&given) {
  if (std::any_of(given.gyro.begin(), given.gyro.end(),
                  [](const AngularRate& r) { return !std::isfinite(r.timestamp) || !r.rate.allFinite(); })) {
    mended_ = given;
    mended_->gyro.clear();
    cause_ = FrameCause::partly_used;
    reason_ = "its gyroscope's rates are not numbers: they are left out";
  }
  if (const FrameCause cause = unusable(given, rig.depth, before); cause != FrameCause::none) {
    refuse(cause, given.problem.value_or(""));
    return;
  }
  const auto leave_out = [&](const char* reason, const auto& what) {
    if (!mended_) mended_ = given;
    what(*mended_);
    cause_ = FrameCause::partly_used;
    reason_ += (reason_.empty() ? "" : "; ") + std::string(reason);
  };
  if (!given.colour.empty() && given.colour.size() != static_cast<std::size_t>(rig.colour_view().width) *
                                                          static_cast<std::size_t>(rig.colour_view().height))
    leave_out("its colour image is not of the camera's size: depth alone is used", [](Frame& f) { f.colour.clear(); });
  if (!given.confidence.empty() && given.confidence.size() != given.depth.size())
    leave_out("its confidence is not of the depth image's size: it is left out",
              [](Frame& f) { f.confidence.clear(); });
  else if (!given.confidence.empty())
    drop_doubtful(rig.sensor.least_confidence);
  if (!std::isfinite(given.colour_delay))
    leave_out("the colour image's time is not a number: depth alone is used", [](Frame& f) {
      f.colour.clear();
      f.colour_delay = 0;
    });
  if (given.acceleration && !given.acceleration->allFinite())
    leave_out("its acceleration is not a number: it is left out", [](Frame& f) { f.acceleration.reset(); });
  if (rig.depth_correction.empty()) return;
  if (!mended_) mended_ = given;
  rig.depth_correction.apply(rig.depth.width, rig.depth.height, mended_->depth);
}

void CheckedFrame::expect_pose(float voxel_size) {
  if (!is_usable()) return;
  const auto& pose = given_->world_from_camera;
  if (!pose) return refuse(FrameCause::no_pose);
  const Eigen::Matrix3d rotation = pose->linear();
  if (!pose->matrix().allFinite() || !(rotation * rotation.transpose()).isIdentity(kRigid) ||
      rotation.determinant() < 0)
    return refuse(FrameCause::bad_pose);
  if (pose->translation().norm() > kFarthestVoxel * static_cast<double>(voxel_size)) refuse(FrameCause::far_pose);
}

void CheckedFrame::drop_doubtful(std::uint8_t least) {
  if (!mended_) mended_ = *given_;
  for (std::size_t i = 0; i < mended_->depth.size(); ++i)
    if (mended_->confidence[i] < least) mended_->depth[i] = 0;
  mended_->confidence.clear();
}

void CheckedFrame::refuse(FrameCause cause, std::string reason) {
  cause_ = cause;
  reason_ = reason.empty() ? std::string(text_of(cause)) : std::move(reason);
}

}  // namespace cairn
