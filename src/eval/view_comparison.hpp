// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstddef>
#include <vector>

#include "base/colour_view.hpp"
#include "cairn/evaluation.hpp"
#include "cairn/pose.hpp"

namespace cairn {

/// Holds frames of a recording against pictures of a mesh, without lens and rolling shutter.
class ViewComparison {
 public:
  /// `parts` must outlive it.
  ViewComparison(const std::vector<Mesh>& parts, const Rig& rig);
  struct Pixel {
    float seen, drawn;  // metres along z at the frame's time; drawn 0: no mesh there
  };
  /// What the depth camera measured, and what it would measure of the mesh. `velocity`: in its own frame, rad/s and
  /// m/s.
  [[nodiscard]] std::vector<Pixel> compare_depth(const Frame& frame, const Eigen::Isometry3d& world_from_camera,
                                                 const Vector6d& velocity) const;
  /// Counts the pixels of the colour camera where the mesh lies where it measured something.
  void compare_colour(Frame frame, const Eigen::Isometry3d& world_from_camera, const Vector6d& velocity);
  /// dB of all that was compared; 0: nothing was.
  [[nodiscard]] double psnr() const;
  /// Of all that was measured, the share that was compared.
  [[nodiscard]] double covered() const;
  [[nodiscard]] bool has_compared() const { return compared_ > 0; }

 private:
  const std::vector<Mesh>& parts_;
  Rig rig_;
  ColourView in_colour_;
  double squared_ = 0;
  std::size_t compared_ = 0, measured_ = 0;
};

}  // namespace cairn
