// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Image formats beyond PNG and JPEG color and single-channel depth.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>

#include "base/depth_image.hpp"
#include "base/image_file.hpp"
#include "cairn/io/inspect.hpp"
#include "io/recording.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
const Camera kCamera{160, 120, 131.25, 131.25, 79.5, 59.5, {}};

std::vector<std::uint8_t> encoded(const char* extension, const cv::Mat& image, const std::vector<int>& how = {}) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(extension, image, bytes, how);
  return bytes;
}
cv::Mat picture() {
  cv::Mat image(13, 17, CV_8UC3);
  for (int i = 0; i < static_cast<int>(image.total()); ++i)
    image.ptr<cv::Vec3b>()[i] = cv::Vec3b(static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(3 * i), 200);
  return image;
}

TEST(OtherImages, DecodeExactly) {
  const cv::Mat bgr = picture();
  for (const char* kind : {".bmp", ".tiff", ".webp"}) {
    SCOPED_TRACE(kind);
    const auto bytes = encoded(
        kind, bgr,
        std::string_view(kind) == ".webp" ? std::vector<int>{cv::IMWRITE_WEBP_QUALITY, 101} : std::vector<int>{});
    const cv::Mat rgba = decode_image(bytes, Pixels::rgba), rgb = decode_image(bytes, Pixels::rgb);
    ASSERT_EQ(rgba.type(), CV_8UC4);
    ASSERT_EQ(rgb.type(), CV_8UC3);
    ASSERT_EQ(rgba.size(), bgr.size());
    for (int i = 0; i < static_cast<int>(bgr.total()); ++i) {
      const auto p = bgr.ptr<cv::Vec3b>()[i];
      ASSERT_EQ(rgba.ptr<cv::Vec4b>()[i], cv::Vec4b(p[2], p[1], p[0], 255)) << i;
      ASSERT_EQ(rgb.ptr<cv::Vec3b>()[i], cv::Vec3b(p[2], p[1], p[0])) << i;
    }
  }
}

TEST(OtherImages, RejectTruncatedAndOversized) {
  for (const char* kind : {".bmp", ".tiff", ".webp"}) {
    SCOPED_TRACE(kind);
    const auto complete = encoded(kind, picture());
    for (std::size_t size = 2; size < complete.size(); size += complete.size() / 37 + 1) {
      const std::vector<std::uint8_t> part(complete.begin(), complete.begin() + static_cast<std::ptrdiff_t>(size));
      EXPECT_THROW((void)decode_image(part, Pixels::rgba), std::runtime_error) << size;
    }
  }
  auto bomb = encoded(".bmp", picture());
  for (const std::size_t at : {19u, 23u}) bomb[at] = 0x10;  // 4096 + 17 by 4096 + 13 pixels
  EXPECT_THROW((void)decode_image(bomb, Pixels::rgba), std::runtime_error);
  bomb[19] = bomb[23] = 0x0f;  // 3857 by 3853 pixels, more than the file's data
  EXPECT_NE(error_of([&] { (void)decode_image(bomb, Pixels::rgba); }).find("cut off"), std::string::npos);
}

TEST(DepthImage, ReducesThreeEqualChannels) {
  const cv::Mat depth(12, 16, CV_16U, cv::Scalar(1234));
  cv::Mat three;
  cv::merge(std::vector<cv::Mat>{depth, depth, depth}, three);
  for (const char* kind : {".png", ".tiff"}) {
    const cv::Mat read = decode_depth(encoded(kind, three));
    ASSERT_EQ(read.type(), CV_16UC1) << kind;
    EXPECT_EQ(read.at<std::uint16_t>(5, 7), 1234);
    cv::Mat other = three.clone();
    other.at<cv::Vec3w>(3, 4)[1] = 7;
    const std::string error = error_of([&] { (void)decode_depth(encoded(kind, other)); });
    EXPECT_NE(error.find("different channels of 16 bits; depth has one"), std::string::npos) << error;
  }
}

