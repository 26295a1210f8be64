// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/depth_image.hpp"

#include <fmt/format.h>
#include <tiffio.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <cstring>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "base/checked_count.hpp"
#include "base/exr_image.hpp"
#include "base/image_file.hpp"
#include "base/words.hpp"

namespace cairn {
namespace {

static_assert(std::endian::native == std::endian::little);  // NPY data are copied without byte swapping

constexpr int kMinTileLimit = 512;                      // pixels, allowed for any image size
constexpr std::uint64_t kMaxTiffRatio = 1500;           // maximum compression ratio: LZW's longest string
constexpr std::uint64_t kFreeSize = 1 << 16;            // bytes allowed for any file
constexpr tmsize_t kMaxAllocation = tmsize_t{1} << 28;  // maximum bytes of one libtiff allocation
constexpr const char* kExpectedBits = "expected 16 bits, or floats of 32 or 64 bits";

/// Depth channel of a depth image saved as a color picture. Throws if the first three channels differ.
cv::Mat one_channel(const cv::Mat& image) {
  if (image.channels() == 1) return image;
  cv::Mat first, other;
  cv::extractChannel(image, first, 0);
  for (const int channel : {1, 2}) {
    cv::extractChannel(image, other, channel);
    if (std::memcmp(first.data, other.data, first.total() * first.elemSize()) != 0)
      throw std::runtime_error(
          fmt::format("has {} different channels of {} bits; depth has one: write its channel as a 16-bit image",
                      image.channels(), 8 * image.elemSize1()));
  }
  return first;
}

/// Converts 64-bit floats to 32 bits.
cv::Mat to_float32(cv::Mat image) {
  if (image.depth() == CV_64F) image.convertTo(image, CV_32F);
  return image;
}

// TIFF

struct TiffBytes {
  std::span<const std::uint8_t> all;
  std::uint64_t at = 0;
};
TiffBytes& bytes_of(thandle_t handle) { return *static_cast<TiffBytes*>(handle); }
tmsize_t read_tiff(thandle_t handle, void* to, tmsize_t count) {
  TiffBytes& bytes = bytes_of(handle);
  const std::uint64_t left = bytes.all.size() - std::min<std::uint64_t>(bytes.at, bytes.all.size());
  const auto taken =
      static_cast<std::size_t>(std::min<std::uint64_t>(left, count > 0 ? static_cast<std::uint64_t>(count) : 0));
  if (taken > 0) std::memcpy(to, bytes.all.data() + bytes.at, taken);
  bytes.at += taken;
  return static_cast<tmsize_t>(taken);
}
tmsize_t write_tiff(thandle_t, void*, tmsize_t) { return 0; }
toff_t seek_tiff(thandle_t handle, toff_t offset, int whence) {
  TiffBytes& bytes = bytes_of(handle);
  const std::uint64_t from = whence == SEEK_CUR ? bytes.at : whence == SEEK_END ? bytes.all.size() : 0;
  return bytes.at = from + offset;
}
int close_tiff(thandle_t) { return 0; }
toff_t size_of_tiff(thandle_t handle) { return bytes_of(handle).all.size(); }
int ignore_message(TIFF*, void*, const char*, const char*, va_list) { return 1; }

using Tiff = std::unique_ptr<TIFF, void (*)(TIFF*)>;

Tiff open_tiff(TiffBytes& bytes) {
  const std::unique_ptr<TIFFOpenOptions, void (*)(TIFFOpenOptions*)> options(TIFFOpenOptionsAlloc(),
                                                                             TIFFOpenOptionsFree);
  TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), kMaxAllocation);
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), ignore_message, nullptr);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), ignore_message, nullptr);
  return {TIFFClientOpenExt("depth", "rm", &bytes, read_tiff, write_tiff, seek_tiff, close_tiff, size_of_tiff, nullptr,
                            nullptr, options.get()),
          TIFFClose};
}

template <class T>
T tag(TIFF* tiff, std::uint32_t name) {
  T value{};
  TIFFGetFieldDefaulted(tiff, name, &value);
  return value;
}

std::runtime_error unsupported(const std::string& why) { return std::runtime_error("is a TIFF " + why); }

