// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/messages.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <opencv2/imgcodecs.hpp>

namespace cairn {
namespace {

template <class T>
T at(const std::string& bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, &bytes.at(offset), sizeof value);
  return value;
}

TEST(Messages, QuantizeSurfaceToAFractionOfAVoxel) {
  SurfaceBlock part{.submap = 3, .cell = {-1, 2, 5}, .mesh = {}};
  part.mesh.positions = {{-0.3f, 0.7f, 1.6f}, {-0.1f, 0.9f, 1.6f}, {-0.2f, 0.7f, 1.9f}};
  part.mesh.normals = {{0, 0, -1}, {1, 0, 0}, {0, 1, 0}};
  part.mesh.colors = {{1, 2, 3, 255}, {4, 5, 6, 255}, {7, 8, 9, 255}};
  part.mesh.triangles = {{0, 2, 1}};
  const std::string bytes = part_message(part, 7);
  ASSERT_EQ(bytes.size(), 48u + 3 * 16 + 3 * 2);
  EXPECT_EQ(at<std::uint32_t>(bytes, 0), 1u);
  EXPECT_EQ(at<std::int32_t>(bytes, 4), 7);
  EXPECT_EQ(at<std::int32_t>(bytes, 8), 3);
  EXPECT_EQ(at<std::int32_t>(bytes, 12), -1);
  const float size = at<float>(bytes, 36);
  for (std::size_t v = 0; v < 3; ++v)
    for (std::size_t k = 0; k < 3; ++k) {
      const float decoded = at<float>(bytes, 24 + 4 * k) + at<std::uint16_t>(bytes, 48 + 8 * v + 2 * k) * size / 65535;
      EXPECT_NEAR(decoded, part.mesh.positions[v][static_cast<int>(k)], 1e-5f);
    }
  EXPECT_EQ(at<std::uint8_t>(bytes, 48 + 24 + 5), 5);
  EXPECT_EQ(at<std::int8_t>(bytes, 48 + 36 + 2), -127);
  EXPECT_EQ(at<std::uint16_t>(bytes, 48 + 48 + 2), 2);
}

TEST(Messages, EncodeRemovedParts) {
  const std::string bytes = part_message({.submap = 0, .cell = {0, 0, 0}, .mesh = {}}, 1);
  EXPECT_EQ(at<std::uint32_t>(bytes, 44), 0u);  // indices
}

TEST(Messages, EncodeDepthFromRedToBlueWithBlackHoles) {
  const Camera camera{.width = 320, .height = 240};
  Frame frame{.depth = std::vector<float>(320 * 240, 0.4f), .color = {}};
  for (std::size_t i = 0; i < frame.depth.size(); ++i) {
    if (i % 320 > 100) frame.depth[i] = 4.8f;
    if (i % 320 > 200) frame.depth[i] = 0;
  }
  const std::string bytes = depth_message(frame, camera, 5);
  EXPECT_EQ(at<std::uint32_t>(bytes, 4), 1u);
  const std::vector<char> jpeg(bytes.begin() + 8, bytes.end());
  const cv::Mat image = cv::imdecode(jpeg, cv::IMREAD_COLOR);
  ASSERT_EQ(image.cols, 320);
  const auto near = image.at<cv::Vec3b>(120, 50), far = image.at<cv::Vec3b>(120, 150),
             hole = image.at<cv::Vec3b>(120, 280);
  EXPECT_GT(near[2], near[0] + 80);
  EXPECT_LT(far[2], 80);
  EXPECT_LT(cv::norm(hole), 20);
}

TEST(Messages, KeepALongPathShort) {
  Trajectory trajectory;
  for (int i = 0; i < 50000; ++i) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation().x() = i;
    trajectory.push_back({100 + i / 30.0, pose});
  }
  const std::string bytes = path_message(trajectory, 1);
  EXPECT_LT(bytes.size(), 70000u);
  EXPECT_EQ(at<float>(bytes, 12), 0);
}

}  // namespace
}  // namespace cairn
