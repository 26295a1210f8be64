// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cairn/rig.hpp"

namespace cairn {

/// What a gyroscope measures.
struct AngularRate {
  double timestamp = 0;                            ///< seconds, in the frames' clock
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();  ///< rad/s, in the inertial sensor's own frame (Rig::camera_from_imu)
};

/// One moment of the sensor. Images are row-major and of the sizes that the source's rig tells.
struct Frame {
  int index = 0;                         ///< position in the sequence, counted from 0 over all its depth images
  double timestamp = 0.0;                ///< seconds; increases from frame to frame
  std::vector<float> depth;              ///< metres along z; 0: no measurement; never NaN or negative
  std::vector<std::uint8_t> confidence;  ///< by depth pixel, 0 to 255 (sure); empty: the sensor tells none
  double colour_delay = 0.0;             ///< seconds from the depth image's stamp to the colour image's
  std::vector<std::uint32_t> colour;     ///< bytes R, G, B, 255 in memory order (sRGB); empty: no colour for this frame
  std::optional<Eigen::Isometry3d> world_from_camera;  ///< pose that came with the frame (--poses, synthetic scenes)
  /// Mean around this time of what the camera's accelerometer measures, m/s^2, in the camera's frame: at rest 9.81
  /// upwards.
  std::optional<Eigen::Vector3d> acceleration;
  std::vector<AngularRate> gyro;  ///< since the frame before, up to this one's time or the end of its readout
  /// Where somebody else takes the camera to be (a phone's odometry, wheels): world_from_camera of a world of its own.
  std::optional<Eigen::Isometry3d> guess;
  /// Only for judging the map afterwards: a Mapper finds its pose, and nothing that it shows gets into the map.
  bool held_out = false;
  std::optional<std::string> problem;  ///< why the frame could not be read, in one line: its images are then empty
};

/// A stream of frames, read in order.
class Source {
 public:
  virtual ~Source() = default;
  [[nodiscard]] virtual const Rig& rig() const = 0;
  /// What gives the frames, in a few words: "TUM RGB-D folder", "ROS 1 bag"; empty where it does not say.
  [[nodiscard]] virtual std::string layout() const { return {}; }
  /// Frames still to come, or nothing when the stream cannot tell.
  [[nodiscard]] virtual std::optional<int> size() const = 0;
  /// The next frame, or nothing at the end of the stream. A frame that cannot be read has its `problem` set.
  [[nodiscard]] virtual std::optional<Frame> next() = 0;
  /// When the next frame was taken, seconds; nothing where that is only known once it is read.
  [[nodiscard]] virtual std::optional<double> next_timestamp() const { return std::nullopt; }
  /// Passes over the frame that next_timestamp() tells of, without reading it.
  virtual void skip() {}
  /// Why the stream ended before its time (unplugged, cut off), in one line, if it did.
  [[nodiscard]] virtual std::optional<std::string> ended_early() const { return std::nullopt; }
  /// Frames that were left out so far since the reader was slower than the stream.
  [[nodiscard]] virtual int dropped() const { return 0; }
};

}  // namespace cairn