void check_compression(TIFF* tiff) {
  const auto compression = tag<std::uint16_t>(tiff, TIFFTAG_COMPRESSION);
  if (tag<std::uint16_t>(tiff, TIFFTAG_SAMPLESPERPIXEL) > 1 &&
      tag<std::uint16_t>(tiff, TIFFTAG_PLANARCONFIG) != PLANARCONFIG_CONTIG)
    throw unsupported("with a plane per channel; write it with interleaved channels");
  constexpr std::array kCompressions{COMPRESSION_NONE, COMPRESSION_LZW, COMPRESSION_ADOBE_DEFLATE, COMPRESSION_DEFLATE,
                                     COMPRESSION_PACKBITS};
  if (std::find(kCompressions.begin(), kCompressions.end(), compression) == kCompressions.end())
    throw unsupported(fmt::format("compressed by method {}; expected none, LZW, Deflate or PackBits", compression));
}

/// cv::Mat type of a depth TIFF.
int type_of(TIFF* tiff) {
  const auto bits = tag<std::uint16_t>(tiff, TIFFTAG_BITSPERSAMPLE),
             samples = tag<std::uint16_t>(tiff, TIFFTAG_SAMPLESPERPIXEL),
             format = tag<std::uint16_t>(tiff, TIFFTAG_SAMPLEFORMAT);
  const bool is_float = format == SAMPLEFORMAT_IEEEFP;
  if (samples != 1 && samples != 3) throw unsupported(fmt::format("of {} channels; depth has one", samples));
  if (!(is_float ? bits == 32 || bits == 64 : bits == 16))
    throw unsupported(fmt::format("of {} with {} bits; {}", is_float ? "floats" : "integers", bits, kExpectedBits));
  check_compression(tiff);
  return CV_MAKETYPE(is_float ? (bits == 32 ? CV_32F : CV_64F) : CV_16U, samples);
}

/// cv::Mat type of a color TIFF.
int type_of_color(TIFF* tiff) {
  const auto bits = tag<std::uint16_t>(tiff, TIFFTAG_BITSPERSAMPLE),
             samples = tag<std::uint16_t>(tiff, TIFFTAG_SAMPLESPERPIXEL),
             kind = tag<std::uint16_t>(tiff, TIFFTAG_PHOTOMETRIC);
  if (bits != 8 || (samples != 1 && samples != 3 && samples != 4) ||
      kind != (samples == 1 ? PHOTOMETRIC_MINISBLACK : PHOTOMETRIC_RGB))
    throw unsupported(
        fmt::format("of {} channels with {} bits; color has 8-bit gray or R, G, B: write PNG or JPEG", samples, bits));
  check_compression(tiff);
  return CV_MAKETYPE(CV_8U, samples);
}

/// Returns true if all rows were read. Strips contain complete rows.
bool read_strips(TIFF* tiff, cv::Mat& image) {
  const auto height = static_cast<std::uint32_t>(image.rows);
  const std::uint32_t rows = std::min(tag<std::uint32_t>(tiff, TIFFTAG_ROWSPERSTRIP), height);
  if (rows == 0) return false;
  for (std::uint32_t row = 0, strip = 0; row < height; row += rows, ++strip) {
    const auto bytes = static_cast<tmsize_t>(std::min(rows, height - row) * image.step[0]);
    if (TIFFReadEncodedStrip(tiff, strip, image.ptr(static_cast<int>(row)), bytes) != bytes) return false;
  }
  return true;
}

bool read_tiles(TIFF* tiff, cv::Mat& image) {
  const auto width = tag<std::uint32_t>(tiff, TIFFTAG_TILEWIDTH), height = tag<std::uint32_t>(tiff, TIFFTAG_TILELENGTH);
  const auto max_side = static_cast<std::uint32_t>(std::max({image.cols, image.rows, kMinTileLimit}));
  if (width == 0 || height == 0 || width > max_side || height > max_side) return false;
  cv::Mat tile(static_cast<int>(height), static_cast<int>(width), image.type());
  const auto bytes = static_cast<tmsize_t>(tile.total() * tile.elemSize());
  if (TIFFTileSize(tiff) != bytes) return false;
  for (int y = 0; y < image.rows; y += tile.rows)
    for (int x = 0; x < image.cols; x += tile.cols) {
      if (TIFFReadTile(tiff, tile.data, static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y), 0, 0) != bytes)
        return false;
      const cv::Rect inside(0, 0, std::min(tile.cols, image.cols - x), std::min(tile.rows, image.rows - y));
      tile(inside).copyTo(image(inside + cv::Point(x, y)));
    }
  return true;
}

