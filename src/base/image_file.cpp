// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/image_file.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string_view>

namespace cairn {
namespace {

// What a byte can at most become: deflate's longest match, and a progressive JPEG of one bit for each 8x8 block.
constexpr std::uint64_t kPngBytes = 1040, kJpegPixels = 512;
constexpr std::uint64_t kRoom = 1 << 16;  // pixels or bytes that any file may have
constexpr int kPngEffort = 1, kJpegQuality = 95;

std::uint64_t big_endian(std::span<const std::uint8_t> bytes, std::size_t at, std::size_t count) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < count; ++i) value = value << 8 | bytes[at + i];
  return value;
}

/// Whether the pixels that the header promises can be in the file: the decoders get memory for them before they look.
bool is_plausible_png(std::span<const std::uint8_t> b) {
  if (b.size() < 33) return false;  // signature and IHDR
  constexpr std::uint64_t kChannels[] = {1, 0, 3, 1, 2, 0, 4};
  const std::uint64_t width = big_endian(b, 16, 4), height = big_endian(b, 20, 4), bits = b[24], kind = b[25];
  if (kind > 6 || width == 0 || height == 0 || width > 1 << 20 || height > 1 << 20) return false;
  return (width * bits * kChannels[kind] / 8 + 1) * height <= b.size() * kPngBytes + kRoom;
}
bool is_plausible_jpeg(std::span<const std::uint8_t> b) {
  for (std::size_t at = 2; at + 9 < b.size();) {
    if (b[at] != 0xff) return false;
    const int marker = b[at + 1];
    if (marker == 0xff) {  // padding
      ++at;
    } else if (marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc) {  // a frame
      return big_endian(b, at + 5, 2) * big_endian(b, at + 7, 2) <= b.size() * kJpegPixels + kRoom;
    } else if (marker == 0x01 || (marker >= 0xd0 && marker <= 0xd8)) {  // alone
      at += 2;
    } else {
      at += 2 + big_endian(b, at + 2, 2);
    }
  }
  return false;
}

}  // namespace

cv::Mat decode_image(std::span<const std::uint8_t> bytes, int flags) {
  const std::string_view all(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::string_view end = all.substr(all.size() - std::min<std::size_t>(all.size(), 64));
  // The whole signatures: OpenCV hands what only begins like them to other decoders, of which some abort.
  const bool png = all.starts_with("\x89PNG\r\n\x1a\n"), jpeg = all.starts_with("\xff\xd8\xff");
  if (!png && !jpeg) throw std::runtime_error("is no image: neither PNG nor JPEG");
  if (end.find(png ? "IEND" : "\xff\xd9") == end.npos) throw std::runtime_error("the file is cut off");
  cv::Mat image;
  try {
    if (bytes.size() < 1u << 31 && (png ? is_plausible_png(bytes) : is_plausible_jpeg(bytes)))
      image = cv::imdecode(cv::Mat(1, static_cast<int>(bytes.size()), CV_8U, const_cast<std::uint8_t*>(bytes.data())),
                           flags);
  } catch (const cv::Exception&) {
  }
  if (image.empty()) throw std::runtime_error("is no image that can be decoded");
  return image;
}

std::vector<std::uint16_t> depth_units(std::span<const float> depth, double units_per_metre, std::uint16_t none) {
  std::vector<std::uint16_t> units(depth.size());
  std::transform(depth.begin(), depth.end(), units.begin(), [&](float metres) {
    const double value = std::round(static_cast<double>(metres) * units_per_metre);
    return value < 1 || value > 65535 ? none : static_cast<std::uint16_t>(value);
  });
  return units;
}

std::vector<std::uint8_t> encode_depth(std::span<const float> depth, const Camera& camera, double units_per_metre,
                                       std::uint16_t none) {
  auto units = depth_units(depth, units_per_metre, none);
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", cv::Mat(camera.height, camera.width, CV_16U, units.data()), bytes,
               {cv::IMWRITE_PNG_COMPRESSION, kPngEffort});
  return bytes;
}

std::vector<std::uint8_t> encode_colour(std::span<const std::uint32_t> colour, const Camera& camera,
                                        const char* extension) {
  cv::Mat bgr;
  cv::cvtColor(cv::Mat(camera.height, camera.width, CV_8UC4, const_cast<std::uint32_t*>(colour.data())), bgr,
               cv::COLOR_RGBA2BGR);
  std::vector<std::uint8_t> bytes;
  cv::imencode(extension, bgr, bytes,
               {cv::IMWRITE_PNG_COMPRESSION, kPngEffort, cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
  return bytes;
}

}  // namespace cairn
