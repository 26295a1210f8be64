// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/other_images.hpp"

#include <webp/decode.h>

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <string_view>

#include "base/depth_image.hpp"

// stb's image reader: a header with its implementation. Only BMP is compiled.
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#endif
#define STB_IMAGE_STATIC
#define STB_IMAGE_IMPLEMENTATION
#define STBI_ONLY_BMP
#define STBI_NO_STDIO
#define STBI_NO_LINEAR
#define STBI_MAX_DIMENSIONS 16384
#include <stb_image.h>
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

namespace cairn {
namespace {

constexpr std::uint64_t kMaxWebpRatio = 8192;   // pixels per byte: VP8L encodes a flat block of rows in a few bits
constexpr std::uint64_t kFreePixels = 1 << 16;  // pixels allowed for any file

void check_pixels(int width, int height, std::uint64_t max_pixels, const ImageBound& bound) {
  check_image_size(static_cast<std::uint64_t>(std::max(width, 0)), static_cast<std::uint64_t>(std::max(height, 0)),
                   bound);
  if (static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height) > max_pixels)
    throw std::runtime_error("the file is cut off");
}

std::uint64_t little_endian(std::span<const std::uint8_t> bytes, std::size_t at, std::size_t count) {
  std::uint64_t value = 0;
  for (std::size_t i = count; i-- > 0;) value = value << 8 | bytes[at + i];
  return value;
}

/// Size of a BMP up to its last row, in bytes: stb reads no compressed rows, and fills missing data with black.
std::uint64_t bytes_of_bmp(std::span<const std::uint8_t> bytes, int width, int height) {
  if (bytes.size() < 30) return UINT64_MAX;
  const std::uint64_t bits = little_endian(bytes, little_endian(bytes, 14, 4) == 12 ? 24 : 28, 2);
  const std::uint64_t row = (static_cast<std::uint64_t>(width) * bits + 31) / 32 * 4;
  return little_endian(bytes, 10, 4) + row * static_cast<std::uint64_t>(height);
}

cv::Mat decode_bmp(std::span<const std::uint8_t> bytes, const ImageBound& bound) {
  int width = 0, height = 0, channels = 0;
  const int size = static_cast<int>(std::min<std::size_t>(bytes.size(), 1 << 30));
  if (stbi_info_from_memory(bytes.data(), size, &width, &height, &channels) == 0)
    throw std::runtime_error("is not a readable BMP: damaged, compressed, or too large");
  height = std::abs(height);  // negative: rows from top to bottom
  check_pixels(width, height, UINT64_MAX, bound);
  if (bytes_of_bmp(bytes, width, height) > bytes.size()) throw std::runtime_error("the file is cut off");
  const std::unique_ptr<stbi_uc, void (*)(void*)> pixels(
      stbi_load_from_memory(bytes.data(), size, &width, &height, &channels, STBI_rgb_alpha), std::free);
  if (!pixels) throw std::runtime_error("is not a readable BMP: damaged, compressed or cut off");
  return cv::Mat(height, width, CV_8UC4, pixels.get()).clone();
}

cv::Mat decode_webp(std::span<const std::uint8_t> bytes, const ImageBound& bound) {
  int width = 0, height = 0;
  if (WebPGetInfo(bytes.data(), bytes.size(), &width, &height) == 0)
    throw std::runtime_error("is not a readable WebP: damaged or cut off");
  check_pixels(width, height, bytes.size() * kMaxWebpRatio + kFreePixels, bound);
  cv::Mat image(height, width, CV_8UC4);
  if (WebPDecodeRGBAInto(bytes.data(), bytes.size(), image.data, image.total() * image.elemSize(),
                         static_cast<int>(image.step[0])) == nullptr)
    throw std::runtime_error("is not a readable WebP: damaged, cut off, or an animation");
  return image;
}

}  // namespace

std::optional<cv::Mat> decode_other_image(std::span<const std::uint8_t> bytes, const ImageBound& bound) {
  const std::string_view all(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (all.starts_with("BM")) return decode_bmp(bytes, bound);
  if (all.starts_with("RIFF") && all.substr(0, 12).ends_with("WEBP")) return decode_webp(bytes, bound);
  if (is_tiff(bytes)) return decode_color_tiff(bytes, bound);
  return std::nullopt;
}

}  // namespace cairn
