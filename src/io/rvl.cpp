// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/rvl.hpp"

#include <stdexcept>

namespace cairn {
namespace {

/// Variable-length numbers in groups of four bits: three data bits, lowest first, and a continuation bit. Little-endian
/// 32-bit words hold eight groups, the first in the highest bits.
class Pieces {
 public:
  explicit Pieces(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
  std::uint32_t number() {
    std::uint32_t value = 0;
    for (int bits = 0; bits < 30; bits += 3) {
      const std::uint32_t piece = next();
      value |= (piece & 7) << bits;
      if ((piece & 8) == 0) return value;
    }
    throw std::runtime_error("its RVL data are damaged");
  }

 private:
  std::uint32_t next() {
    const std::size_t byte = at_ / 8 * 4 + (3 - at_ % 8 / 2);
    if (byte >= bytes_.size()) throw std::runtime_error("its RVL data are cut off");
    return bytes_[byte] >> (at_++ % 2 == 0 ? 4 : 0) & 15;
  }
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
};

}  // namespace

std::vector<std::uint16_t> unpacked_rvl(std::span<const std::uint8_t> packed, std::size_t pixels) {
  std::vector<std::uint16_t> values;
  values.reserve(pixels);
  Pieces pieces(packed);
  std::uint32_t value = 0;
  const auto count = [&] {
    const std::size_t told = pieces.number();
    if (told > pixels - values.size()) throw std::runtime_error("its RVL data hold more pixels than the image");
    return told;
  };
  while (values.size() < pixels) {
    values.resize(values.size() + count());
    for (std::size_t left = count(); left > 0; --left) {
      const std::uint32_t step = pieces.number();
      value += step >> 1 ^ -(step & 1);  // 0, -1, 1, -2, ...
      values.push_back(static_cast<std::uint16_t>(value));
    }
  }
  return values;
}

}  // namespace cairn
