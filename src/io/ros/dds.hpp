// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Topics of ROS 2 over DDS, without ROS 2. Eclipse Cyclone DDS is loaded with the first participant; dds.cpp has all of
// its calls.
#pragma once
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

namespace cairn {

/// A writer of a topic on the network, in ROS 2's names: "/camera/depth/image_raw", "sensor_msgs/Image".
struct DdsPublication {
  std::string topic, type;
  bool reliable = false, transient_local = false;
};

/// A received message, in CDR with its four-byte header, in the computer's byte order.
struct DdsMessage {
  std::int64_t sent = 0;  // ns, clock of the publisher's computer
  std::vector<std::uint8_t> bytes;
};

struct DdsReaderOptions {
  bool reliable = false, transient_local = false;
  int depth = 10;  // messages kept until they are taken
};

struct DdsWriterOptions {
  int depth = 10;  // messages kept for slow readers
};

/// A list in memory, as in C (dds_sequence).
struct DdsList {
  std::uint32_t capacity = 0, size = 0;
  const void* values = nullptr;
  bool is_owned = false;  // by the library
};

/// Member of a DDS domain.
class DdsParticipant {
 public:
  using Entity = std::int32_t;

  /// Throws std::runtime_error with the cause and the remedy.
  explicit DdsParticipant(std::uint32_t domain);
  ~DdsParticipant();
  DdsParticipant(const DdsParticipant&) = delete;
  DdsParticipant& operator=(const DdsParticipant&) = delete;

  /// Publications of ROS 2 topics known so far.
  [[nodiscard]] std::vector<DdsPublication> publications() const;
  /// Subscribes to a topic of a type of ros2_types.hpp. Throws std::runtime_error with the cause.
  [[nodiscard]] Entity add_reader(const std::string& topic, const std::string& type, const DdsReaderOptions& options);
  void remove_reader(Entity reader);
  /// Announces a topic of a type of ros2_types.hpp, reliable and volatile. Throws std::runtime_error with the cause.
  [[nodiscard]] Entity add_writer(const std::string& topic, const std::string& type, const DdsWriterOptions& options);
  /// Publishes a message with the layout in memory of its type, see ros2_layout(). Throws std::runtime_error with the
  /// cause.
  void write(Entity writer, const void* message) const;
  /// Removes and returns the reader's messages, in order of arrival. Messages that do not fit the type are dropped by
  /// the library, with a warning.
  [[nodiscard]] std::vector<DdsMessage> take(Entity reader) const;
  /// Waits until a reader has a message; returns false after the timeout.
  bool wait(std::chrono::milliseconds timeout) const;

 private:
  void await(Entity reader) const;
  Entity participant_ = 0, waitset_ = 0, publications_ = 0;
};

}  // namespace cairn
