// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <utility>

#include "cairn/mapping/camera.hpp"
#include "cairn/mapping/depth_correction.hpp"
#include "cairn/mapping/sensor_model.hpp"

namespace cairn {

/// Color camera separate from the depth camera.
struct ColorCamera {
  Camera camera;
  Eigen::Isometry3d color_from_depth = Eigen::Isometry3d::Identity();  ///< from the depth camera's frame to its own

  friend bool operator==(const ColorCamera& a, const ColorCamera& b) {
    return a.camera == b.camera && a.color_from_depth.matrix() == b.color_from_depth.matrix();
  }
};

/// Cameras of a sensor. All poses are poses of the depth camera.
struct Rig {
  Rig() = default;
  /// Sensor with color registered to depth, or without color.
  Rig(const Camera& registered, const SensorModel& model = {}) : depth(registered), sensor(model) {}
  Rig(const Camera& depth_camera, std::optional<ColorCamera> color_camera)
      : depth(depth_camera), color(std::move(color_camera)) {}

  Camera depth;
  std::optional<ColorCamera> color;  ///< empty: color is registered to depth, with the same size and view

  SensorModel sensor;                ///< noise model of the depth camera
  DepthCorrection depth_correction;  ///< correction of depth images; empty: none
  /// Rotation from the inertial sensor to the depth camera's frame; empty: estimated from the camera motion.
  std::optional<Eigen::Quaterniond> camera_from_imu;

  friend bool operator==(const Rig& a, const Rig& b) {
    return a.depth == b.depth && a.color == b.color && a.sensor == b.sensor &&
           a.depth_correction == b.depth_correction && a.camera_from_imu.has_value() == b.camera_from_imu.has_value() &&
           (!a.camera_from_imu || a.camera_from_imu->coeffs() == b.camera_from_imu->coeffs());
  }
  /// True if the rigs are equal except for the depth correction, because a calibration may be added later.
  [[nodiscard]] bool has_same_cameras(Rig other) const {
    other.depth_correction = depth_correction;
    return *this == other;
  }
  /// Camera model (size and view) of the color images.
  [[nodiscard]] const Camera& color_view() const { return color ? color->camera : depth; }
  [[nodiscard]] Eigen::Isometry3d depth_from_color() const {
    return color ? color->color_from_depth.inverse() : Eigen::Isometry3d::Identity();
  }
};

/// Throws std::runtime_error as check(Camera) does, for cameras more than 10 m from each other, and for an invalid
/// rotation.
void check(const Rig& rig);

/// Reads a camera.yaml, see docs/inputs.md. Throws std::runtime_error with file and line, or file and key.
[[nodiscard]] Rig read_rig(const std::filesystem::path& camera_file);
/// Writes a camera.yaml atomically, without the depth unit, a property of the recording.
void write_rig(const std::filesystem::path& camera_file, const Rig& rig);

}  // namespace cairn
