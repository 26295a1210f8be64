// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/gzip.hpp"

#include <zlib.h>

#include <algorithm>
#include <memory>
#include <stdexcept>

namespace cairn {
namespace {

constexpr int kGzip = 16 + MAX_WBITS;

}  // namespace

std::string gzip(std::string_view bytes) {
  constexpr int kMemory = 8;
  z_stream stream{};
  if (deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, kGzip, kMemory, Z_DEFAULT_STRATEGY) != Z_OK)
    throw std::runtime_error("not enough memory to compress");
  std::string packed(deflateBound(&stream, bytes.size()), '\0');
  // Processed in chunks, since zlib counts in 32 bits.
  constexpr std::size_t kChunkSize = 1 << 30;
  std::size_t at = 0, made = 0;
  int state = Z_OK;
  while (state == Z_OK) {
    const std::size_t in = std::min(kChunkSize, bytes.size() - at), out = std::min(kChunkSize, packed.size() - made);
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data() + at));
    stream.avail_in = static_cast<uInt>(in);
    stream.next_out = reinterpret_cast<Bytef*>(packed.data() + made);
    stream.avail_out = static_cast<uInt>(out);
    state = deflate(&stream, at + in == bytes.size() ? Z_FINISH : Z_NO_FLUSH);
    at += in - stream.avail_in;
    made += out - stream.avail_out;
  }
  deflateEnd(&stream);
  if (state != Z_STREAM_END) throw std::runtime_error("the bytes cannot be compressed");
  packed.resize(made);
  return packed;
}

std::vector<std::uint8_t> gunzip(std::span<const std::uint8_t> file, std::size_t max_size) {
  constexpr std::size_t kChunkSize = std::size_t{1} << 22;  // of input and output
  z_stream stream{};
  if (inflateInit2(&stream, kGzip) != Z_OK) throw std::runtime_error("not enough memory to decompress");
  const std::unique_ptr<z_stream, int (*)(z_stream*)> end(&stream, inflateEnd);
  std::vector<std::uint8_t> content;
  int state = Z_OK;
  while (state == Z_OK && content.size() < max_size) {
    const std::size_t made = content.size(), in = std::min(kChunkSize, file.size());
    content.resize(std::min(max_size, made + kChunkSize));
    stream.next_in = const_cast<Bytef*>(file.data());
    stream.avail_in = static_cast<uInt>(in);
    stream.next_out = content.data() + made;
    stream.avail_out = static_cast<uInt>(content.size() - made);
    state = inflate(&stream, Z_NO_FLUSH);
    file = file.subspan(in - stream.avail_in);
    content.resize(content.size() - stream.avail_out);
  }
  if (state != Z_OK && state != Z_STREAM_END && state != Z_BUF_ERROR)
    throw std::runtime_error("its gzip data is damaged");
  return content;
}

std::uint32_t crc32_of(std::string_view bytes, std::uint32_t before) {
  return static_cast<std::uint32_t>(
      crc32_z(before, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()));
}

}  // namespace cairn
