// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A recording of a room as running ROS 2 topics.
#pragma once
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <stop_token>
#include <string>
#include <thread>

#include "support/ros2_peer.hpp"
#include "support/ros_files.hpp"
#include "support/scenes.hpp"

namespace cairn::ros {

inline constexpr const char *kDepthTopic = "/camera/depth/image_raw", *kColorTopic = "/camera/color/image_raw";

/// Depth and registered color of the room, their cameras and a transform; 30 Hz.
inline Messages room_messages(Wire wire, const Camera& camera, int frames) {
  const Scene scene = synthetic_scene("room");
  Messages all;
  constexpr std::int64_t kBegin = 1'700'000'000'000'000'000, kStep = 33'333'333;
  Transform pose{"base", "optical", Eigen::Isometry3d::Identity()};
  all.push_back({"/tf_static", "tf2_msgs/TFMessage", kBegin, tf(wire, {pose})});
  for (int i = 0; i < frames; ++i) {
    const Frame frame = scene_frame(scene, camera, i);
    const std::int64_t time = kBegin + i * kStep;
    std::string depth, color;
    for (const float z : frame.depth) {
      const auto mm = static_cast<std::uint16_t>(std::lround(1000 * z));
      depth.append(reinterpret_cast<const char*>(&mm), 2);
    }
    for (const std::uint32_t& pixel : frame.color) color.append(reinterpret_cast<const char*>(&pixel), 3);
    const auto add = [&](const char* topic, const char* encoding, const std::string& data, int size) {
      const std::string folder(topic, std::string(topic).rfind('/'));
      all.push_back({folder + "/camera_info", "sensor_msgs/CameraInfo", time,
                     camera_info(wire, "optical", camera, "plumb_bob", {})});
      all.push_back({topic, "sensor_msgs/Image", time,
                     image(wire, {time, "optical", camera.width, camera.height, encoding, data, size})});
    };
    add(kColorTopic, "rgb8", color, 3);
    add(kDepthTopic, "16UC1", depth, 2);
  }
  return all;
}

/// Domain of this process.
inline std::uint32_t test_domain() {
  setenv("CYCLONEDDS_URI", kLoopback, 1);
  return 1 + static_cast<std::uint32_t>(getpid()) % 98;
}

/// Publishes messages, from the moment when the depth topic has a reader; transforms are latched.
class Player {
 public:
  Player(Messages messages, int rate, Ros2Peer::Qos images = {})
      : thread_([messages = std::move(messages), rate, images](const std::stop_token& stop) {
          using namespace std::chrono_literals;
          Ros2Peer peer(test_domain());
          for (const Recorded& m : messages)
            if (m.topic == "/tf_static")
              peer.announce(m.topic, m.type, {.reliable = true, .transient_local = true}),
                  peer.publish(m.topic, m.type, m.bytes);
          for (const Recorded& m : messages)
            if (!peer.is_announced(m.topic)) peer.announce(m.topic, m.type, images);
          while (!stop.stop_requested() && peer.readers(kDepthTopic) == 0) std::this_thread::sleep_for(5ms);
          std::this_thread::sleep_for(200ms);  // readers of the other topics
          for (const Recorded& m : messages) {
            if (stop.stop_requested()) return;
            if (m.topic == "/tf_static") continue;
            peer.publish(m.topic, m.type, m.bytes);
            if (m.topic == kDepthTopic) std::this_thread::sleep_for(1000ms / rate);
          }
          while (!stop.stop_requested()) std::this_thread::sleep_for(5ms);
        }) {}

 private:
  std::jthread thread_;
};

}  // namespace cairn::ros
