// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <memory>
#include <string>

#include "cairn/mapping/mapper.hpp"

namespace cairn {

/// Publishes a growing map as ROS 2 topics over DDS, without ROS 2, in the frame `map` (z up): `/cairn/pose`
/// (geometry_msgs/PoseStamped) and `/tf` from `map` to `cairn_camera` (optical axes) at each tracked frame, and
/// `/cairn/points` (sensor_msgs/PointCloud2, vertices of the surface) every two seconds. Use from the mapper's thread.
class Ros2Publisher {
 public:
  enum class Stamps {
    frames,  ///< Frame::timestamp
    now      ///< the computer's clock, for sources with a clock of their own
  };
  /// `domain`: `ros2:` (ROS_DOMAIN_ID, else 0) or `ros2:DOMAIN`. Throws std::runtime_error for another name, and
  /// without a usable Cyclone DDS.
  Ros2Publisher(const std::string& domain, Stamps stamps);
  ~Ros2Publisher();
  Ros2Publisher(const Ros2Publisher&) = delete;
  Ros2Publisher& operator=(const Ros2Publisher&) = delete;

  /// Starts a new map, which must live until the next call or the end of this object.
  void begin(Mapper& mapper);
  /// Publishes a frame's pose. Call after each frame. A failure is a warning, and ends the publication.
  void add(const FrameReport& report);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn
