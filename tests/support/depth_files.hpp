// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Depth image files as written by NumPy and other programs.
#pragma once
#include <fmt/format.h>

#include <cstdint>
#include <cstring>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

namespace cairn {

/// An .npy file; default: the pixels' own shape.
inline std::string npy(const std::string& kind, const cv::Mat& pixels, std::string shape = "", int version = 1,
                       bool fortran = false) {
  if (shape.empty()) shape = fmt::format("({}, {})", pixels.rows, pixels.cols);
  std::string header =
      fmt::format("{{'descr': '{}', 'fortran_order': {}, 'shape': {}, }}", kind, fortran ? "True" : "False", shape);
  const std::size_t before = version == 1 ? 10 : 12;
  header.resize((before + header.size() + 64) / 64 * 64 - before - 1, ' ');
  header += '\n';
  std::string bytes = "\x93NUMPY";
  bytes += static_cast<char>(version);
  bytes += '\0';
  for (std::size_t i = 0; i < before - 8; ++i) bytes += static_cast<char>(header.size() >> 8 * i);
  return bytes + header + std::string(reinterpret_cast<const char*>(pixels.data), pixels.total() * pixels.elemSize());
}

struct TiffKind {
  bool big_endian = false;
  int tile = 0;                                // pixels a side; 0: one strip
  int width = 0, height = 0, compression = 1;  // values in the header in place of the true ones
};
/// Uncompressed TIFF of 16-bit integers or floats.
inline std::string tiff(const cv::Mat& pixels, const TiffKind& kind = {}) {
  const auto number = [&](std::uint32_t value, int size) {
    std::string text;
    for (int i = 0; i < size; ++i) text += static_cast<char>(value >> 8 * (kind.big_endian ? size - 1 - i : i));
    return text;
  };
  std::string bytes = kind.big_endian ? "MM" : "II";
  bytes += number(42, 2) + number(8, 4);
  const int side = kind.tile, real_side = std::min(side, 64);
  const int across = side > 0 ? (pixels.cols + real_side - 1) / real_side : 1,
            down = side > 0 ? (pixels.rows + real_side - 1) / real_side : 1;
  const int w = side > 0 ? real_side : pixels.cols, h = side > 0 ? real_side : pixels.rows;
  const auto size = static_cast<int>(pixels.elemSize());
  const std::uint32_t bytes_each = static_cast<std::uint32_t>(w * h * size);
  std::vector<std::pair<std::uint32_t, std::vector<std::uint32_t>>> tags{
      {256, {static_cast<std::uint32_t>(kind.width > 0 ? kind.width : pixels.cols)}},
      {257, {static_cast<std::uint32_t>(kind.height > 0 ? kind.height : pixels.rows)}},
      {258, {static_cast<std::uint32_t>(8 * size)}},
      {259, {static_cast<std::uint32_t>(kind.compression)}},
      {262, {1}}};
  const std::uint32_t count = static_cast<std::uint32_t>(across * down);
  const std::uint32_t lists = 8 + 2 + 12 * (side > 0 ? 11 : 10) + 4, data = lists + 8 * count;
  std::vector<std::uint32_t> offsets, sizes(count, bytes_each);
  for (std::uint32_t i = 0; i < count; ++i) offsets.push_back(data + i * bytes_each);
  if (side == 0) tags.push_back({273, offsets});
  tags.push_back({277, {1}});
  if (side == 0) tags.push_back({278, {static_cast<std::uint32_t>(h)}});
  if (side == 0) tags.push_back({279, sizes});
  if (side > 0) {
    tags.push_back({322, {static_cast<std::uint32_t>(side)}});
    tags.push_back({323, {static_cast<std::uint32_t>(side)}});
    tags.push_back({324, offsets});
    tags.push_back({325, sizes});
  }
  tags.push_back({339, {pixels.depth() == CV_32F ? 3u : 1u}});
  bytes += number(static_cast<std::uint32_t>(tags.size()), 2);
  std::string after;
  for (const auto& [tag, values] : tags) {
    bytes += number(tag, 2) + number(4, 2) + number(static_cast<std::uint32_t>(values.size()), 4);
    if (values.size() == 1) {
      bytes += number(values[0], 4);
    } else {
      bytes += number(lists + static_cast<std::uint32_t>(after.size()), 4);
      for (const std::uint32_t value : values) after += number(value, 4);
    }
  }
  bytes += number(0, 4);
  bytes.resize(lists, '\0');
  bytes += after;
  bytes.resize(data, '\0');
  for (int ty = 0; ty < down; ++ty)
    for (int tx = 0; tx < across; ++tx)
      for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x) {
          const int column = tx * w + x, row = ty * h + y;
          std::uint32_t value = 0;
          if (column < pixels.cols && row < pixels.rows)
            std::memcpy(&value, pixels.ptr(row) + column * size, static_cast<std::size_t>(size));
          bytes += number(value, size);
        }
  return bytes;
}

/// Uncompressed OpenEXR file of scan lines: floats (CV_32F) or halves (CV_16F) by channel name, in alphabetic order.
inline std::string exr(const std::vector<std::pair<std::string, cv::Mat>>& channels) {
  const cv::Mat& first = channels.at(0).second;
  const auto raw = [](auto value) { return std::string(reinterpret_cast<const char*>(&value), sizeof value); };
  std::string bytes("\x76\x2f\x31\x01\x02\0\0\0", 8), list;
  const auto attribute = [&](const std::string& name, const std::string& type, const std::string& value) {
    bytes += name + '\0' + type + '\0' + raw(static_cast<std::uint32_t>(value.size())) + value;
  };
  for (const auto& [name, pixels] : channels)
    list += name + '\0' + raw(pixels.depth() == CV_16F ? 1 : 2) + std::string(4, '\0') + raw(1) + raw(1);
  const std::string window = raw(0) + raw(0) + raw(first.cols - 1) + raw(first.rows - 1);
  attribute("channels", "chlist", list + '\0');
  attribute("compression", "compression", std::string(1, '\0'));
  attribute("dataWindow", "box2i", window);
  attribute("displayWindow", "box2i", window);
  attribute("lineOrder", "lineOrder", std::string(1, '\0'));
  attribute("pixelAspectRatio", "float", raw(1.0f));
  attribute("screenWindowCenter", "v2f", raw(0.0f) + raw(0.0f));
  attribute("screenWindowWidth", "float", raw(1.0f));
  bytes += '\0';
  std::string lines;
  const std::size_t begin = bytes.size() + 8 * static_cast<std::size_t>(first.rows);
  for (int y = 0; y < first.rows; ++y) {
    bytes += raw(static_cast<std::uint64_t>(begin + lines.size()));
    std::string line;
    for (const auto& [name, pixels] : channels)
      line.append(reinterpret_cast<const char*>(pixels.ptr(y)),
                  static_cast<std::size_t>(pixels.cols) * pixels.elemSize());
    lines += raw(y) + raw(static_cast<std::uint32_t>(line.size())) + line;
  }
  return bytes + lines;
}

}  // namespace cairn
