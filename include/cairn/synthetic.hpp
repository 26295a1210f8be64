// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Recordings of scenes whose surface and poses are known exactly.
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "cairn/scene.hpp"
#include "cairn/trajectory.hpp"

namespace cairn {

/// world_from_camera at a time, seconds.
using PoseAt = std::function<Eigen::Isometry3d(double)>;

/// How the camera moves through a scene.
class SyntheticPath {
 public:
  /// `recorded`: world_from_camera in a world with z up, as TUM's; empty: the scene's own hand-held-like path. The
  /// first `seconds` of it are put into the middle of the scene, their longer side along x.
  SyntheticPath(Scene scene, Trajectory recorded, double seconds);
  /// world_from_camera; nothing beyond the path's end or in a gap of more than 2.5 s. Shorter ones are passed at
  /// constant velocity.
  [[nodiscard]] std::optional<Eigen::Isometry3d> pose(double seconds) const;
  /// What an accelerometer in the camera measures: see Frame::acceleration.
  [[nodiscard]] Eigen::Vector3d acceleration(double seconds) const;
  /// What a gyroscope in the camera measures: rad/s, in the camera's frame.
  [[nodiscard]] Eigen::Vector3d angular_rate(double seconds) const;

 private:
  Scene scene_;
  Trajectory recorded_;  ///< in the scene
};

/// What a camera sees of a scene. Row-major, of the camera's size.
struct SceneImages {
  std::vector<float> depth;              ///< metres along z; 0: nothing within 100 m
  std::vector<float> cosine;             ///< between the ray and the surface's normal
  std::vector<std::uint32_t> colour;     ///< bytes R, G, B, 255
  std::vector<std::uint8_t> confidence;  ///< see Frame; of phones
};

/// A camera in a scene, rendered on a device of its own.
class SceneCamera {
 public:
  /// `device`: as list_devices numbers them; -1 chooses. Throws std::runtime_error for one that cannot be used.
  SceneCamera(const Scene& scene, const Camera& camera, int device = -1);
  ~SceneCamera();
  SceneCamera(const SceneCamera&) = delete;
  SceneCamera& operator=(const SceneCamera&) = delete;
  /// Exact images from a pose at a time (seconds), at which moving solids stand where they are then.
  [[nodiscard]] SceneImages look(const Eigen::Isometry3d& world_from_camera, double seconds = 0);
  /// Also with a rolling shutter: each row (Camera::row_delay) from where the camera is then.
  [[nodiscard]] SceneImages look(const PoseAt& world_from_camera, double seconds);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// What a depth camera would have measured, and grain in colour: `kinect` (Khoshelham & Elberink 2012; Handa et al.
/// 2014, sec. IV: pixels shifted by lateral noise, disparity with noise and quantised to 1/8 pixel, nothing at grazing
/// angles or out of 0.4 to 5 m), `tof` (Azure Kinect), `stereo` (RealSense D4xx), `lidar` (a phone's, with confidence),
/// `none`. `images` are the depth camera's; `colour`: the image that gets the grain, if that is another camera's.
/// Repeats for the same seed and frame. Throws std::runtime_error for another kind.
void add_noise(SceneImages& images, const Camera& camera, std::string_view kind, std::uint64_t seed, int frame,
               std::vector<std::uint32_t>* colour = nullptr);

}  // namespace cairn
