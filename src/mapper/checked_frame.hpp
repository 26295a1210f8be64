// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <optional>
#include <string>

#include "cairn/mapping/frame.hpp"
#include "cairn/mapping/reports.hpp"

namespace cairn {

/// Validated frame: invalid data other than the depth image is dropped, and the rig's depth correction is applied. An
/// unusable frame has a cause instead.
class CheckedFrame {
 public:
  /// `previous`: timestamp of the last fused frame. The frame must outlive this object.
  CheckedFrame(const Frame& given, const Rig& rig, std::optional<double> previous);
  /// Requires a valid pose, near enough to the origin that single precision separates neighboring voxels of this size.
  void expect_pose(float voxel_size);
  /// Drops depth measurements with a smaller confidence.
  void drop_low_confidence(std::uint8_t min_confidence);
  void reject(FrameCause cause, std::string reason = {});

  [[nodiscard]] bool is_usable() const { return cause_ == FrameCause::none || cause_ == FrameCause::partly_used; }
  [[nodiscard]] FrameCause cause() const { return cause_; }
  [[nodiscard]] const std::string& reason() const { return reason_; }
  [[nodiscard]] const Frame& frame() const { return corrected_ ? *corrected_ : *given_; }

 private:
  const Frame* given_;
  std::optional<Frame> corrected_;
  FrameCause cause_ = FrameCause::none;
  std::string reason_;
};

/// Count of identical depth images in sequence, from a stuck driver.
struct RepeatedImages {
  /// Counts a frame's image. Returns true if the same image was delivered too often.
  [[nodiscard]] bool is_stuck(const Frame& frame);

  std::size_t last_depth_hash = 0;  // hash of the last frame's depth
  int count = 0;                    // frames since this image was new
};

}  // namespace cairn
