// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Whole images from the bytes of PNG and JPEG files, and such bytes.
#pragma once
#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "cairn/camera.hpp"

namespace cairn {

/// How pixels are wanted: grey of 8 or 16 bits as it is stored, a PNG's color of 16 bits as R, G, B, A of 16 bits and
/// all else as 8-bit R, G, B; 8-bit R, G, B; or with a fourth byte, 255 where there is no transparency.
enum class Pixels { as_stored, rgb, rgba };

/// Pixels along a side that an image has at most: of a camera, and of a texture.
constexpr int kMostImageSide = 4096, kMostTextureSide = 16384;

/// Bound on an image's size, which its header is held against before any pixel is decoded: a file of a few kilobytes
/// can ask for gigabytes.
struct ImageBound {
  cv::Size size;                   // of the camera that took it; empty: not known
  int most_side = kMostImageSide;  // pixels
  const char* camera = "camera";   // as the message names it
};

/// A whole PNG, JPEG, BMP, WebP or TIFF of color, as it lies in the file (EXIF may say that it was turned). Throws
/// std::runtime_error that says why not: cut off (the decoders fill the rest with grey), damaged, beyond `bound`, or
/// larger than its bytes can be.
[[nodiscard]] cv::Mat decode_image(std::span<const std::uint8_t> bytes, Pixels pixels, const ImageBound& bound = {});

/// Throws std::runtime_error for a size beyond `bound`. For decoders of other formats.
void check_image_size(std::uint64_t width, std::uint64_t height, const ImageBound& bound);

/// The bytes of a PNG: of grey with 8 or 16 bits, or R, G, B with 8. `effort`: zlib's, 1 to 9.
[[nodiscard]] std::vector<std::uint8_t> encode_png(const cv::Mat& image, int effort = 1);

struct JpegEffort {
  int quality = 95;       // 1 to 100
  bool smallest = false;  // takes twice as long
};
/// The bytes of a JPEG: of 8 bits of grey, R, G, B, or R, G, B and one more that is left out.
[[nodiscard]] std::vector<std::uint8_t> encode_jpeg(const cv::Mat& image, JpegEffort effort = {});

/// Metres as whole units. `none`: where nothing was measured, and where more units than 16 bits hold would stand.
[[nodiscard]] std::vector<std::uint16_t> depth_units(std::span<const float> depth, double units_per_metre,
                                                     std::uint16_t none = 0);
/// The same by pixel of the camera as the bytes of a PNG of 16 bits.
[[nodiscard]] std::vector<std::uint8_t> encode_depth(std::span<const float> depth, const Camera& camera,
                                                     double units_per_metre, std::uint16_t none = 0);

/// The bytes of a PNG or JPEG, by its extension. `colour`: bytes R, G, B, 255 by pixel of the camera.
[[nodiscard]] std::vector<std::uint8_t> encode_colour(std::span<const std::uint32_t> colour, const Camera& camera,
                                                      const char* extension);
/// Of an image of Pixels::rgba, as Frame::colour has them.
[[nodiscard]] std::vector<std::uint32_t> colour_pixels(const cv::Mat& rgba);

}  // namespace cairn
