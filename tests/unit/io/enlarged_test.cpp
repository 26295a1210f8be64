// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/datasets/enlarged.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "io/recording.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// Frame i of the room in millimeters, with sensor noise of about a millimeter.
cv::Mat depth_of(const Camera& camera, int i, double noise = 1) {
  static std::map<std::pair<int, int>, Frame> rendered;  // by size and frame
  const auto [it, is_new] = rendered.try_emplace({camera.width * 1000 + camera.height, i});
  if (is_new) it->second = scene_frame(synthetic_scene("room"), camera, 5 * i);
  const Frame& frame = it->second;
  cv::Mat image(camera.height, camera.width, CV_16U);
  cv::RNG random(static_cast<std::uint64_t>(i + 1));
  for (std::size_t k = 0; k < frame.depth.size(); ++k) {
    const double z = 1000 * static_cast<double>(frame.depth[k]) + noise * random.gaussian(1);
    image.ptr<std::uint16_t>()[k] = frame.depth[k] > 0 ? static_cast<std::uint16_t>(std::lround(z)) : 0;
  }
  return image;
}
Camera camera_of(int width, int height) {
  return scaled_to(Camera{640, 480, 525, 520, 319.5, 239.5, {}}, {width, height});
}
cv::Mat enlarged(const cv::Mat& image, const cv::Size& size, int how = cv::INTER_NEAREST) {
  cv::Mat large;
  cv::resize(image, large, size, 0, 0, how);
  return large;
}

TEST(DepthChanges, FindBlocksOfIntegerAndOtherFactors) {
  struct Case {
    cv::Size from, to;
  };
  for (const Case& c : {Case{{80, 60}, {160, 120}},
                        {{80, 60}, {240, 180}},
                        {{80, 60}, {320, 240}},
                        {{96, 72}, {240, 180}},
                        {{96, 72}, {160, 120}},
                        {{96, 72}, {144, 108}}}) {
    for (const int how : {int{cv::INTER_NEAREST}, int{cv::INTER_NEAREST_EXACT}}) {
      SCOPED_TRACE(fmt::format("{}x{} to {}x{}, {}", c.from.width, c.from.height, c.to.width, c.to.height, how));
      DepthChanges changes;
      for (int i = 0; i < 4; ++i)
        changes.add(enlarged(depth_of(camera_of(c.from.width, c.from.height), i), c.to, how), 0);
      const auto blocks = changes.blocks();
      EXPECT_EQ(blocks.columns.size(), static_cast<std::size_t>(c.from.width));
      EXPECT_EQ(blocks.rows.size(), static_cast<std::size_t>(c.from.height));
    }
  }
}

TEST(DepthChanges, FindNoneInSensorDepth) {
  for (const double noise : {0.0, 1.0, 20.0})
    for (const int frames : {1, 4}) {
      DepthChanges changes;
      for (int i = 0; i < frames; ++i) changes.add(depth_of(camera_of(160, 120), i, noise), 0);
      EXPECT_TRUE(changes.blocks().columns.empty()) << noise << ' ' << frames;
    }
  DepthChanges linear, flat, one_way;
  linear.add(enlarged(depth_of(camera_of(80, 60), 0), {160, 120}, cv::INTER_LINEAR), 0);
  EXPECT_TRUE(linear.blocks().columns.empty());
  flat.add(cv::Mat(120, 160, CV_16U, cv::Scalar(1000)), 0);
  EXPECT_TRUE(flat.blocks().columns.empty());
  one_way.add(enlarged(depth_of(camera_of(80, 120), 0), {160, 120}), 0);
  EXPECT_TRUE(one_way.blocks().columns.empty());
}

