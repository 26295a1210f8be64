// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Handmade files with claims beyond their data; no library writes them.
#pragma once
#include <zlib.h>

#include <array>
#include <cstdint>
#include <string>

namespace cairn {

constexpr int kDeep = 100'000;  // levels, enough to exhaust the stack of a recursive parser

inline std::string nested(int levels = kDeep) {
  return std::string(static_cast<std::size_t>(levels), '[') + std::string(static_cast<std::size_t>(levels), ']');
}

inline std::string big_endian(std::uint32_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift);
  return bytes;
}

/// PNG of black pixels; 1-bit gray takes a byte for 8000 pixels.
inline std::string black_png(std::uint32_t width, std::uint32_t height, int bits = 1, int color_type = 0) {
  const auto chunk = [](const std::string& kind, const std::string& data) {
    const std::string body = kind + data;
    const auto sum = crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()));
    return big_endian(static_cast<std::uint32_t>(data.size())) + body + big_endian(static_cast<std::uint32_t>(sum));
  };
  const int channels = color_type == 2 ? 3 : 1;
  const std::string row(1 + (std::size_t{width} * static_cast<std::size_t>(bits * channels) + 7) / 8, '\0');
  z_stream stream{};
  deflateInit(&stream, 9);
  std::string packed;
  std::array<char, 65536> out{};
  for (std::uint32_t y = 0; y < height; ++y) {
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(row.data()));
    stream.avail_in = static_cast<uInt>(row.size());
    const int flush = y + 1 == height ? Z_FINISH : Z_NO_FLUSH;
    do {
      stream.next_out = reinterpret_cast<Bytef*>(out.data());
      stream.avail_out = static_cast<uInt>(out.size());
      deflate(&stream, flush);
      packed.append(out.data(), out.size() - stream.avail_out);
    } while (stream.avail_out == 0);
  }
  deflateEnd(&stream);
  const std::string kind{static_cast<char>(bits), static_cast<char>(color_type), 0, 0, 0};
  return "\x89PNG\r\n\x1a\n" + chunk("IHDR", big_endian(width) + big_endian(height) + kind) + chunk("IDAT", packed) +
         chunk("IEND", "");
}

/// Progressive JPEG of gray blocks with `scans` passes over all blocks.
inline std::string jpeg_of_scans(std::uint16_t width, std::uint16_t height, int scans) {
  const auto two = [](int value) { return std::string{static_cast<char>(value >> 8), static_cast<char>(value)}; };
  const auto marker = [&](int kind, const std::string& data) {
    return std::string{'\xff', static_cast<char>(kind)} + two(static_cast<int>(data.size()) + 2) + data;
  };
  std::string table(17, '\0');  // Huffman table: a single 1-bit code, for zero
  table[1] = 1;
  std::string bytes = "\xff\xd8" + marker(0xdb, std::string(1, '\0') + std::string(64, '\1')) +
                      marker(0xc2, std::string("\x08", 1) + two(height) + two(width) + std::string("\1\1\x11\0", 4));
  bytes += marker(0xc4, std::string(1, '\0') + table.substr(1) + '\0');
  bytes += marker(0xc4, std::string(1, '\x10') + table.substr(1) + '\xe0');  // AC: end of a band of 2^14 blocks
  for (int i = 0; i < scans; ++i) {
    const bool first = i == 0;
    bytes += marker(0xda, std::string("\1\1\0", 3) + (first ? std::string("\0\0\0", 3) : std::string("\1\x3f\0", 3)));
    bytes += std::string(first ? (std::size_t{width} * height / 64 + 7) / 8 : 64, '\0');
  }
  return bytes + "\xff\xd9";
}

}  // namespace cairn
