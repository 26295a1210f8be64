// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/exr_image.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "base/depth_image.hpp"
#include "support/depth_files.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

cv::Mat1f ramp() {
  cv::Mat1f depth(6, 8);
  for (int y = 0; y < depth.rows; ++y)
    for (int x = 0; x < depth.cols; ++x)
      depth(y, x) = 0.5f + 0.25f * static_cast<float>(x) + 0.125f * static_cast<float>(y);
  return depth;
}

cv::Mat decode(const std::string& bytes) {
  return decode_depth({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
}

bool are_equal(const cv::Mat& a, const cv::Mat& b) {
  return a.type() == b.type() && a.size() == b.size() && cv::countNonZero(a != b) == 0;
}

TEST(ExrImage, DecodesFloatAndHalfChannels) {
  const cv::Mat1f depth = ramp();
  cv::Mat half;
  depth.convertTo(half, CV_16F);  // exact: eighths of a meter
  EXPECT_TRUE(are_equal(decode(exr({{"R", depth}})), depth));
  EXPECT_TRUE(are_equal(decode(exr({{"Z", half}})), depth));
  EXPECT_TRUE(are_equal(decode(exr({{"B", depth}, {"G", depth}, {"R", depth}})), depth));
  EXPECT_TRUE(are_equal(decode(exr({{"A", 2 * depth}, {"View.Depth.Z", depth}})), depth));
}

TEST(ExrImage, RejectsImagesWithoutDepth) {
  const cv::Mat1f depth = ramp();
  const auto error = [](const std::string& bytes) { return error_of([&] { (void)decode(bytes); }); };
  EXPECT_NE(error(exr({{"B", depth}, {"G", depth}, {"R", 2 * depth}})).find("R, G and B differ"), std::string::npos);
  EXPECT_NE(error(exr({{"A", depth}, {"U", depth}})).find("2 channels"), std::string::npos);
  std::string deep = exr({{"R", depth}});
  deep[5] = 0x08;
  EXPECT_NE(error(deep).find("deep"), std::string::npos);
}

TEST(ExrImage, RejectsSizesBeforeAllocation) {
  const std::string valid = exr({{"R", ramp()}});
  const auto with_corner = [&](int x, int y) {
    std::string bytes = valid;
    for (const char* name : {"dataWindow", "displayWindow"}) {
      const std::size_t at = bytes.find(name) + std::string(name).size() + 1 + 6 + 4 + 8;
      std::memcpy(&bytes[at], &x, 4);
      std::memcpy(&bytes[at + 4], &y, 4);
    }
    return error_of([&] { (void)decode(bytes); });
  };
  EXPECT_NE(with_corner(99'999, 5).find("100000 x 6 pixels"), std::string::npos);
  EXPECT_NE(with_corner(std::numeric_limits<int>::max(), std::numeric_limits<int>::max()).find("allowed"),
            std::string::npos);
  EXPECT_NE(with_corner(4095, 4095).find("cut off"), std::string::npos);
  std::string long_attribute = valid;
  const std::size_t at = long_attribute.find("chlist") + 7;
  const std::uint32_t size = 0x7fffffff;
  std::memcpy(&long_attribute[at], &size, 4);
  EXPECT_NE(error_of([&] { (void)decode(long_attribute); }).find("cut off"), std::string::npos);
}

// OpenEXR reads four bytes of an `int`, whatever its size, and takes the rest for the next attribute, of any size.
TEST(ExrImage, RejectsAttributesLongerThanTheirType) {
  using namespace std::string_literals;
  std::string bytes = exr({{"R", ramp()}});
  const std::string inner = "b\0other\0\4\0\0\0abcd"s;
  const std::string outer = "a\0int\0"s + static_cast<char>(4 + inner.size()) + "\0\0\0abcd"s + inner;
  constexpr std::size_t kLines = 6;
  const auto offset_at = [&](std::size_t position) {
    std::uint64_t offset = 0;
    std::memcpy(&offset, &bytes[position], sizeof offset);
    return offset;
  };
  std::size_t table = 8;  // offsets of the chunks, one or one per line, directly before the first chunk
  const auto chunks = [&] { return (offset_at(table) - table) / sizeof(std::uint64_t); };
  while (offset_at(table) != table + 8 && offset_at(table) != table + 8 * kLines) ASSERT_LT(++table + 8, bytes.size());
  for (std::size_t i = 0, count = chunks(); i < count; ++i) {
    const std::uint64_t shifted = offset_at(table + 8 * i) + outer.size();
    std::memcpy(&bytes[table + 8 * i], &shifted, sizeof shifted);
  }
  bytes.insert(8, outer);
  EXPECT_NE(error_of([&] { (void)decode(bytes); }).find("damaged"), std::string::npos);
}

TEST(ExrImage, DecodesOrRejectsDamagedBytes) {
  const std::string valid = exr({{"R", ramp()}});
  for (std::size_t size = 0; size < valid.size(); ++size)
    EXPECT_THROW((void)decode(valid.substr(0, size)), std::runtime_error) << size;
  std::mt19937 random(1);
  for (int i = 0; i < 3000; ++i) {
    std::string bytes = valid;
    for (int k = 0; k < 3; ++k) bytes[random() % bytes.size()] = static_cast<char>(random());
    try {
      EXPECT_LE(decode(bytes).total(), 4096u * 4096u);
    } catch (const std::runtime_error&) {
    }
  }
}

}  // namespace
}  // namespace cairn
