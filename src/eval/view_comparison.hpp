// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstddef>
#include <functional>
#include <vector>

#include "cairn/eval/evaluation.hpp"
#include "cairn/mapping/pose.hpp"
#include "geometry/color_view.hpp"

namespace cairn {

/// Compares frames of a recording with renderings of a map, without distortion and rolling shutter.
class ViewComparison {
 public:
  /// `samples`: see render_mesh.
  using Render =
      std::function<RenderedView(const Camera& camera, const Eigen::Isometry3d& world_from_camera, int samples)>;
  ViewComparison(Render render, const Rig& rig);
  /// Renders a mesh. `parts` must outlive this object.
  ViewComparison(const std::vector<Mesh>& parts, const Rig& rig);
  struct Pixel {
    float seen, drawn;  // meters along z at the frame's time; drawn 0: no mesh
  };
  /// Measured depth and rendered depth of the mesh, in the depth camera. `velocity`: in the camera frame, rad/s and
  /// m/s.
  [[nodiscard]] std::vector<Pixel> compare_depth(const Frame& frame, const Eigen::Isometry3d& world_from_camera,
                                                 const Vector6d& velocity) const;
  /// Accumulates the color error over the pixels where the mesh agrees with the measured depth. `delay`: seconds from
  /// the depth to the color image.
  void compare_color(Frame frame, const Eigen::Isometry3d& world_from_camera, const Vector6d& velocity, double delay);
  /// dB over all compared pixels; 0 without any.
  [[nodiscard]] double psnr() const { return psnr(squared_); }
  /// The same, after a least-squares gain per image and channel.
  [[nodiscard]] double psnr_with_gain() const { return psnr(squared_with_gain_); }
  /// Share of the measured pixels that were compared.
  [[nodiscard]] double covered() const;
  /// Meters along z, where measured and rendered depth are within 10 cm; 0 without any.
  [[nodiscard]] double depth_rmse() const;
  /// All errors, over `frames` images.
  [[nodiscard]] ViewError error(int frames) const;
  [[nodiscard]] bool has_compared() const { return compared_ > 0; }

 private:
  [[nodiscard]] double psnr(double squared) const;

  Render render_;
  Rig rig_;
  ColorView in_color_;
  double squared_ = 0, squared_with_gain_ = 0;
  std::size_t compared_ = 0, measured_ = 0;
  double depth_squared_ = 0;
  std::size_t depths_ = 0;
};

/// Compares every `step`-th frame with a color image and a pose, see evaluate_views.
[[nodiscard]] ViewError compare_views(ViewComparison& views, Source& recording,
                                      const Eigen::Isometry3d& world_from_recording, int step);

}  // namespace cairn
