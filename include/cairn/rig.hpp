// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <utility>

#include "cairn/camera.hpp"
#include "cairn/depth_correction.hpp"
#include "cairn/sensor_model.hpp"

namespace cairn {

/// A colour camera that looks from beside the depth camera.
struct ColourCamera {
  Camera camera;
  Eigen::Isometry3d colour_from_depth = Eigen::Isometry3d::Identity();  ///< from the depth camera's frame to its own

  friend bool operator==(const ColourCamera& a, const ColourCamera& b) {
    return a.camera == b.camera && a.colour_from_depth.matrix() == b.colour_from_depth.matrix();
  }
};

/// The cameras of a sensor. Poses are the depth camera's everywhere.
struct Rig {
  Rig() = default;
  /// A sensor that gives colour on depth, or none.
  Rig(const Camera& registered, const SensorModel& model = {}) : depth(registered), sensor(model) {}
  Rig(const Camera& depth_camera, std::optional<ColourCamera> colour_camera)
      : depth(depth_camera), colour(std::move(colour_camera)) {}

  Camera depth;
  std::optional<ColourCamera> colour;  ///< none: colour is registered to depth, it has that camera's size and view

  SensorModel sensor;                ///< of the depth camera
  DepthCorrection depth_correction;  ///< of its depth images; empty: none
  /// Turns what an inertial sensor measures into the depth camera's frame; none: found from how the camera moves.
  std::optional<Eigen::Quaterniond> camera_from_imu;

  friend bool operator==(const Rig& a, const Rig& b) {
    return a.depth == b.depth && a.colour == b.colour && a.sensor == b.sensor &&
           a.depth_correction == b.depth_correction && a.camera_from_imu.has_value() == b.camera_from_imu.has_value() &&
           (!a.camera_from_imu || a.camera_from_imu->coeffs() == b.camera_from_imu->coeffs());
  }
  /// Whether it is the same but for what its depth is corrected by: a calibration may come later.
  [[nodiscard]] bool has_same_cameras(Rig other) const {
    other.depth_correction = depth_correction;
    return *this == other;
  }
  /// The camera whose size and view colour images have.
  [[nodiscard]] const Camera& colour_view() const { return colour ? colour->camera : depth; }
  [[nodiscard]] Eigen::Isometry3d depth_from_colour() const {
    return colour ? colour->colour_from_depth.inverse() : Eigen::Isometry3d::Identity();
  }
};

/// Throws std::runtime_error as check(Camera) does, and for cameras more than 10 m apart or what is no rotation.
void check(const Rig& rig);

/// The cameras of a camera.yaml, see docs/formats.md. Throws std::runtime_error with file and line, or file and key.
[[nodiscard]] Rig read_rig(const std::filesystem::path& camera_file);
/// Writes such a file, whole or not at all, without a unit of depth, which is the recording's.
void write_rig(const std::filesystem::path& camera_file, const Rig& rig);

}  // namespace cairn