cv::Mat decode_tiff(std::span<const std::uint8_t> all, const ImageBound& bound, int (*type_of)(TIFF*)) {
  TiffBytes bytes{all};
  const Tiff tiff = open_tiff(bytes);
  if (!tiff) throw std::runtime_error("is not a readable TIFF: damaged or cut off");
  const auto width = tag<std::uint32_t>(tiff.get(), TIFFTAG_IMAGEWIDTH),
             height = tag<std::uint32_t>(tiff.get(), TIFFTAG_IMAGELENGTH);
  check_image_size(width, height, bound);
  const int type = type_of(tiff.get());
  if (product(width, height, CV_ELEM_SIZE(type)) > product(all.size(), kMaxTiffRatio) + kFreeSize)
    throw std::runtime_error("the file is cut off");
  cv::Mat image(static_cast<int>(height), static_cast<int>(width), type);
  if (!(TIFFIsTiled(tiff.get()) != 0 ? read_tiles(tiff.get(), image) : read_strips(tiff.get(), image)))
    throw std::runtime_error("the file is cut off or damaged");
  return image;
}

// NPY: numpy.lib.format

/// Text after a key of the header's dictionary.
std::string_view value_of(std::string_view header, std::string_view key) {
  const std::size_t at = header.find(fmt::format("'{}'", key));
  if (at == header.npos) return {};
  header.remove_prefix(at + key.size() + 2);
  header.remove_prefix(std::min(header.size(), header.find_first_not_of(": ")));
  return header;
}

/// Parses (480, 640), with optional dimensions of size 1.
std::array<std::uint32_t, 2> shape_of(std::string_view header) {
  std::string_view text = value_of(header, "shape");
  text = text.substr(0, text.find(')'));
  std::vector<std::uint32_t> shape;
  for (std::size_t at = 0; (at = text.find_first_of("0123456789")) != text.npos;) {
    text.remove_prefix(at);
    const std::size_t end = std::min(text.size(), text.find_first_not_of("0123456789"));
    const auto number = number_in<std::uint32_t>(text.substr(0, end));
    if (!number || shape.size() > 3) throw std::runtime_error("is not a readable NPY file: its shape is damaged");
    if (*number != 1) shape.push_back(*number);
    text.remove_prefix(end);
  }
  if (shape.size() != 2)
    throw std::runtime_error(
        fmt::format("is an NPY array of {} dimensions; depth has two: (height, width)", shape.size()));
  return {shape[0], shape[1]};
}

cv::Mat decode_npy(std::span<const std::uint8_t> bytes, const ImageBound& bound) {
  const auto damaged = [] { return std::runtime_error("is not a readable NPY file: damaged or cut off"); };
  if (bytes.size() < 12) throw damaged();
  const bool is_version_1 = bytes[6] == 1;  // version 1: header of at most 64 KiB
  std::size_t begin = is_version_1 ? 10 : 12, length = bytes[8] | std::size_t{bytes[9]} << 8;
  if (!is_version_1) length |= std::size_t{bytes[10]} << 16 | std::size_t{bytes[11]} << 24;
  if (length > bytes.size() - begin) throw damaged();
  const std::string_view header(reinterpret_cast<const char*>(bytes.data()) + begin, length);
  std::string_view kind = value_of(header, "descr");
  kind = kind.starts_with('\'') ? kind.substr(1, kind.substr(1).find('\'')) : "a structure";
  constexpr std::pair<std::string_view, int> kTypes[] = {{"<u2", CV_16UC1}, {"<f4", CV_32FC1}, {"<f8", CV_64FC1}};
  const auto* const type =
      std::find_if(std::begin(kTypes), std::end(kTypes), [&](const auto& t) { return t.first == kind; });
  if (type == std::end(kTypes))
    throw std::runtime_error(
        fmt::format("is an NPY array of '{}'; expected uint16, float32 or float64, little-endian: save "
                    "depth.astype('<u2') or '<f4'",
                    shown(kind)));
  if (!value_of(header, "fortran_order").starts_with("False"))
    throw std::runtime_error("is a column-major NPY array; save np.ascontiguousarray(depth)");
  const auto [height, width] = shape_of(header);
  check_image_size(width, height, bound);
  const std::uint64_t size = product(width, height, CV_ELEM_SIZE(type->second));
  if (size > bytes.size() - begin - length) throw std::runtime_error("the file is cut off");
  cv::Mat image(static_cast<int>(height), static_cast<int>(width), type->second);
  std::memcpy(image.data, bytes.data() + begin + length, size);
  return to_float32(image);
}

