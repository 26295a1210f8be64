// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/ros/ros_compression.hpp"

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

constexpr std::size_t kGrowthStep =
    1 << 20;  // bytes added per growth step: memory follows the data, not the declared size
constexpr std::size_t kMaxSize = 256 << 20;  // bytes
// Maximum compression ratio beyond the first kFreeSize bytes (a 4K image in a single color); images without noise reach
// 200.
constexpr std::size_t kMaxRatio = 1000, kFreeSize = 32 << 20;

/// Bytes consumed and produced by a library call.
struct Progress {
  std::size_t in, out;
  bool at_end;
};

using Bytes = std::vector<std::uint8_t>;

/// Calls `step(from, to)` until it reports the end. `step` throws if it cannot continue. `all`: buffer to reuse.
template <class Step>
Bytes unpack(std::span<const std::uint8_t> packed, std::size_t max_size, Bytes all, const Step& step) {
  all.resize(std::min(max_size, all.size()));
  std::size_t filled = 0;
  for (;;) {
    if (filled == all.size()) {
      if (all.size() >= max_size)
        throw std::runtime_error(fmt::format("has more than {} bytes when decompressed", max_size - 1));
      all.resize(std::min(max_size, all.size() + std::max(kGrowthStep, all.size() / 2)));
    }
    const Progress progress = step(packed, std::span(all).subspan(filled));
    packed = packed.subspan(progress.in);
    filled += progress.out;
    if (progress.at_end) break;
    if (progress.in == 0 && progress.out == 0) throw std::runtime_error("is cut off");
  }
  all.resize(filled);
  return all;
}

Bytes unpack_bz2(std::span<const std::uint8_t> packed, std::size_t max_size, Bytes buffer) {
  bz_stream stream{};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) throw std::runtime_error("cannot be decompressed: out of memory");
  const auto end = [](bz_stream* s) { BZ2_bzDecompressEnd(s); };
  const std::unique_ptr<bz_stream, decltype(end)> owned(&stream, end);
  return unpack(packed, max_size, std::move(buffer),
                [&](std::span<const std::uint8_t> from, std::span<std::uint8_t> to) {
                  constexpr std::size_t kMaxInt = std::numeric_limits<int>::max();
                  const auto in = static_cast<unsigned>(std::min(from.size(), kMaxInt));
                  const auto out = static_cast<unsigned>(std::min(to.size(), kMaxInt));
                  stream.next_in = const_cast<char*>(reinterpret_cast<const char*>(from.data()));
                  stream.avail_in = in;
                  stream.next_out = reinterpret_cast<char*>(to.data());
                  stream.avail_out = out;
                  const int result = BZ2_bzDecompress(&stream);
                  if (result != BZ_OK && result != BZ_STREAM_END)
                    throw std::runtime_error("is not bzip2 data, or is damaged");
                  return Progress{in - stream.avail_in, out - stream.avail_out, result == BZ_STREAM_END};
                });
}

Bytes unpack_lz4(std::span<const std::uint8_t> packed, std::size_t max_size, Bytes buffer) {
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION)))
    throw std::runtime_error("cannot be decompressed: out of memory");
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> owned(context,
                                                                                   LZ4F_freeDecompressionContext);
  return unpack(packed, max_size, std::move(buffer),
                [&](std::span<const std::uint8_t> from, std::span<std::uint8_t> to) {
                  std::size_t in = from.size(), out = to.size();
                  const std::size_t result = LZ4F_decompress(context, to.data(), &out, from.data(), &in, nullptr);
                  if (LZ4F_isError(result)) throw std::runtime_error("is not an LZ4 frame, or is damaged");
                  return Progress{in, out, result == 0};
                });
}

Bytes unpack_zstd(std::span<const std::uint8_t> packed, std::size_t max_size, Bytes buffer) {
  const std::unique_ptr<ZSTD_DStream, decltype(&ZSTD_freeDStream)> context(ZSTD_createDStream(), ZSTD_freeDStream);
  if (!context) throw std::runtime_error("cannot be decompressed: out of memory");
  return unpack(packed, max_size, std::move(buffer),
                [&](std::span<const std::uint8_t> from, std::span<std::uint8_t> to) {
                  ZSTD_inBuffer in{from.data(), from.size(), 0};
                  ZSTD_outBuffer out{to.data(), to.size(), 0};
                  const std::size_t result = ZSTD_decompressStream(context.get(), &out, &in);
                  if (ZSTD_isError(result)) throw std::runtime_error("is not Zstandard data, or is damaged");
                  return Progress{in.pos, out.pos, result == 0};
                });
}

}  // namespace

std::vector<std::uint8_t> unpacked(std::string_view kind, std::span<const std::uint8_t> packed,
                                   std::optional<std::uint64_t> expected_size, std::vector<std::uint8_t> buffer) {
  if (kind != "bz2" && kind != "lz4" && kind != "zstd")
    throw std::runtime_error(fmt::format("is compressed as '{}', expected bz2, lz4 or zstd", shown(kind)));
  const std::uint64_t plausible_size = product(packed.size(), kMaxRatio) + kFreeSize;
  const std::size_t max_size =
      std::min({std::uint64_t{kMaxSize}, plausible_size, expected_size.value_or(kMaxSize)}) + 1;
  if (expected_size) buffer.reserve(max_size);  // address space alone; growth by copying takes 2.5 times the memory
  auto all = kind == "bz2"   ? unpack_bz2(packed, max_size, std::move(buffer))
             : kind == "lz4" ? unpack_lz4(packed, max_size, std::move(buffer))
                             : unpack_zstd(packed, max_size, std::move(buffer));
  if (expected_size && all.size() != *expected_size)
    throw std::runtime_error(fmt::format("has {} bytes when decompressed, expected {}", all.size(), *expected_size));
  return all;
}

std::vector<std::uint8_t> compress_zstd(std::span<const std::uint8_t> bytes) {
  std::vector<std::uint8_t> packed(ZSTD_compressBound(bytes.size()));
  const std::size_t size = ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), 1);
  if (ZSTD_isError(size)) throw std::runtime_error(fmt::format("cannot be compressed: {}", ZSTD_getErrorName(size)));
  packed.resize(size);
  return packed;
}

}  // namespace cairn
