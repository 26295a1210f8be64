// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Synthetic recordings of scenes with exact surface and poses.
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "cairn/mapping/trajectory.hpp"
#include "cairn/synthetic/scene.hpp"

namespace cairn {

/// Pose world_from_camera as a function of time, seconds.
using PoseAt = std::function<Eigen::Isometry3d(double)>;

/// Camera path through a scene.
class SyntheticPath {
 public:
  /// `recorded`: world_from_camera in a world with z up, as in TUM recordings; empty: the scene's own hand-held path.
  /// The first `seconds` of the trajectory are centered in the scene, with their longer side along x.
  SyntheticPath(Scene scene, Trajectory recorded, double seconds);
  /// Pose world_from_camera; nullopt beyond the path's end or in a gap of more than 2.5 s. Shorter gaps are
  /// interpolated at constant velocity.
  [[nodiscard]] std::optional<Eigen::Isometry3d> pose(double seconds) const;
  /// Simulated accelerometer reading in the camera: see Frame::acceleration.
  [[nodiscard]] Eigen::Vector3d acceleration(double seconds) const;
  /// Simulated specific force at a time, without averaging: see Acceleration::value.
  [[nodiscard]] Eigen::Vector3d specific_force(double seconds) const;
  /// Simulated gyroscope reading in the camera: rad/s, in the camera's frame.
  [[nodiscard]] Eigen::Vector3d angular_rate(double seconds) const;

 private:
  /// From second differences with a step in seconds.
  [[nodiscard]] Eigen::Vector3d acceleration(double seconds, double step) const;

  Scene scene_;
  Trajectory recorded_;  ///< in the scene's world frame
};

/// Rendered images of a scene. Row-major, of the camera's size.
struct SceneImages {
  std::vector<float> depth;              ///< meters along z; 0: no surface within 100 m
  std::vector<float> cosine;             ///< cosine between the ray and the surface normal
  std::vector<std::uint32_t> color;      ///< bytes R, G, B, 255
  std::vector<std::uint8_t> confidence;  ///< see Frame; only for phone_lidar noise
};

/// Camera that renders a scene on its own device.
class SceneCamera {
 public:
  /// `device`: index of list_devices; -1 chooses. Throws std::runtime_error for an unusable device.
  SceneCamera(const Scene& scene, const Camera& camera, int device = -1);
  ~SceneCamera();
  SceneCamera(const SceneCamera&) = delete;
  SceneCamera& operator=(const SceneCamera&) = delete;
  /// Renders exact images from a pose at a time (seconds), with moving solids at their positions at this time.
  [[nodiscard]] SceneImages render(const Eigen::Isometry3d& world_from_camera, double seconds = 0);
  /// Same, with a rolling shutter: each row is rendered from the camera pose at its time (Camera::row_delay).
  [[nodiscard]] SceneImages render(const PoseAt& world_from_camera, double seconds);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Simulates sensor noise in depth, and grain in color: `kinect` (Khoshelham & Elberink 2012; Handa et al. 2014, sec.
/// IV: pixels shifted by lateral noise, noisy disparity quantized to 1/8 pixel, no measurement at grazing angles or
/// outside 0.4 to 5 m), `tof` (Azure Kinect), `stereo` (RealSense D4xx), `lidar` (a phone's, with confidence), `none`.
/// `images` belong to the depth camera; `color`: image for the grain, if from a separate camera. Deterministic in seed
/// and frame. Throws std::runtime_error for another kind.
void add_noise(SceneImages& images, const Camera& camera, std::string_view kind, std::uint64_t seed, int frame,
               std::vector<std::uint32_t>* color = nullptr);

}  // namespace cairn
