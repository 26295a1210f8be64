// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A ROS 2 node by Cyclone DDS: publishes and receives messages as they are, in ROS 2's names, as rmw_cyclonedds does.
// Shares no code with the library.
#pragma once
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace cairn::ros {

class Ros2Peer {
 public:
  struct Qos {
    bool reliable = true, transient_local = false;
  };
  explicit Ros2Peer(std::uint32_t domain);
  ~Ros2Peer();
  Ros2Peer(const Ros2Peer&) = delete;
  Ros2Peer& operator=(const Ros2Peer&) = delete;

  /// Announces a topic; `type` as in ROS 1: sensor_msgs/Image.
  void announce(const std::string& topic, const std::string& type, const Qos& qos);
  [[nodiscard]] bool is_announced(const std::string& topic) const { return writers_.contains(topic); }
  /// Publishes bytes, with the header of CDR. Announces a new topic, reliable.
  void publish(const std::string& topic, const std::string& type, const std::string& bytes);
  /// Number of readers of an announced topic.
  [[nodiscard]] int readers(const std::string& topic) const;
  void withdraw(const std::string& topic);

  void subscribe(const std::string& topic, const std::string& type, const Qos& qos);
  /// Messages received since the last call.
  [[nodiscard]] std::vector<std::string> received(const std::string& topic);

 private:
  std::int32_t topic_of(const std::string& topic, const std::string& type);
  std::int32_t participant_;
  std::map<std::string, std::int32_t> writers_, readers_;
};

/// Sizes and offsets of Cyclone DDS's structs, in the order of dds_api.hpp.
[[nodiscard]] std::vector<std::size_t> dds_struct_layout();
/// Configuration with the loopback interface only: value of CYCLONEDDS_URI.
inline constexpr const char* kLoopback =
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name=\"lo\"/></Interfaces><AllowMulticast>false"
    "</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer "
    "Address=\"127.0.0.1\"/>"
    "</Peers></Discovery></Domain></CycloneDDS>";

}  // namespace cairn::ros
