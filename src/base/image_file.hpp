// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Encoding and decoding of PNG and JPEG files in memory.
#pragma once
#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

namespace cairn {

/// Requested pixel format. as_stored: gray with 8 or 16 bits as in the file, 16-bit color PNG as 16-bit R, G, B, A,
/// anything else as 8-bit R, G, B. rgb: 8-bit R, G, B. rgba: with a fourth byte, 255 if opaque.
enum class Pixels { as_stored, rgb, rgba };

/// Maximum image side in pixels: of a camera, and of a texture.
constexpr int kMaxImageSide = 4096, kMaxTextureSide = 16384;

/// Bound on an image's size, checked against the header before any pixel is decoded: a file of a few kilobytes can
/// declare gigabytes.
struct ImageBound {
  cv::Size size;                  // expected size, of the camera; empty: unknown
  int max_side = kMaxImageSide;   // pixels
  const char* camera = "camera";  // name of the camera in messages
};

/// Decodes a PNG, JPEG, BMP, WebP or color TIFF as stored, ignoring EXIF rotation. Throws std::runtime_error with the
/// reason: truncated (the decoders fill the rest with gray), damaged, beyond `bound`, or a declared size impossible for
/// the number of bytes.
[[nodiscard]] cv::Mat decode_image(std::span<const std::uint8_t> bytes, Pixels pixels, const ImageBound& bound = {});

/// Throws std::runtime_error for a size beyond `bound`. For decoders of other formats.
void check_image_size(std::uint64_t width, std::uint64_t height, const ImageBound& bound);

/// Encodes a PNG: gray with 8 or 16 bits, or R, G, B with 8. `effort`: zlib level, 1 to 9.
[[nodiscard]] std::vector<std::uint8_t> encode_png(const cv::Mat& image, int effort = 1);

struct JpegEffort {
  int quality = 95;       // 1 to 100
  bool smallest = false;  // optimizes the entropy coding; takes twice as long
};
/// Encodes a JPEG: 8-bit gray, R, G, B, or R, G, B with an ignored fourth channel.
[[nodiscard]] std::vector<std::uint8_t> encode_jpeg(const cv::Mat& image, JpegEffort effort = {});

/// Converts meters to integer units. `none`: value for no measurement, and for values beyond 16 bits.
[[nodiscard]] std::vector<std::uint16_t> depth_units(std::span<const float> depth, double units_per_meter,
                                                     std::uint16_t none = 0);
/// Pixels of a Pixels::rgba image in the format of Frame::color.
[[nodiscard]] std::vector<std::uint32_t> color_pixels(const cv::Mat& rgba);

}  // namespace cairn
