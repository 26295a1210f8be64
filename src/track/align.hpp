// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <array>
#include <optional>
#include <vector>

#include "cairn/options.hpp"
#include "cairn/pose.hpp"
#include "cairn/reports.hpp"
#include "cairn/sensor_model.hpp"
#include "gpu/kernel.hpp"
#include "shaders/track.h"
#include "surface/prediction.hpp"

namespace cairn {

struct Alignment {
  Eigen::Isometry3d submap_from_camera = Eigen::Isometry3d::Identity();
  Matrix6d information = Matrix6d::Zero();  // of (rotation, translation) in the model view's frame; 1/rad^2, 1/m^2
  AlignmentFit fit;
  double gain = 1.0, bias = 0.0;  // keyframe brightness = gain * live + bias
  /// How badly brightness fits if the colour camera's clock were ahead by kClockOffsets; empty when the camera is slow.
  std::vector<double> clock_offset_costs;
  FrameCause lost = FrameCause::none;  // why the pose is not to be trusted
  [[nodiscard]] bool converged() const { return lost == FrameCause::none; }
};

/// `close`: only at the finest level, and what lies far beside the map counts nothing: for a guess that is right where
/// something else in view moves.
enum class Reach { wide, close };

/// When and how the colour image of a frame was taken, beside its depth image.
struct ColourMoment {
  Vector6d velocity = Vector6d::Zero();  // of the camera, in its own frame: rad/s, m/s
  double stamp_delay = 0.0;              // seconds from the depth image's stamp to the colour image's
  double clock_offset = 0.0;             // seconds that the colour camera's clock is ahead of the depth camera's
  [[nodiscard]] double delay() const { return stamp_delay - clock_offset; }
};

/// Candidates, in seconds. None is 0: there pixels would fall on pixels, and interpolation, which smooths noise away,
/// would make every other candidate fit better.
constexpr std::array<double, 8> kClockOffsets{-0.035, -0.025, -0.015, -0.005, 0.005, 0.015, 0.025, 0.035};

/// Reference of the photometric term: a fused frame's brightness, kept on the device.
class PhotometricKeyframe {
 public:
  PhotometricKeyframe(gpu::Device& device, const Camera& camera, const TrackOptions& options);
  /// Copies the surface's brightness; it must have colour.
  void set(const Surface& surface, const Eigen::Isometry3d& submap_from_camera, const ColourMoment& moment);
  void clear() { is_set_ = false; }
  /// What it holds, to go on with later; `levels` empty: not set.
  struct Saved {
    Eigen::Isometry3d submap_from_camera = Eigen::Isometry3d::Identity();
    ColourMoment moment;
    std::vector<std::vector<std::uint32_t>> levels;
  };
  [[nodiscard]] Saved save() const;
  void restore(const Saved& saved);
  [[nodiscard]] bool is_set() const { return is_set_; }
  [[nodiscard]] const Eigen::Isometry3d& submap_from_camera() const { return submap_from_camera_; }  // depth camera
  /// The colour camera at its moment, if its clock is ahead by `clock_offset`.
  [[nodiscard]] Eigen::Isometry3d submap_from_colour(double clock_offset) const;
  [[nodiscard]] const gpu::Buffer& level(int level) const { return packed_[static_cast<std::size_t>(level)]; }

 private:
  gpu::Device& device_;
  Eigen::Isometry3d submap_from_camera_ = Eigen::Isometry3d::Identity();
  ColourMoment moment_;
  std::vector<gpu::Buffer> packed_;
  bool is_set_ = false;
};

/// Coarse-to-fine alignment of a live surface with the map: projective point-to-plane ICP against the model's surface,
/// and brightness against a keyframe. Each term is weighted by the scale of its own residuals. Directions that the
/// geometry does not observe are left to brightness, those that neither observes to the guess (Zhang, Kaess & Singh
/// 2016).
class Aligner {
 public:
  Aligner(gpu::Device& device, const TrackOptions& options, const SensorModel& sensor = {});
  /// `keyframe` may be null or not set: geometry alone.
  [[nodiscard]] Alignment align(const Surface& live, const SurfacePrediction& model, const Eigen::Isometry3d& guess,
                                const PhotometricKeyframe* keyframe = nullptr, const ColourMoment& moment = {},
                                Reach reach = Reach::wide);

 private:
  struct Tiling;
  struct Views;
  struct Brightness;
  struct Estimate;

  [[nodiscard]] int coarsest(Reach reach) const;
  [[nodiscard]] bool descend(const Views& views, Estimate& estimate);
  void linearise(const Views& views, int level, bool crossed, Estimate& estimate);
  [[nodiscard]] static bool find_degenerate_directions(bool can_repeat, Estimate& estimate);
  [[nodiscard]] bool step(const Views& views, int level, Estimate& estimate) const;
  [[nodiscard]] Alignment judge(const Views& views, const Estimate& estimate);
  [[nodiscard]] shader::PhotometricReducePush photometric_push(const Camera& camera,
                                                               const PhotometricKeyframe& keyframe,
                                                               const Eigen::Isometry3d& submap_from_live,
                                                               const ColourMoment& moment, const Brightness& brightness,
                                                               const Tiling& tiling) const;
  [[nodiscard]] std::vector<double> clock_offset_costs(const Surface& live, const PhotometricKeyframe& keyframe,
                                                       const Eigen::Isometry3d& submap_from_live,
                                                       const ColourMoment& moment, const Brightness& brightness);

  gpu::Device& device_;
  TrackOptions options_;
  // Sums that a workgroup writes, as its device tells; the shader knows better.
  std::uint32_t geometry_parts_, photometric_parts_;
  gpu::Buffer geometry_sums_, crossed_sums_, photometric_sums_;
  std::vector<shader::IcpSums> geometry_read_, crossed_read_;  // from them
  std::vector<shader::PhotometricSums> photometric_read_;
  gpu::Kernel<shader::IcpReducePush> icp_;
  gpu::Kernel<shader::PhotometricReducePush> photometric_;
};

}  // namespace cairn
