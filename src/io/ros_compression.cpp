// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/ros_compression.hpp"

#include <bzlib.h>
#include <fmt/format.h>
#include <lz4frame.h>
#include <zstd.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <stdexcept>
#include <utility>

#include "base/checked_count.hpp"
#include "base/words.hpp"

namespace cairn {
namespace {

constexpr std::size_t kStep = 1 << 20;    // bytes added per growth step: memory follows the data, not the declared size
constexpr std::size_t kMost = 256 << 20;  // bytes
// Maximum compression ratio beyond the first kAnySize bytes (a 4K image in a single color); images without noise reach
// 200.
constexpr std::size_t kMostPacked = 1000, kAnySize = 32 << 20;

/// Bytes consumed and produced by a library call.
struct Moved {
  std::size_t in, out;
  bool at_end;
};

using Bytes = std::vector<std::uint8_t>;

/// Calls `move(from, to)` until it reports the end. `move` throws if it cannot continue. `all`: buffer to reuse.
template <class Move>
Bytes unpack(std::span<const std::uint8_t> packed, std::size_t most, Bytes all, const Move& move) {
  all.resize(std::min(most, all.size()));
  std::size_t filled = 0;
  for (;;) {
    if (filled == all.size()) {
      if (all.size() >= most) throw std::runtime_error(fmt::format("holds more than {} bytes once unpacked", most - 1));
      all.resize(std::min(most, all.size() + std::max(kStep, all.size() / 2)));
    }
    const Moved moved = move(packed, std::span(all).subspan(filled));
    packed = packed.subspan(moved.in);
    filled += moved.out;
    if (moved.at_end) break;
    if (moved.in == 0 && moved.out == 0) throw std::runtime_error("is cut off");
  }
  all.resize(filled);
  return all;
}

Bytes unpack_bz2(std::span<const std::uint8_t> packed, std::size_t most, Bytes memory) {
  bz_stream stream{};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) throw std::runtime_error("cannot be unpacked: out of memory");
  const auto end = [](bz_stream* s) { BZ2_bzDecompressEnd(s); };
  const std::unique_ptr<bz_stream, decltype(end)> owned(&stream, end);
  return unpack(packed, most, std::move(memory), [&](std::span<const std::uint8_t> from, std::span<std::uint8_t> to) {
    constexpr std::size_t kWhole = std::numeric_limits<int>::max();
    const auto in = static_cast<unsigned>(std::min(from.size(), kWhole));
    const auto out = static_cast<unsigned>(std::min(to.size(), kWhole));
    stream.next_in = const_cast<char*>(reinterpret_cast<const char*>(from.data()));
    stream.avail_in = in;
    stream.next_out = reinterpret_cast<char*>(to.data());
    stream.avail_out = out;
    const int result = BZ2_bzDecompress(&stream);
    if (result != BZ_OK && result != BZ_STREAM_END) throw std::runtime_error("is no bzip2 data, or is damaged");
    return Moved{in - stream.avail_in, out - stream.avail_out, result == BZ_STREAM_END};
  });
}

Bytes unpack_lz4(std::span<const std::uint8_t> packed, std::size_t most, Bytes memory) {
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION)))
    throw std::runtime_error("cannot be unpacked: out of memory");
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> owned(context,
                                                                                   LZ4F_freeDecompressionContext);
  return unpack(packed, most, std::move(memory), [&](std::span<const std::uint8_t> from, std::span<std::uint8_t> to) {
    std::size_t in = from.size(), out = to.size();
    const std::size_t result = LZ4F_decompress(context, to.data(), &out, from.data(), &in, nullptr);
    if (LZ4F_isError(result)) throw std::runtime_error("is no LZ4 frame, or is damaged");
    return Moved{in, out, result == 0};
  });
}

Bytes unpack_zstd(std::span<const std::uint8_t> packed, std::size_t most, Bytes memory) {
  const std::unique_ptr<ZSTD_DStream, decltype(&ZSTD_freeDStream)> context(ZSTD_createDStream(), ZSTD_freeDStream);
  if (!context) throw std::runtime_error("cannot be unpacked: out of memory");
  return unpack(packed, most, std::move(memory), [&](std::span<const std::uint8_t> from, std::span<std::uint8_t> to) {
    ZSTD_inBuffer in{from.data(), from.size(), 0};
    ZSTD_outBuffer out{to.data(), to.size(), 0};
    const std::size_t result = ZSTD_decompressStream(context.get(), &out, &in);
    if (ZSTD_isError(result)) throw std::runtime_error("is no Zstandard data, or is damaged");
    return Moved{in.pos, out.pos, result == 0};
  });
}

}  // namespace

std::vector<std::uint8_t> unpacked(std::string_view kind, std::span<const std::uint8_t> packed,
                                   std::optional<std::uint64_t> promised, std::vector<std::uint8_t> memory) {
  if (kind != "bz2" && kind != "lz4" && kind != "zstd")
    throw std::runtime_error(fmt::format("is packed as '{}', known are bz2, lz4 and zstd", shown(kind)));
  const std::uint64_t plausible = product(packed.size(), kMostPacked) + kAnySize;
  const std::size_t most = std::min({std::uint64_t{kMost}, plausible, promised.value_or(kMost)}) + 1;
  if (promised) memory.reserve(most);  // address space alone; growth by copying takes 2.5 times the memory
  auto all = kind == "bz2"   ? unpack_bz2(packed, most, std::move(memory))
             : kind == "lz4" ? unpack_lz4(packed, most, std::move(memory))
                             : unpack_zstd(packed, most, std::move(memory));
  if (promised && all.size() != *promised)
    throw std::runtime_error(fmt::format("holds {} bytes once unpacked, told are {}", all.size(), *promised));
  return all;
}

std::vector<std::uint8_t> packed_by_zstd(std::span<const std::uint8_t> bytes) {
  std::vector<std::uint8_t> packed(ZSTD_compressBound(bytes.size()));
  const std::size_t size = ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), 1);
  if (ZSTD_isError(size)) throw std::runtime_error(fmt::format("cannot be packed: {}", ZSTD_getErrorName(size)));
  packed.resize(size);
  return packed;
}

}  // namespace cairn
