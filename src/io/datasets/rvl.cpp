// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/datasets/rvl.hpp"

#include <stdexcept>

namespace cairn {
namespace {

/// Variable-length numbers in groups of four bits: three data bits, lowest first, and a continuation bit. Little-endian
/// 32-bit words hold eight groups, the first in the highest bits.
class NibbleReader {
 public:
  explicit NibbleReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
  std::uint32_t number() {
    std::uint32_t value = 0;
    for (int bits = 0; bits < 30; bits += 3) {
      const std::uint32_t nibble = next();
      value |= (nibble & 7) << bits;
      if ((nibble & 8) == 0) return value;
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

std::vector<std::uint16_t> decode_rvl(std::span<const std::uint8_t> packed, std::size_t pixels) {
  std::vector<std::uint16_t> values;
  values.reserve(pixels);
  NibbleReader reader(packed);
  std::uint32_t value = 0;
  const auto count = [&] {
    const std::size_t number = reader.number();
    if (number > pixels - values.size()) throw std::runtime_error("its RVL data have more pixels than the image");
    return number;
  };
  while (values.size() < pixels) {
    values.resize(values.size() + count());
    for (std::size_t left = count(); left > 0; --left) {
      const std::uint32_t step = reader.number();
      value += step >> 1 ^ -(step & 1);  // 0, -1, 1, -2, ...
      values.push_back(static_cast<std::uint16_t>(value));
    }
  }
  return values;
}

}  // namespace cairn
