// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The program as a subscriber of ROS 2 topics, published by this process over the loopback interface.
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <nlohmann/json.hpp>

#include "cairn/io/source.hpp"
#include "support/files.hpp"
#include "support/ros2_player.hpp"

namespace cairn {
namespace {

using ros::Wire;
constexpr int kFrames = 12, kRate = 8;  // Hz: all within the time of the survey

class Ros2 : public testing::Test {
 protected:
  Ros2() : messages(ros::room_messages(Wire::little, small_camera(), kFrames)) {
    write_text(folder / "room.mcap", ros::mcap(messages, "cdr"));
  }
  [[nodiscard]] std::string out(const std::string& name) const { return (folder / name).string(); }
  static std::string environment() { return "ROS_DOMAIN_ID=" + std::to_string(ros::test_domain()); }
  TemporaryFolder folder;
  ros::Messages messages;
};

TEST_F(Ros2, MapEqualsTheMapOfTheBag) {
  write_text(folder / "options.yaml", "track: {finest_level: 1}\n");  // the default depends on the command
  const auto run = [&](std::vector<std::string> words, const std::string& output, const std::string& before) {
    for (const char* word : {"--no-texture", "--quality", "fast", "--voxel-size", "0.03", "--config"})
      words.push_back(word);
    words.insert(words.end(), {out("options.yaml"), "-o", out(output)});
    return run_cairn(words, before);
  };
  {
    const ros::Player player(messages, kRate);
    const Ran ran = run({"live", "ros2:", "--as-fast-as-possible"}, "live",
                        "timeout --foreground --preserve-status -s INT 12 env " + environment());
    EXPECT_LT(ran.exit_code, 4) << ran.err;  // a frame with a problem for each second of the wait
    EXPECT_NE(ran.err.find("no image of /camera/depth/image_raw for two seconds"), std::string::npos) << ran.err;
  }
  const Ran ran = run({"reconstruct", out("room.mcap")}, "reconstructed", "");
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  const auto report = nlohmann::json::parse(read_bytes(folder / "live" / "report.json"));
  EXPECT_EQ(report["frames"]["fused"], kFrames);
  for (const char* file : {"map.vdb", "trajectory.txt"})
    EXPECT_TRUE(read_bytes(folder / "live" / file) == read_bytes(folder / "reconstructed" / file)) << file;
}

TEST_F(Ros2, RecordingEqualsTheConvertedBag) {
  for (const Wire wire : {Wire::little, Wire::big}) {
    const std::string output = out(wire == Wire::big ? "big" : "little");
    const ros::Player player(ros::room_messages(wire, small_camera(), kFrames), kRate);
    const Ran ran =
        run_cairn({"record", "ros2:", "-o", output, "--color", "png", "--seconds", "0.34", "--json"}, environment());
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_EQ(nlohmann::json::parse(ran.out)["frames"], 11);
    const Ran bag = run_cairn({"convert", out("room.mcap"), "-o", output + "-bag", "--color", "png", "--frames", "11"});
    ASSERT_EQ(bag.exit_code, 0) << bag.err;
    const auto recorded = bytes_below(output), converted = bytes_below(output + "-bag");
    for (const char* file : {"depth.txt", "rgb.txt"}) EXPECT_EQ(recorded.at(file), converted.at(file)) << file;
    for (const auto& [name, bytes] : converted)
      if (name.starts_with("rgb/")) {
        EXPECT_TRUE(recorded.contains(name) && recorded.at(name) == bytes) << name;
      }
    const auto running = open_source(output), packed = open_source(output + "-bag");  // in other depth units
    EXPECT_EQ(running->rig(), packed->rig());
    while (const auto expected = packed->next()) {
      const auto frame = running->next();
      ASSERT_TRUE(frame);
      for (std::size_t p = 0; p < expected->depth.size(); ++p) ASSERT_NEAR(frame->depth[p], expected->depth[p], 1e-6);
    }
  }
}

TEST_F(Ros2, MalformedMessagesAreReportedInOneLine) {
  messages[8].bytes.resize(40);
  const ros::Player player(messages, kRate);
  const Ran ran = run_cairn({"record", "ros2:", "-o", out("a"), "--seconds", "0.2"}, environment());
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NE(ran.err.find("ros2: /camera/depth/image_raw has messages that do not fit their type; they are skipped"),
            std::string::npos)
      << ran.err;
}

TEST_F(Ros2, PosesAndSurfaceOfARunArePublished) {
  ros::Ros2Peer peer(ros::test_domain());
  const ros::Ros2Peer::Qos reliable;
  peer.subscribe("/cairn/pose", "geometry_msgs/PoseStamped", reliable);
  peer.subscribe("/tf", "tf2_msgs/TFMessage", reliable);
  peer.subscribe("/cairn/points", "sensor_msgs/PointCloud2", reliable);
  const Ran ran = run_cairn({"live", out("room.mcap"), "--publish", "ros2:", "--no-texture", "--quality", "fast",
                             "--voxel-size", "0.03", "--up", "camera", "-o", out("map")},
                            environment());
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  const auto poses = peer.received("/cairn/pose"), transforms = peer.received("/tf"),
             points = peer.received("/cairn/points");
  ASSERT_EQ(poses.size(), static_cast<std::size_t>(kFrames));
  ASSERT_EQ(transforms.size(), poses.size());
  ASSERT_GE(points.size(), 1u);
  std::int64_t stamp = messages.front().time;
  Eigen::Matrix3d map_from_world;  // z up
  map_from_world << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  Eigen::Isometry3d first = Eigen::Isometry3d::Identity();
  first.linear() = map_from_world;
  EXPECT_EQ(transforms[0], ros::MessageWriter(Wire::little)
                               .put(std::uint32_t{1})
                               .header(stamp, "map")
                               .text("cairn_camera")
                               .transform(first)
                               .bytes());
  EXPECT_EQ(poses[0], ros::MessageWriter(Wire::little).header(stamp, "map").transform(first).bytes());
  const std::string cloud = points[0];
  ros::MessageWriter fields(Wire::little);
  fields.header(stamp, "map").put(std::uint32_t{1});
  std::uint32_t width = 0;
  std::memcpy(&width, &cloud[fields.bytes().size()], sizeof width);
  EXPECT_GT(width, 1000u);
  fields.put(width).put(std::uint32_t{4});
  for (std::uint32_t i = 0; i < 4; ++i)
    fields.text(std::array{"x", "y", "z", "rgb"}[i]).put(4 * i).put(std::uint8_t{7}).put(std::uint32_t{1});
  fields.put(std::uint8_t{0}).put(std::uint32_t{16}).put(16 * width).put(16 * width);
  EXPECT_TRUE(cloud.substr(4).starts_with(fields.bytes().substr(4))) << "after CDR's header";
  EXPECT_EQ(cloud.size(), (fields.bytes().size() + 16 * width + 1 + 3) / 4 * 4);
}

TEST_F(Ros2, DepthTopicsAreListed) {
  const ros::Player player(messages, 2);
  const Ran ran = run_cairn({"devices", "--sensors"}, environment());
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NE(ran.out.find("--topic /camera/depth/image_raw"), std::string::npos) << ran.out;
  EXPECT_EQ(ran.out.find("--topic /camera/color"), std::string::npos) << ran.out;
}

TEST_F(Ros2, TopicsAreSelectedByName) {
  const ros::Player player(messages, 2);
  expect_last_line(run_cairn({"record", "ros2:", "-o", out("a"), "--topic", "/camera/depth/image"}, environment()), 1,
                   "has no topic /camera/depth/image");
}

TEST_F(Ros2, OldLibrariesAreReportedInOneLine) {
  expect_one_line(run_cairn({"record", "ros2:", "-o", out("a")}, "LD_LIBRARY_PATH='" + old_sensor_folder() + "'"), 1,
                  "ROS 2 topics need Eclipse Cyclone DDS 0.10, and the installed version lacks");
}

}  // namespace
}  // namespace cairn
