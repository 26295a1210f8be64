// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Running ROS 2 topics by Cyclone DDS: tests/support/ros2_peer.hpp publishes them.
#include <gtest/gtest.h>

#include <map>
#include <opencv2/imgcodecs.hpp>

#include "cairn/io/source.hpp"
#include "io/ros/dds.hpp"
#include "io/ros/dds_api.hpp"
#include "io/ros/ros2_types.hpp"
#include "io/ros/ros_recording.hpp"
#include "support/files.hpp"
#include "support/ros2_player.hpp"

namespace cairn {
namespace {

using namespace std::chrono_literals;
using ros::kColorTopic;
using ros::kDepthTopic;
using ros::Wire;
constexpr int kFrames = 6, kRate = 20;  // Hz: all within the time of the survey
const Camera kCamera{64, 48, 52.5, 52.25, 31.5, 23.75, {}};

class Ros2Topics : public testing::Test {
 protected:
  static std::string input() { return "ros2:" + std::to_string(ros::test_domain()); }
  static std::string text(std::span<const std::uint8_t> bytes) { return {bytes.begin(), bytes.end()}; }
  static ros::Recorded depth_message(int i) {
    static const ros::Messages room = ros::room_messages(Wire::little, kCamera, kFrames);
    return room[static_cast<std::size_t>(1 + 4 * i + 3)];
  }
  /// Next frame without a problem.
  static Frame good_frame(Source& source) {
    for (;;)
      if (auto frame = source.next().value(); !frame.problem) return frame;
  }
  TemporaryFolder folder;
};

TEST_F(Ros2Topics, HaveTheStructsOfTheLibrary) {
  using D = ::dds_topic_descriptor;
  using E = ::dds_builtintopic_endpoint;
  using I = ::dds_sample_info;
  using L = ::dds_log_data;
  const std::vector<std::size_t> ours{sizeof(D),
                                      offsetof(D, m_flagset),
                                      offsetof(D, m_typename),
                                      offsetof(D, m_ops),
                                      offsetof(D, type_information),
                                      offsetof(D, restrict_data_representation),  //
                                      sizeof(I),
                                      offsetof(I, instance_state),
                                      offsetof(I, valid_data),
                                      offsetof(I, source_timestamp),  //
                                      sizeof(E),
                                      offsetof(E, topic_name),
                                      offsetof(E, type_name),
                                      offsetof(E, qos),  //
                                      sizeof(L),
                                      offsetof(L, message),
                                      offsetof(L, size),
                                      offsetof(L, hdrsize)};
  EXPECT_EQ(ours, ros::dds_struct_layout());
}

TEST_F(Ros2Topics, TypeNamesAreConvertedBothWays) {
  EXPECT_EQ(to_dds_type("sensor_msgs/Image"), "sensor_msgs::msg::dds_::Image_");
  EXPECT_EQ(from_dds_type("sensor_msgs::msg::dds_::Image_"), "sensor_msgs/Image");
  EXPECT_EQ(from_dds_type("sensor_msgs::srv::dds_::SetCameraInfo_Request_"), "");
  EXPECT_EQ(from_dds_type("ParticipantMessageData"), "");
}

TEST_F(Ros2Topics, MessagesHaveTheBytesOfTheRecording) {
  const ros::Messages expected = ros::room_messages(Wire::little, kCamera, kFrames);
  for (const Wire wire : {Wire::little, Wire::big}) {
    const ros::Player player(ros::room_messages(wire, kCamera, kFrames), kRate);
    const auto graph = open_ros2(input());
    std::map<std::string, std::vector<std::string>> received, sent;
    while (const auto message = graph->next()) {
      const RosTopic& topic = graph->topics()[message->topic];
      EXPECT_EQ(topic.encoding, RosEncoding::cdr);
      received[topic.name + " " + topic.type].push_back(text(message->bytes));
    }
    for (const auto& m : expected) {
      std::string padded = m.bytes;
      padded.resize((m.bytes.size() + 3) / 4 * 4);
      sent[m.topic + " " + m.type].push_back(padded);
    }
    EXPECT_EQ(received, sent) << (wire == Wire::big ? "big endian" : "little endian");
  }
}

TEST_F(Ros2Topics, FramesEqualTheFramesOfTheBag) {
  const ros::Messages messages = ros::room_messages(Wire::little, kCamera, kFrames);
  write_text(folder / "room.mcap", ros::mcap(messages, "cdr"));
  const auto bag = open_source(folder / "room.mcap");
  const ros::Player player(messages, kRate);
  const auto running = open_source(input());
  EXPECT_EQ(running->rig(), bag->rig());
  EXPECT_FALSE(running->size());
  for (int i = 0; i < kFrames; ++i) {
    const auto expected = bag->next(), frame = running->next();
    ASSERT_TRUE(expected && frame);
    ASSERT_FALSE(frame->problem) << *frame->problem;
    EXPECT_EQ(frame->index, i);
    EXPECT_EQ(frame->timestamp, expected->timestamp);
    EXPECT_EQ(frame->depth, expected->depth);
    EXPECT_EQ(frame->color, expected->color);
    EXPECT_EQ(frame->color_delay, expected->color_delay);
  }
}

TEST_F(Ros2Topics, BestEffortPublishersAreRead) {
  const ros::Player player(ros::room_messages(Wire::little, kCamera, kFrames), kRate, {.reliable = false});
  EXPECT_EQ(good_frame(*open_source(input())).depth.size(), static_cast<std::size_t>(kCamera.width * kCamera.height));
}

TEST_F(Ros2Topics, ContinueAfterTheirPublisherIsBack) {
  std::optional<ros::Player> player;
  player.emplace(ros::room_messages(Wire::little, kCamera, kFrames), kRate);
  const auto source = open_source(input());
  for (int i = 0; i < kFrames; ++i) EXPECT_FALSE(source->next()->problem);
  player.reset();
  for (int i = 0; i < 2; ++i) {
    const auto waiting = source->next();
    ASSERT_TRUE(waiting && waiting->problem);
    EXPECT_EQ(*waiting->problem, input() + ": " + kDepthTopic + " is not published");
  }
  ros::Messages later = ros::room_messages(Wire::little, kCamera, kFrames + 20);
  later.erase(later.begin() + 1, later.begin() + 1 + 4 * kFrames);
  player.emplace(later, kRate, ros::Ros2Peer::Qos{.reliable = false});
  const Frame frame = good_frame(*source);
  EXPECT_GT(frame.timestamp, 1.7e9 + kFrames / 30.0 - 1e-3);
  EXPECT_FALSE(source->ended_early());
}

TEST_F(Ros2Topics, MalformedMessagesAreSkipped) {
  ros::Messages messages = ros::room_messages(Wire::little, kCamera, kFrames);
  messages[4].bytes.resize(40);  // the first depth image ends in its header
  ros::ImageMessage wrong{1'700'000'000'033'333'333, "optical", kCamera.width, kCamera.height, "16UC1", "short", 2};
  messages[8].bytes = image(Wire::little, wrong);  // the second has a tenth of its pixels
  const ros::Player player(messages, kRate);
  const auto source = open_source(input());
  const auto second = source->next();
  ASSERT_TRUE(second && second->problem);
  EXPECT_NE(second->problem->find("/camera/depth/image_raw in message 1: is an image of 64x48 pixels as 16UC1"),
            std::string::npos)
      << *second->problem;
  EXPECT_NEAR(source->next()->timestamp, 1.7e9 + 2 / 30.0, 1e-6);
}

TEST_F(Ros2Topics, CompressedImagesAreReadWithoutRawImagesOrIfNamed) {
  ros::Messages messages = ros::room_messages(Wire::little, kCamera, kFrames);
  ros::Messages compressed;
  std::vector<std::uint8_t> png;
  cv::imencode(".png", cv::Mat(kCamera.height, kCamera.width, CV_8UC3, cv::Scalar(10, 20, 30)), png);
  const std::string name = std::string(kColorTopic) + "/compressed";
  for (const auto& m : messages) {
    compressed.push_back(m);
    if (m.topic == kColorTopic)
      compressed.push_back({name, "sensor_msgs/CompressedImage", m.time,
                            ros::compressed_image(Wire::little, m.time, "optical", "rgb8; png compressed bgr8",
                                                  {png.begin(), png.end()})});
  }
  const auto first_color = [&](const SourceOptions& options) {
    const ros::Player player(compressed, kRate);
    return good_frame(*open_source(input(), options)).color.at(0);
  };
  EXPECT_NE(first_color({}), 0xff0a141eu);
  EXPECT_EQ(first_color({.color_topic = name}), 0xff0a141eu);
  std::erase_if(compressed, [](const auto& m) { return m.topic == kColorTopic; });
  EXPECT_EQ(first_color({}), 0xff0a141eu);
}

TEST_F(Ros2Topics, ErrorsNameCauseAndRemedy) {
  EXPECT_EQ(error_of([] { (void)open_source("ros2:x"); }), "ros2:: the domain 'x' is not a number from 0 to 232");
  EXPECT_EQ(error_of([] { (void)open_source("ros2:233"); }), "ros2:: the domain '233' is not a number from 0 to 232");
  EXPECT_EQ(error_of([] { (void)open_source(input()); }),
            input() + ": no image topic is published in domain " + std::to_string(ros::test_domain()) +
                "; start the camera's node, and check ROS_DOMAIN_ID, the network and CYCLONEDDS_URI");
  ros::Messages depth_only = ros::room_messages(Wire::little, kCamera, kFrames);
  std::erase_if(depth_only, [](const auto& m) { return m.type == "sensor_msgs/CameraInfo"; });
  const ros::Player player(depth_only, kRate);
  EXPECT_NE(error_of([] { (void)open_source(input()); }).find("has no topic of sensor_msgs/CameraInfo"),
            std::string::npos);
}

TEST_F(Ros2Topics, AreNamesOfSensorsAndRecordings) {
  for (const char* name : {"ros2:", "ros2:7"}) {
    EXPECT_TRUE(is_sensor(name));
    EXPECT_TRUE(is_ros_recording(name));
  }
  EXPECT_FALSE(is_sensor("ros2"));
}

}  // namespace
}  // namespace cairn