cv::Mat depth_of_room(int i) {
  const Frame frame = scene_frame(synthetic_scene("room"), kCamera, i);
  cv::Mat depth(kCamera.height, kCamera.width, CV_16U);
  for (std::size_t k = 0; k < frame.depth.size(); ++k)
    depth.ptr<std::uint16_t>()[k] = static_cast<std::uint16_t>(1000 * frame.depth[k]);
  return depth;
}
cv::Mat with_swapped_bytes(cv::Mat depth) {
  for (int k = 0; k < static_cast<int>(depth.total()); ++k) {
    auto& value = depth.ptr<std::uint16_t>()[k];
    value = static_cast<std::uint16_t>(value << 8 | value >> 8);
  }
  return depth;
}

struct Folder : TemporaryFolder {
  explicit Folder(bool is_swapped, const char* color = "color/{}.bmp", int scale = 1) {
    fs::create_directories(*this / "depth");
    fs::create_directories(*this / "color");
    write_text(*this / "camera.yaml", "{width: 160, height: 120, fx: 131.25, fy: 131.25, cx: 79.5, cy: 59.5}");
    for (int i = 0; i < 3; ++i) {
      cv::Mat depth = depth_of_room(i) * scale;
      cv::imwrite((*this / fmt::format("depth/{}.png", i)).string(), is_swapped ? with_swapped_bytes(depth) : depth);
      if (color != nullptr)
        cv::imwrite((*this / fmt::format(fmt::runtime(color), i)).string(),
                    cv::Mat(kCamera.height, kCamera.width, CV_8UC3, cv::Scalar(10 * i, 20, 30)));
    }
  }
};
struct Opened {
  std::unique_ptr<Source> source;
  std::string output;
};
Opened open(const fs::path& folder) {
  testing::internal::CaptureStdout();
  auto source = open_source(folder.string());
  return {std::move(source), testing::internal::GetCapturedStdout()};
}

TEST(ImageFolder, SwapsDepthOfWrongByteOrder) {
  const Folder good(false), bad(true);
  const auto truth = open(good.path()), swapped = open(bad.path());
  EXPECT_EQ(truth.output.find("bytes"), std::string::npos) << truth.output;
  EXPECT_NE(swapped.output.find("depth has the opposite byte order"), std::string::npos) << swapped.output;
  while (const auto frame = truth.source->next()) EXPECT_EQ(swapped.source->next()->depth, frame->depth);
}

TEST(ImageFolder, KeepsByteOrderOfSteppedDepth) {
  const Folder stepped(false, nullptr, 5);
  EXPECT_EQ(open(stepped.path()).output.find("bytes"), std::string::npos);
}

TEST(ImageFolder, ReadsColorOfEachFormat) {
  for (const char* color : {"color/{}.bmp", "color/{}.webp", "color/{}.tiff", "color/{}.BMP"}) {
    SCOPED_TRACE(color);
    const Folder folder(false, color);
    const auto opened = open(folder.path());
    const auto frame = opened.source->next();
    ASSERT_EQ(frame->color.size(), 160u * 120);
    EXPECT_NEAR(frame->color[77] & 255u, 30, 2);
    EXPECT_EQ(opened.output.find("color"), std::string::npos) << opened.output;
  }
}

TEST(ImageFolder, NamesSkippedFiles) {
  const Folder folder(false, nullptr);
  for (int i = 0; i < 3; ++i) write_text(folder / fmt::format("color/{}.heic", i), "ftypheic");
  std::string output = open(folder.path()).output;
  EXPECT_NE(output.find("3 files .heic in color are not read: convert them to PNG or JPEG"), std::string::npos)
      << output;
  EXPECT_NE(output.find("there is no color: only depth is used"), std::string::npos) << output;
  cv::imwrite((folder / "color/0.png").string(), cv::Mat(kCamera.height, kCamera.width, CV_8UC3, cv::Scalar(1, 2, 3)));
  output = open(folder.path()).output;
  EXPECT_NE(output.find("3 files .heic in color are not read"), std::string::npos) << output;
}

}  // namespace
}  // namespace cairn
