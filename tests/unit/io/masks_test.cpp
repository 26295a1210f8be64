// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>

#include "cairn/io/mask.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

const Camera kCamera{16, 12, 16, 16, 7.5, 5.5, {}};

/// Frames of depth 2 m at 10 Hz with white registered color.
std::unique_ptr<Source> frames(int count, const Rig& rig = kCamera) {
  std::vector<Frame> all;
  for (int i = 0; i < count; ++i) {
    const Camera& color = rig.color_view();
    all.push_back({.index = i,
                   .timestamp = 100.0 + 0.1 * i,
                   .depth = std::vector<float>(16 * 12, 2.0f),
                   .color_delay = 0.02,
                   .color = std::vector<std::uint32_t>(static_cast<std::size_t>(color.width * color.height), ~0u)});
  }
  return std::make_unique<GivenFrames>(rig, std::move(all));
}

/// Mask of the left half.
void write_mask(const fs::path& file, const cv::Size& size = {16, 12}, int type = CV_8U) {
  fs::create_directories(file.parent_path());
  cv::Mat image(size, type, cv::Scalar(0, 0, 0, 255));
  image.colRange(0, size.width / 2).setTo(cv::Scalar(0, 1, 0, 255));
  if (image.channels() == 1) image.colRange(0, size.width / 2).setTo(1);
  cv::imwrite(file.string(), image);
}

int masked_pixels(const Frame& frame) {
  return static_cast<int>(std::count(frame.depth.begin(), frame.depth.end(), 0.0f));
}

TEST(Masks, RemoveDepthAndTheAlphaOfColor) {
  const TemporaryFolder folder;
  write_mask(folder / "m" / "000001.png");
  const auto source = with_masks(frames(2), folder / "m");
  EXPECT_EQ(masked_pixels(*source->next()), 0);
  const auto frame = source->next();
  for (std::size_t i = 0; i < frame->depth.size(); ++i) {
    const bool is_masked = i % 16 < 8;
    EXPECT_EQ(frame->depth[i], is_masked ? 0.0f : 2.0f) << i;
    EXPECT_EQ(frame->color[i], is_masked ? 0x00ffffffu : 0xffffffffu) << i;
  }
}

TEST(Masks, AreNamedByIndexNumberOrTime) {
  const TemporaryFolder folder;
  const auto masked = [&](const std::string& name, const std::string& recording = {}) {
    const TemporaryFolder masks;
    write_mask(masks / name);
    const auto source = with_masks(frames(4), masks.path(), recording);
    std::vector<int> indices;
    while (const auto frame = source->next())
      if (masked_pixels(*frame) > 0) indices.push_back(frame->index);
    return indices;
  };
  EXPECT_EQ(masked("2.png"), std::vector{2});
  EXPECT_EQ(masked("frame-000003.mask.png"), std::vector{3});
  EXPECT_EQ(masked("100.200000.png"), std::vector{2}) << "time of depth";
  EXPECT_EQ(masked("100.120000.png"), std::vector{1}) << "time of color";
  EXPECT_EQ(masked("100.150000.png"), std::vector<int>{});
  for (const char* name : {"7.png", "8.png", "9.png", "10.png"}) {
    fs::create_directories(folder / "depth");
    write_text(folder / "depth" / name, "");
  }
  EXPECT_EQ(masked("9.png", folder.path().string()), std::vector{2}) << "number of the depth image";
}

TEST(Masks, MayHaveChannelsAndTheSizeOfASeparateColorCamera) {
  const TemporaryFolder folder;
  write_mask(folder / "rgb" / "0.png", {16, 12}, CV_8UC3);
  EXPECT_EQ(masked_pixels(*with_masks(frames(1), folder / "rgb")->next()), 8 * 12);
  write_mask(folder / "rgba" / "0.png", {16, 12}, CV_8UC4);
  EXPECT_EQ(masked_pixels(*with_masks(frames(1), folder / "rgba")->next()), 8 * 12) << "alpha is no mask";
  write_mask(folder / "color" / "0.png", {32, 24});
  const Rig rig(kCamera, ColorCamera{.camera = {32, 24, 32, 32, 15.5, 11.5, {}}});
  const auto frame = with_masks(frames(1, rig), folder / "color")->next();
  EXPECT_EQ(masked_pixels(*frame), 8 * 12);
  EXPECT_EQ(frame->color[0], ~0u) << "color of another camera stays";
}

TEST(Masks, OfWrongFilesAreRefusedWithTheRemedy) {
  const TemporaryFolder folder;
  const auto refusal = [&](const char* name) { return error_of([&] { (void)with_masks(frames(2), folder / name); }); };
  EXPECT_NE(refusal("missing").find("is not a folder of masks"), std::string::npos);
  fs::create_directories(folder / "none");
  EXPECT_NE(refusal("none").find("contains no mask"), std::string::npos);
  write_mask(folder / "large" / "0.png", {17, 12});
  EXPECT_NE(refusal("large").find("has 17x12 pixels; a mask has the size of the depth images (16x12)"),
            std::string::npos)
      << refusal("large");
  fs::create_directories(folder / "text");
  write_text(folder / "text" / "0.png", "text");
  EXPECT_NE(refusal("text").find("is not an image"), std::string::npos) << refusal("text");
}

TEST(Masks, LaterBrokenOrMissingOnesAreReported) {
  const TemporaryFolder folder;
  write_mask(folder / "m" / "0.png");
  write_text(folder / "m" / "1.png", "text");
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  const auto source = with_masks(frames(4), folder / "m");
  EXPECT_FALSE(source->next()->problem);
  const auto broken = source->next();
  ASSERT_TRUE(broken->problem.has_value());
  EXPECT_NE(broken->problem->find("1.png"), std::string::npos);
  EXPECT_TRUE(broken->depth.empty());
  while (source->next()) {
  }
  const std::string text = testing::internal::GetCapturedStdout() + testing::internal::GetCapturedStderr();
  EXPECT_NE(text.find("has no mask for 2 of 4 frames, the first is frame 2"), std::string::npos) << text;
}

}  // namespace
}  // namespace cairn
