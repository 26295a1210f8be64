// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <array>
#include <optional>
#include <vector>

#include "cairn/mapping/options.hpp"
#include "cairn/mapping/pose.hpp"
#include "cairn/mapping/reports.hpp"
#include "cairn/mapping/sensor_model.hpp"
#include "gpu/kernel.hpp"
#include "preprocess/prediction.hpp"
#include "shaders/track.h"

namespace cairn {

struct Alignment {
  Eigen::Isometry3d submap_from_camera = Eigen::Isometry3d::Identity();
  Matrix6d information = Matrix6d::Zero();  // of (rotation, translation) in the model view's frame; 1/rad^2, 1/m^2
  AlignmentFit fit;
  double gain = 1.0, bias = 0.0;  // keyframe brightness = gain * live + bias
  /// Photometric cost for each of kClockOffsets of the color camera's clock; empty if the camera turns slowly.
  std::vector<double> clock_offset_costs;
  FrameCause lost = FrameCause::none;  // reason why the pose is unreliable
  [[nodiscard]] bool converged() const { return lost == FrameCause::none; }
};

/// `finest_only`: only the finest level, and points far from the map have no weight; for a correct guess with other
/// objects moving in view.
enum class AlignmentRange { coarse_to_fine, finest_only };

/// Time and motion of a frame's color image relative to its depth image.
struct ColorMoment {
  Vector6d velocity = Vector6d::Zero();  // of the camera, in its own frame: rad/s, m/s
  double stamp_delay = 0.0;              // seconds from the depth image's stamp to the color image's
  double clock_offset = 0.0;             // seconds by which the color camera's clock is ahead of the depth camera's
  [[nodiscard]] double delay() const { return stamp_delay - clock_offset; }
};

/// Assumed motion of a rolling shutter correction: from the preceding frame to a predicted pose.
struct ShutterCorrection {
  Eigen::Isometry3d submap_from_camera = Eigen::Isometry3d::Identity();
  double readout = 0;  // share of the frame interval; 0: the correction does not depend on the pose
};

/// Candidates, in seconds. 0 is not among them: pixels would coincide there, and interpolation, which smooths noise,
/// would make every other candidate fit better.
constexpr std::array<double, 8> kClockOffsets{-0.035, -0.025, -0.015, -0.005, 0.005, 0.015, 0.025, 0.035};

/// Reference of the photometric term: a fused frame's brightness, stored on the device.
class PhotometricKeyframe {
 public:
  PhotometricKeyframe(gpu::Device& device, const Camera& camera, const TrackOptions& options);
  /// Copies the surface's brightness; the surface must have color.
  void set(const FramePyramid& surface, const Eigen::Isometry3d& submap_from_camera, const ColorMoment& moment);
  void clear() { is_set_ = false; }
  /// State for resuming; `levels` empty: not set.
  struct SavedState {
    Eigen::Isometry3d submap_from_camera = Eigen::Isometry3d::Identity();
    ColorMoment moment;
    std::vector<std::vector<std::uint32_t>> levels;
  };
  [[nodiscard]] SavedState save() const;
  void restore(const SavedState& saved);
  [[nodiscard]] bool is_set() const { return is_set_; }
  [[nodiscard]] const Eigen::Isometry3d& submap_from_camera() const { return submap_from_camera_; }  // depth camera
  /// Pose of the color camera at the time of its image, for a clock ahead by `clock_offset`.
  [[nodiscard]] Eigen::Isometry3d submap_from_color(double clock_offset) const;
  [[nodiscard]] const gpu::Buffer& level(int level) const { return packed_[static_cast<std::size_t>(level)]; }

 private:
  gpu::Device& device_;
  Eigen::Isometry3d submap_from_camera_ = Eigen::Isometry3d::Identity();
  ColorMoment moment_;
  std::vector<gpu::Buffer> packed_;
  bool is_set_ = false;
};

/// Coarse-to-fine alignment of a live surface with the map: projective point-to-plane ICP against the model's surface,
/// and brightness against a keyframe. Each term is weighted by the scale of its own residuals. Directions unobserved by
/// geometry are determined by brightness, and remaining ones stay at the guess (Zhang, Kaess & Singh 2016).
class Aligner {
 public:
  /// `is_rolling`: surfaces may have a ShutterCorrection.
  Aligner(gpu::Device& device, const TrackOptions& options, const SensorModel& sensor = {}, bool is_rolling = false);
  /// `keyframe` may be null or not set: geometry alone.
  [[nodiscard]] Alignment align(const FramePyramid& live, const SurfacePrediction& model,
                                const Eigen::Isometry3d& guess, const PhotometricKeyframe* keyframe = nullptr,
                                const ColorMoment& moment = {}, AlignmentRange range = AlignmentRange::coarse_to_fine,
                                const ShutterCorrection& correction = {});

 private:
  struct Tiling;
  struct Views;

  [[nodiscard]] Tiling tiling(const Views& views, int level) const;
  [[nodiscard]] int coarsest(AlignmentRange range) const;
  [[nodiscard]] int max_iterations(int level) const;
  [[nodiscard]] shader::AlignState begin(const Views& views, const Eigen::Isometry3d& model_from_live) const;
  void run(const Views& views, shader::AlignState& state, std::vector<double>& clock_offset_costs);
  void iterate(gpu::Batch& batch, const Views& views, int level, bool may_check_degeneracy);
  [[nodiscard]] shader::PhotometricReducePush photometric_push(const Views& views, int level, const Tiling& tiles,
                                                               double clock_offset, std::uint32_t first) const;
  [[nodiscard]] std::vector<std::vector<shader::PhotometricSums>> evaluate_clock_offsets(gpu::Batch& batch,
                                                                                         const Views& views);
  [[nodiscard]] std::vector<double> costs_of(const std::vector<std::vector<shader::PhotometricSums>>& clock_sums,
                                             double sigma);
  void assess(const Views& views, const shader::AlignState& state, Alignment& result) const;

  gpu::Device& device_;
  TrackOptions options_;
  bool is_cpu_;
  std::uint32_t workgroup_, parts_;  // threads per workgroup of the reductions, and sums written per workgroup
  std::array<int, shader::kMaxLevels> expected_iterations_{};  // by level, to record at once
  gpu::Buffer state_, geometry_sums_, crossed_sums_, photometric_sums_, clock_sums_;
  gpu::Kernel<shader::IcpReducePush> icp_;
  gpu::Kernel<shader::PhotometricReducePush> photometric_;
  gpu::Kernel<shader::PoseStepPush> step_;
};

}  // namespace cairn
