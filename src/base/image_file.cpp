// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/image_file.hpp"

#include <spng.h>
// libjpeg's header wants these before it.
#include <cstddef>
#include <cstdio>
// clang-format off
#include <jpeglib.h>
// clang-format on

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <csetjmp>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <stdexcept>
#include <string_view>

#include "base/atomic_file.hpp"
#include "base/checked_count.hpp"
#include "base/other_images.hpp"
#include "base/picture.hpp"

namespace cairn {
namespace {

// Maximum compression ratios: deflate's longest match, and a progressive JPEG with one bit per 8x8 block.
constexpr std::uint64_t kMaxPngRatio = 1040, kMaxJpegRatio = 512;
constexpr std::uint64_t kFreeSize = 1 << 16;  // pixels or bytes allowed for any file
constexpr std::size_t kMaxChunk = 1 << 20;    // maximum unpacked bytes of a PNG chunk without pixels
constexpr int kMaxScans = 64;                 // maximum scans of a progressive JPEG; encoders write 10

std::uint64_t big_endian(std::span<const std::uint8_t> bytes, std::size_t at, std::size_t count) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < count; ++i) value = value << 8 | bytes[at + i];
  return value;
}

struct ImageHeader {
  std::uint64_t width = 0, height = 0;
  bool is_plausible = false;  // file is large enough for the pixels: decoders allocate memory before they check
};

/// Returns nullopt for a damaged header.
std::optional<ImageHeader> png_header(std::span<const std::uint8_t> b) {
  if (b.size() < 33) return std::nullopt;  // signature and IHDR
  constexpr std::uint64_t kChannels[] = {1, 0, 3, 1, 2, 0, 4};
  const std::uint64_t width = big_endian(b, 16, 4), height = big_endian(b, 20, 4), bits = b[24], kind = b[25];
  if (kind > 6 || width == 0 || height == 0) return std::nullopt;
  const std::uint64_t row = product(width, bits, kChannels[kind]) / 8 + 1;
  return ImageHeader{width, height, product(row, height) <= product(b.size(), kMaxPngRatio) + kFreeSize};
}
std::optional<ImageHeader> jpeg_header(std::span<const std::uint8_t> b) {
  for (std::size_t at = 2; at + 9 < b.size();) {
    if (b[at] != 0xff) return std::nullopt;
    const int marker = b[at + 1];
    if (marker == 0xff) {  // padding
      ++at;
    } else if (marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc) {  // a frame
      const std::uint64_t height = big_endian(b, at + 5, 2), width = big_endian(b, at + 7, 2);
      if (width == 0 || height == 0) return std::nullopt;
      return ImageHeader{width, height, product(width, height) <= product(b.size(), kMaxJpegRatio) + kFreeSize};
    } else if (marker == 0x01 || (marker >= 0xd0 && marker <= 0xd8)) {  // marker without data
      at += 2;
    } else {
      at += 2 + big_endian(b, at + 2, 2);
    }
  }
  return std::nullopt;
}

using PngContext = std::unique_ptr<spng_ctx, void (*)(spng_ctx*)>;

/// Decodes a PNG in the format of `pixels`; returns an empty image on failure.
cv::Mat decode_png(std::span<const std::uint8_t> bytes, Pixels pixels) {
  const PngContext png(spng_ctx_new(0), spng_ctx_free);
  spng_ihdr header{};
  // Limits text and color profiles, with unbounded unpacked size.
  if (!png || spng_set_chunk_limits(png.get(), kMaxChunk, kMaxChunk) != 0 ||
      spng_set_png_buffer(png.get(), bytes.data(), bytes.size()) != 0 || spng_get_ihdr(png.get(), &header) != 0)
    return {};
  const bool is_gray = header.color_type == SPNG_COLOR_TYPE_GRAYSCALE;
  int format = SPNG_FMT_RGB8, type = CV_8UC3;
  if (pixels == Pixels::rgba)
    format = SPNG_FMT_RGBA8, type = CV_8UC4;
  else if (pixels == Pixels::as_stored && header.bit_depth == 16)
    format = is_gray ? SPNG_FMT_PNG : SPNG_FMT_RGBA16, type = is_gray ? CV_16UC1 : CV_16UC4;
  else if (pixels == Pixels::as_stored && is_gray)
    format = SPNG_FMT_G8, type = CV_8UC1;
  cv::Mat image(static_cast<int>(header.height), static_cast<int>(header.width), type);
  const std::size_t size = image.total() * image.elemSize();
  std::size_t needed = 0;
  if (spng_decoded_image_size(png.get(), format, &needed) != 0 || needed != size ||
      spng_decode_image(png.get(), image.data, size, format, 0) != 0)
    return {};
  return image;
}

