// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstddef>
#include <vector>

#include "cairn/eval/evaluation.hpp"
#include "cairn/mapping/pose.hpp"
#include "geometry/color_view.hpp"

namespace cairn {

/// Compares frames of a recording with renderings of a mesh, without distortion and rolling shutter.
class ViewComparison {
 public:
  /// `parts` must outlive this object.
  ViewComparison(const std::vector<Mesh>& parts, const Rig& rig);
  struct Pixel {
    float seen, drawn;  // meters along z at the frame's time; drawn 0: no mesh
  };
  /// Measured depth and rendered depth of the mesh, in the depth camera. `velocity`: in the camera frame, rad/s and
  /// m/s.
  [[nodiscard]] std::vector<Pixel> compare_depth(const Frame& frame, const Eigen::Isometry3d& world_from_camera,
                                                 const Vector6d& velocity) const;
  /// Accumulates the color error over the pixels where the mesh agrees with the measured depth.
  void compare_color(Frame frame, const Eigen::Isometry3d& world_from_camera, const Vector6d& velocity);
  /// dB over all compared pixels; 0 without any.
  [[nodiscard]] double psnr() const;
  /// Share of the measured pixels that were compared.
  [[nodiscard]] double covered() const;
  [[nodiscard]] bool has_compared() const { return compared_ > 0; }

 private:
  const std::vector<Mesh>& parts_;
  Rig rig_;
  ColorView in_color_;
  double squared_ = 0;
  std::size_t compared_ = 0, measured_ = 0;
};

}  // namespace cairn
