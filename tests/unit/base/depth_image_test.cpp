// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/depth_image.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <limits>
#include <opencv2/imgcodecs.hpp>

#include "support/depth_files.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

constexpr int kWidth = 37, kHeight = 21;  // not a multiple of a tile

cv::Mat image(int type) {
  cv::Mat image(kHeight, kWidth, CV_64F);
  for (int i = 0; i < kWidth * kHeight; ++i) image.ptr<double>()[i] = type == CV_16U ? 700 + 13 * i : 0.7 + 0.0125 * i;
  image.convertTo(image, type);
  return image;
}

cv::Mat decoded(const std::string& bytes) {
  return decode_depth({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
}
std::string error(const std::string& bytes) {
  return error_of([&] { (void)decoded(bytes); });
}
std::string encoded(const char* extension, const cv::Mat& pixels, const std::vector<int>& how = {}) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(extension, pixels, bytes, how);
  return {bytes.begin(), bytes.end()};
}

void expect_same(const std::string& bytes, const cv::Mat& truth) {
  const cv::Mat read = decoded(bytes);
  ASSERT_EQ(read.size(), truth.size());
  ASSERT_EQ(read.type(), truth.type());
  EXPECT_EQ(cv::norm(read, truth, cv::NORM_INF), 0);
}

TEST(DepthImage, DecodesEachFormatExactly) {
  const cv::Mat units = image(CV_16U), meters = image(CV_32F);
  expect_same(encoded(".png", units), units);
  expect_same(encoded(".pgm", units), units);
  for (const int packing : {1, 5, 8, 32946, 32773}) {  // none, LZW, Deflate with two codes, PackBits
    SCOPED_TRACE(packing);
    expect_same(encoded(".tiff", units, {cv::IMWRITE_TIFF_COMPRESSION, packing}), units);
    expect_same(encoded(".tiff", meters, {cv::IMWRITE_TIFF_COMPRESSION, packing}), meters);
  }
  expect_same(npy("<u2", units), units);
  expect_same(npy("<f4", meters), meters);
  expect_same(npy("<f8", image(CV_64F)), meters);
  expect_same(npy("<u2", units, "(21, 37, 1)"), units);
  expect_same(npy("<u2", units, "(1, 21, 37)", 2), units);
}

TEST(DepthImage, DecodesTiledTiffOfBothByteOrders) {
  for (const bool big_endian : {false, true}) {
    for (const cv::Mat& truth : {image(CV_16U), image(CV_32F)}) {
      expect_same(tiff(truth, {.big_endian = big_endian, .tile = 16}), truth);
      expect_same(tiff(truth, {.big_endian = big_endian}), truth);
    }
  }
}

TEST(DepthImage, ReportsErrorInOneLine) {
  const cv::Mat units = image(CV_16U);
  EXPECT_NE(error("").find("is empty"), std::string::npos);
  EXPECT_NE(error("hello").find("is not an image"), std::string::npos);
  // NPY
  const std::string good = npy("<u2", units);
  EXPECT_EQ(error(good.substr(0, 8)), "is not a readable NPY file: damaged or cut off");
  EXPECT_EQ(error(good.substr(0, 100)), "is not a readable NPY file: damaged or cut off");
  EXPECT_EQ(error(good.substr(0, good.size() - 1)), "the file is cut off");
  EXPECT_NE(error(npy(">u2", units)).find("'>u2'; expected uint16"), std::string::npos);
  EXPECT_NE(error(npy("<i8", units)).find("astype"), std::string::npos);
  EXPECT_NE(error(npy("<u2", units, "(21, 37)", 1, true)).find("column-major NPY array; save np.ascontiguousarray"),
            std::string::npos);
  EXPECT_NE(error(npy("<u2", units, "(777,)")).find("of 1 dimensions"), std::string::npos);
  EXPECT_NE(error(npy("<u2", units, "(21, 37, 3)")).find("of 3 dimensions"), std::string::npos);
  EXPECT_NE(error(npy("<u2", units, "(65536, 65536)")).find("has 65536 x 65536 pixels"), std::string::npos);
  EXPECT_NE(error(npy("<u2", units, "(99999999999999999999, 3)")).find("shape is damaged"), std::string::npos);
  EXPECT_NE(error(npy("<u2", units, "(4096, 4096)")).find("cut off"), std::string::npos);
  // PGM
  EXPECT_NE(error("P5 64 48 255\n").find("values up to 255"), std::string::npos);
  EXPECT_NE(error("P5 64 48 65535\n123").find("cut off"), std::string::npos);
  EXPECT_NE(error("P5\n# no end of this").find("has 0 x 0"), std::string::npos);
  EXPECT_NE(error("P5 99999999 99999999 65535\n").find("allowed: 1 to 4096"), std::string::npos);
  // TIFF
  const std::string complete = encoded(".tiff", units, {cv::IMWRITE_TIFF_COMPRESSION, 5});
  EXPECT_NE(error(complete.substr(0, 8)).find("is not a readable TIFF"), std::string::npos);
  EXPECT_NE(error(complete.substr(0, complete.size() / 2)).find("TIFF"), std::string::npos);
  EXPECT_NE(error(encoded(".tiff", cv::Mat(8, 8, CV_8U, cv::Scalar(1)))).find("integers with 8 bits"),
            std::string::npos);
  EXPECT_NE(error(encoded(".tiff", cv::Mat(8, 8, CV_16UC3, cv::Scalar(1)))).find("has 3 different channels of 16 bits"),
            std::string::npos);
  EXPECT_NE(error(tiff(units, {.width = 70000, .height = 70000})).find("allowed: 1 to 4096"), std::string::npos);
  EXPECT_NE(error(tiff(units, {.width = 4096, .height = 4096})).find("cut off"), std::string::npos);
  EXPECT_NE(error(tiff(units, {.compression = 7})).find("compressed by method 7"), std::string::npos);  // JPEG
  EXPECT_NE(error(tiff(units, {.tile = 1 << 20})).find("cut off or damaged"), std::string::npos);
}

TEST(DepthImage, DecodesOrRejectsDamagedBytes) {
  for (const std::string& good :
       {encoded(".tiff", image(CV_16U), {cv::IMWRITE_TIFF_COMPRESSION, 5}), tiff(image(CV_32F), {.tile = 16}),
        npy("<f4", image(CV_32F)), encoded(".pgm", image(CV_16U))})
    for (std::size_t at = 0; at < std::min<std::size_t>(good.size(), 400); ++at)
      for (const char value : {'\0', '\x7f', '\xff'}) {
        std::string bad = good;
        bad[at] = value;
        bad[bad.size() - 1 - at] = value;
        try {
          EXPECT_LE(decoded(bad).total(), 4096u * 4096u);
        } catch (const std::runtime_error& error) {
          EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
        }
      }
}

}  // namespace
}  // namespace cairn