struct JpegErrors {
  jpeg_error_mgr manager;
  std::jmp_buf after;
};

/// Error handler of libjpeg; longjmp is safe because only C frames are skipped.
[[noreturn]] void fail_jpeg(j_common_ptr info) { std::longjmp(reinterpret_cast<JpegErrors*>(info->err)->after, 1); }
void ignore_message(j_common_ptr, int) {}
/// Limits the scans: a progressive JPEG can revisit all pixels with every few bytes.
void count_scans(j_common_ptr info) {
  if (reinterpret_cast<j_decompress_ptr>(info)->input_scan_number > kMaxScans) fail_jpeg(info);
}

void set_errors(JpegErrors& errors) {
  jpeg_std_error(&errors.manager);
  errors.manager.error_exit = fail_jpeg;
  errors.manager.emit_message = ignore_message;
}

/// Decompresses into `image`, with the color format in its type. Returns false on failure.
bool read_jpeg(jpeg_decompress_struct& jpeg, JpegErrors& errors, std::span<const std::uint8_t> bytes, Pixels pixels,
               cv::Mat& image) {
  jpeg_progress_mgr progress{};
  progress.progress_monitor = count_scans;
  if (setjmp(errors.after) != 0) return false;
  jpeg_create_decompress(&jpeg);
  jpeg_mem_src(&jpeg, bytes.data(), static_cast<unsigned long>(bytes.size()));
  if (jpeg_read_header(&jpeg, TRUE) != JPEG_HEADER_OK) return false;
  jpeg.progress = &progress;
  const bool is_gray = jpeg.num_components == 1 && pixels == Pixels::as_stored;
  jpeg.out_color_space = is_gray ? JCS_GRAYSCALE : pixels == Pixels::rgba ? JCS_EXT_RGBA : JCS_EXT_RGB;
  jpeg_start_decompress(&jpeg);
  image.create(static_cast<int>(jpeg.output_height), static_cast<int>(jpeg.output_width),
               is_gray                  ? CV_8UC1
               : pixels == Pixels::rgba ? CV_8UC4
                                        : CV_8UC3);
  while (jpeg.output_scanline < jpeg.output_height) {
    JSAMPROW row = image.ptr(static_cast<int>(jpeg.output_scanline));
    jpeg_read_scanlines(&jpeg, &row, 1);
  }
  return true;
}

cv::Mat decode_jpeg(std::span<const std::uint8_t> bytes, Pixels pixels) {
  cv::Mat image;
  JpegErrors errors{};
  jpeg_decompress_struct jpeg{};
  set_errors(errors);
  jpeg.err = &errors.manager;
  const bool is_read = read_jpeg(jpeg, errors, bytes, pixels, image);
  jpeg_destroy_decompress(&jpeg);
  return is_read ? image : cv::Mat();
}

struct JpegBytes {
  unsigned char* data = nullptr;
  unsigned long size = 0;
};

bool write_jpeg(jpeg_compress_struct& jpeg, JpegErrors& errors, const cv::Mat& image, JpegEffort effort,
                JpegBytes& bytes) {
  if (setjmp(errors.after) != 0) return false;
  jpeg_create_compress(&jpeg);
  jpeg_mem_dest(&jpeg, &bytes.data, &bytes.size);
  jpeg.image_width = static_cast<JDIMENSION>(image.cols);
  jpeg.image_height = static_cast<JDIMENSION>(image.rows);
  jpeg.input_components = image.channels();
  jpeg.in_color_space = image.channels() == 4 ? JCS_EXT_RGBX : image.channels() == 3 ? JCS_RGB : JCS_GRAYSCALE;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, effort.quality, TRUE);
  jpeg.optimize_coding = effort.smallest ? TRUE : FALSE;
  jpeg_start_compress(&jpeg, TRUE);
  while (jpeg.next_scanline < jpeg.image_height) {
    JSAMPROW row = const_cast<JSAMPROW>(image.ptr(static_cast<int>(jpeg.next_scanline)));
    jpeg_write_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_compress(&jpeg);
  return true;
}

}  // namespace

void check_image_size(std::uint64_t width, std::uint64_t height, const ImageBound& bound) {
  const auto max_side = static_cast<std::uint64_t>(bound.max_side);
  if (!bound.size.empty() && (width != count_of(bound.size.width) || height != count_of(bound.size.height)))
    throw std::runtime_error(
        fmt::format("is {}x{}, the {} {}x{}", width, height, bound.camera, bound.size.width, bound.size.height));
  if (width == 0 || height == 0 || width > max_side || height > max_side)
    throw std::runtime_error(fmt::format("has {} x {} pixels, allowed: 1 to {} per side", width, height, max_side));
}

