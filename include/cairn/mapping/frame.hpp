// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cairn/mapping/rig.hpp"

namespace cairn {

/// Gyroscope sample.
struct AngularRate {
  double timestamp = 0;                            ///< seconds, in the frames' clock
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();  ///< rad/s, in the inertial sensor's own frame (Rig::camera_from_imu)
};

/// Accelerometer sample: specific force at the inertial sensor, in axes of the depth camera; at rest 9.81 m/s^2 upward.
struct Acceleration {
  double timestamp = 0;                             ///< seconds, in the frames' clock
  Eigen::Vector3d value = Eigen::Vector3d::Zero();  ///< m/s^2
};

/// One RGB-D frame. Images are row-major, with the sizes given by the source's rig.
struct Frame {
  int index = 0;                         ///< position in the sequence, counted from 0 over all its depth images
  double timestamp = 0.0;                ///< seconds; increases from frame to frame
  std::vector<float> depth;              ///< meters along z; 0: no measurement; never NaN or negative
  std::vector<std::uint8_t> confidence;  ///< per depth pixel, 0 to 255 (certain); empty: not provided by the sensor
  double color_delay = 0.0;              ///< seconds from the depth timestamp to the color timestamp
  std::vector<std::uint32_t> color;      ///< bytes R, G, B, 255 in memory order (sRGB); empty: no color for this frame
  std::optional<Eigen::Isometry3d> world_from_camera;  ///< given pose (--poses, synthetic scenes)
  /// Mean of the accelerometer around this time, see Acceleration::value.
  std::optional<Eigen::Vector3d> acceleration;
  std::vector<AngularRate> gyro;  ///< samples since the previous frame, up to this frame's time or the end of its
                                  ///< readout
  std::vector<Acceleration> accelerations;  ///< samples of the same time span as `gyro`
  /// Pose by the device's own tracking or another odometry (a phone, wheels): world_from_camera in its own world frame;
  /// see TrackOptions::device_poses.
  std::optional<Eigen::Isometry3d> guess;
  /// Held-out frame for evaluation: a Mapper estimates its pose, but adds its data to the map at most in the end, see
  /// FinishOptions::fuses_held_out.
  bool held_out = false;
  std::optional<std::string> problem;  ///< reason for an unreadable frame, in one line; its images are then empty
};

/// A stream of frames, read in order.
class Source {
 public:
  virtual ~Source() = default;
  [[nodiscard]] virtual const Rig& rig() const = 0;
  /// Kind of input, in a few words: "TUM RGB-D folder", "ROS 1 bag"; empty if unspecified.
  [[nodiscard]] virtual std::string layout() const { return {}; }
  /// Number of remaining frames, or nullopt if unknown.
  [[nodiscard]] virtual std::optional<int> size() const = 0;
  /// The next frame, or nullopt at the end of the stream. An unreadable frame has its `problem` set.
  [[nodiscard]] virtual std::optional<Frame> next() = 0;
  /// Timestamp of the next frame, seconds; nullopt if unknown before the frame is read.
  [[nodiscard]] virtual std::optional<double> next_timestamp() const { return std::nullopt; }
  /// Skips the frame of next_timestamp() without reading it.
  virtual void skip() {}
  /// Reason for a premature end of the stream (unplugged, truncated), in one line, if any.
  [[nodiscard]] virtual std::optional<std::string> ended_early() const { return std::nullopt; }
  /// True if the timestamps are frame numbers at an assumed rate: speeds are then unknown.
  [[nodiscard]] virtual bool has_assumed_rate() const { return false; }
  /// Number of frames dropped so far because the reader was slower than the stream.
  [[nodiscard]] virtual int dropped() const { return 0; }
};

}  // namespace cairn