// PGM, binary: https://netpbm.sourceforge.net/doc/pgm.html

cv::Mat decode_pgm(std::span<const std::uint8_t> bytes, const ImageBound& bound) {
  std::size_t at = 2;
  const auto number = [&]() -> std::uint32_t {
    while (at < bytes.size() && (std::isspace(bytes[at]) != 0 || bytes[at] == '#'))
      if (bytes[at++] == '#')
        while (at < bytes.size() && bytes[at] != '\n') ++at;
    const auto* text = reinterpret_cast<const char*>(bytes.data());
    const std::size_t begin = at;
    while (at < bytes.size() && std::isdigit(bytes[at]) != 0) ++at;
    return number_in<std::uint32_t>({text + begin, at - begin}).value_or(0);
  };
  const std::uint32_t width = number(), height = number(), max_value = number();
  check_image_size(width, height, bound);
  if (max_value < 256 || max_value > 65535)
    throw std::runtime_error(fmt::format("is a PGM with values up to {}; depth needs 16 bits", max_value));
  if (++at > bytes.size() || product(2, width, height) > bytes.size() - at)
    throw std::runtime_error("the file is cut off");
  cv::Mat image(static_cast<int>(height), static_cast<int>(width), CV_16UC1);
  for (std::size_t i = 0; i < image.total(); ++i, at += 2)
    image.ptr<std::uint16_t>()[i] = static_cast<std::uint16_t>(bytes[at] << 8 | bytes[at + 1]);
  return image;
}

}  // namespace

cv::Mat decode_depth(std::span<const std::uint8_t> bytes, const ImageBound& bound) {
  using namespace std::string_view_literals;
  const std::string_view all(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (all.empty()) throw std::runtime_error("is empty; copy it again");
  if (is_tiff(bytes)) return to_float32(one_channel(decode_tiff(bytes, bound, type_of)));
  if (all.starts_with("\x93NUMPY")) return decode_npy(bytes, bound);
  if (all.starts_with(kExrMagic)) {
    const int max_side = bound.size.empty() ? bound.max_side : std::max(bound.size.width, bound.size.height);
    return decode_exr(bytes, static_cast<std::uint32_t>(max_side));
  }
  if (all.starts_with("P5")) return decode_pgm(bytes, bound);
  const cv::Mat image = decode_image(bytes, Pixels::as_stored, bound);
  return image.depth() == CV_16U ? one_channel(image) : image;
}

bool is_tiff(std::span<const std::uint8_t> bytes) {
  using namespace std::string_view_literals;
  const std::string_view all(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return all.starts_with("II*\0"sv) || all.starts_with("MM\0*"sv) || all.starts_with("II+\0"sv) ||
         all.starts_with("MM\0+"sv);
}

bool is_depth_tiff(std::span<const std::uint8_t> all) {
  TiffBytes bytes{all};
  const Tiff tiff = open_tiff(bytes);
  return tiff && tag<std::uint16_t>(tiff.get(), TIFFTAG_BITSPERSAMPLE) != 8;
}

cv::Mat decode_color_tiff(std::span<const std::uint8_t> bytes, const ImageBound& bound) {
  cv::Mat image = decode_tiff(bytes, bound, type_of_color), rgba;
  if (image.channels() == 4) return image;
  cv::cvtColor(image, rgba, image.channels() == 1 ? cv::COLOR_GRAY2RGBA : cv::COLOR_RGB2RGBA);
  return rgba;
}

}  // namespace cairn