cv::Mat decode_image(std::span<const std::uint8_t> bytes, Pixels pixels, const ImageBound& bound) {
  if (const auto other = decode_other_image(bytes, bound)) {
    if (pixels == Pixels::rgba) return *other;
    cv::Mat rgb;
    cv::cvtColor(*other, rgb, cv::COLOR_RGBA2RGB);
    return rgb;
  }
  const std::string_view all(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::string_view end = all.substr(all.size() - std::min<std::size_t>(all.size(), 64));
  const bool png = all.starts_with("\x89PNG\r\n\x1a\n"), jpeg = all.starts_with("\xff\xd8\xff");
  if (!png && !jpeg) throw std::runtime_error("is not an image: neither PNG nor JPEG");
  if (end.find(png ? "IEND" : "\xff\xd9") == end.npos) throw std::runtime_error("the file is cut off");
  cv::Mat image;
  const auto header = png ? png_header(bytes) : jpeg_header(bytes);
  if (header) check_image_size(header->width, header->height, bound);
  if (header && header->is_plausible) image = png ? decode_png(bytes, pixels) : decode_jpeg(bytes, pixels);
  if (image.empty()) throw std::runtime_error("is not a readable image");
  return image;
}

std::vector<std::uint8_t> encode_png(const cv::Mat& image, int effort) {
  const PngContext png(spng_ctx_new(SPNG_CTX_ENCODER), spng_ctx_free);
  spng_ihdr header{};
  header.width = static_cast<std::uint32_t>(image.cols);
  header.height = static_cast<std::uint32_t>(image.rows);
  header.bit_depth = image.depth() == CV_16U ? 16 : 8;
  header.color_type = image.channels() == 1 ? SPNG_COLOR_TYPE_GRAYSCALE : SPNG_COLOR_TYPE_TRUECOLOR;
  const cv::Mat rows = image.isContinuous() ? image : image.clone();
  std::size_t size = 0;
  int error = png ? 0 : 1;
  const auto check_result = [&](int result) { error = error != 0 ? error : result; };
  check_result(spng_set_option(png.get(), SPNG_ENCODE_TO_BUFFER, 1));
  check_result(spng_set_option(png.get(), SPNG_IMG_COMPRESSION_LEVEL, effort));
  check_result(spng_set_ihdr(png.get(), &header));
  check_result(
      spng_encode_image(png.get(), rows.data, rows.total() * rows.elemSize(), SPNG_FMT_PNG, SPNG_ENCODE_FINALIZE));
  const std::unique_ptr<std::uint8_t, void (*)(void*)> bytes(
      error == 0 ? static_cast<std::uint8_t*>(spng_get_png_buffer(png.get(), &size, &error)) : nullptr, std::free);
  if (!bytes) throw std::runtime_error(std::string("an image cannot be encoded as PNG: ") + spng_strerror(error));
  return {bytes.get(), bytes.get() + size};
}

std::vector<std::uint8_t> encode_jpeg(const cv::Mat& image, JpegEffort effort) {
  JpegErrors errors{};
  jpeg_compress_struct jpeg{};
  JpegBytes bytes;
  set_errors(errors);
  jpeg.err = &errors.manager;
  const bool is_written = write_jpeg(jpeg, errors, image, effort, bytes);
  jpeg_destroy_compress(&jpeg);
  const std::unique_ptr<unsigned char, void (*)(void*)> data(bytes.data, std::free);
  if (!is_written) throw std::runtime_error("an image cannot be encoded as JPEG");
  return {data.get(), data.get() + bytes.size};
}

std::vector<std::uint16_t> depth_units(std::span<const float> depth, double units_per_meter, std::uint16_t none) {
  std::vector<std::uint16_t> units(depth.size());
  std::transform(depth.begin(), depth.end(), units.begin(), [&](float meters) {
    const double value = std::round(static_cast<double>(meters) * units_per_meter);
    return value < 1 || value > 65535 ? none : static_cast<std::uint16_t>(value);
  });
  return units;
}

void write_png(const std::filesystem::path& file, int width, int height, std::span<const std::uint8_t> rgb) {
  if (rgb.size() != std::size_t{3} * static_cast<std::size_t>(width) * static_cast<std::size_t>(height))
    throw std::logic_error(file.string() + ": does not have three bytes per pixel");
  write_whole(file, encode_png(cv::Mat(height, width, CV_8UC3, const_cast<std::uint8_t*>(rgb.data())), 6));
}

std::vector<std::uint32_t> color_pixels(const cv::Mat& rgba) {
  const auto* data = rgba.ptr<std::uint32_t>();
  return {data, data + rgba.total()};
}

}  // namespace cairn
