// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <optional>
#include <string>

#include "cairn/frame.hpp"
#include "cairn/reports.hpp"

namespace cairn {

/// Validated frame: invalid data other than the depth image is dropped, and the rig's depth correction is applied. An
/// unusable frame has a cause instead.
class CheckedFrame {
 public:
  /// `before`: timestamp of the last fused frame. The frame must outlive this object.
  CheckedFrame(const Frame& given, const Rig& rig, std::optional<double> before);
  /// Requires a valid pose, near enough to the origin that single precision separates neighboring voxels of this size.
  void expect_pose(float voxel_size);
  /// Drops depth measurements with a smaller confidence.
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