struct Written : TemporaryFolder {
  Written(const cv::Size& from, const cv::Size& to, bool with_color = true) {
    for (const char* name : {"depth", "rgb", "confidence"}) fs::create_directories(*this / name);
    std::string depth, rgb;
    for (int i = 0; i < 4; ++i) {
      small.push_back(depth_of(camera_of(from.width, from.height), i));
      cv::imwrite((*this / fmt::format("depth/{}.png", i)).string(), enlarged(small.back(), to));
      cv::imwrite((*this / fmt::format("confidence/{}.png", i)).string(), cv::Mat(to, CV_8U, cv::Scalar(200)));
      cv::imwrite((*this / fmt::format("rgb/{}.png", i)).string(), cv::Mat(to, CV_8UC3, cv::Scalar(i, i, i)));
      depth += fmt::format("0.{0} depth/{0}.png\n", i);
      rgb += fmt::format("0.{0} rgb/{0}.png\n", i);
    }
    write_text(*this / "depth.txt", depth);
    if (with_color) write_text(*this / "rgb.txt", rgb);
    const Camera c = camera_of(to.width, to.height);
    write_text(*this / "camera.yaml",
               fmt::format("{{width: {}, height: {}, fx: {}, fy: {}, cx: {}, cy: {}, depth_scale: "
                           "1000}}",
                           c.width, c.height, c.fx, c.fy, c.cx, c.cy));
  }
  std::vector<cv::Mat> small;
};

TEST(EnlargedDepth, IsUsedAtTrueResolution) {
  for (const cv::Size& from : {cv::Size(80, 60), cv::Size(96, 72)}) {
    const cv::Size to = from.width == 80 ? cv::Size(160, 120) : cv::Size(240, 180);
    const Written folder(from, to);
    testing::internal::CaptureStdout();
    const auto source = open_source(folder.path().string());
    const std::string output = testing::internal::GetCapturedStdout();
    EXPECT_NE(output.find(fmt::format("depth was enlarged from {}x{} to {}x{} by nearest neighbor", from.width,
                                      from.height, to.width, to.height)),
              std::string::npos)
        << output;
    const Camera large = camera_of(to.width, to.height), small = camera_of(from.width, from.height);
    const Rig rig = source->rig();
    EXPECT_EQ(rig.depth.width, small.width);
    EXPECT_NEAR(rig.depth.fx, small.fx, 1e-9);
    EXPECT_NEAR(rig.depth.cx, small.cx, 1e-9);
    ASSERT_TRUE(rig.color);
    EXPECT_EQ(rig.color->camera, large);
    for (const cv::Mat& truth : folder.small) {
      const auto frame = source->next();
      ASSERT_TRUE(frame && !frame->problem);
      ASSERT_EQ(frame->depth.size(), truth.total());
      ASSERT_EQ(frame->confidence.size(), truth.total());
      EXPECT_EQ(frame->color.size(), static_cast<std::size_t>(to.area()));
      for (std::size_t k = 0; k < truth.total(); ++k)
        ASSERT_FLOAT_EQ(frame->depth[k], static_cast<float>(truth.ptr<std::uint16_t>()[k]) * 1e-3f) << k;
    }
  }
}

TEST(EnlargedDepth, WithoutColorHasNoColorCamera) {
  const auto rig = open_source(Written({80, 60}, {160, 120}, false).path().string())->rig();
  EXPECT_EQ(rig.depth.width, 80);
  EXPECT_FALSE(rig.color);
}

TEST(EnlargedDepth, ReportsFrameOfAnotherSize) {
  const Written folder({80, 60}, {160, 120});
  cv::imwrite((folder / "depth/2.png").string(), folder.small[2]);
  const auto source = open_source(folder.path().string());
  (void)source->next(), (void)source->next();
  const auto frame = source->next();
  ASSERT_TRUE(frame->problem);
  EXPECT_NE(frame->problem->find("is 80x60, the camera 160x120"), std::string::npos) << *frame->problem;
  EXPECT_FALSE(source->next()->problem);
}

TEST(EnlargedDepth, IsNotDetectedInRealRecordings) {
  for (const char* name : {"tum_fr1_rpy_400", "7scenes_redkitchen_600", "icl_office_kt0_101", "realsense_d435_300",
                           "realsense_d435_turn", "iphone_lidar_580"}) {
    if (!fs::exists(data_folder() / name)) GTEST_SKIP() << "recording " << name << " is not here";
    SCOPED_TRACE(name);
    const auto source = open_source((data_folder() / name).string(), {.find_color_camera = false});
    EXPECT_EQ(source->rig().depth.width, std::string_view(name).starts_with("iphone") ? 256 : 640);
  }
}

}  // namespace
}  // namespace cairn
