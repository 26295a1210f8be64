// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <optional>
#include <string>

#include "cairn/frame.hpp"
#include "cairn/reports.hpp"

namespace cairn {

/// A frame without what of it cannot be used beside the depth image, its depth corrected as the rig says; or why none
/// of it can be used.
class CheckedFrame {
 public:
  /// `before`: timestamp of the last fused frame. The frame must live as long as this.
  CheckedFrame(const Frame& given, const Rig& rig, std::optional<double> before);
  /// Asks also for a pose at which single precision still tells neighbouring voxels of this size apart.
  void expect_pose(float voxel_size);
  /// Measurements of a smaller confidence are none.
  void drop_doubtful(std::uint8_t least);
  void refuse(FrameCause cause, std::string reason = {});

  [[nodiscard]] bool is_usable() const { return cause_ == FrameCause::none || cause_ == FrameCause::partly_used; }
  [[nodiscard]] FrameCause cause() const { return cause_; }
  [[nodiscard]] const std::string& reason() const { return reason_; }
  [[nodiscard]] const Frame& frame() const { return mended_ ? *mended_ : *given_; }

 private:
  const Frame* given_;
  std::optional<Frame> mended_;
  FrameCause cause_ = FrameCause::none;
  std::string reason_;
};

}  // namespace cairn
