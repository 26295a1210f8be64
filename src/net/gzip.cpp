// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "net/gzip.hpp"

#include <zlib.h>

#include <stdexcept>

namespace cairn {

std::string gzip(std::string_view bytes) {
  constexpr int kGzip = 16 + MAX_WBITS, kMemory = 8;
  z_stream stream{};
  if (deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, kGzip, kMemory, Z_DEFAULT_STRATEGY) != Z_OK)
    throw std::runtime_error("not enough memory to compress a response");
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
  if (state != Z_STREAM_END) throw std::runtime_error("the response cannot be compressed");
  packed.resize(made);
  return packed;
}

}  // namespace cairn
