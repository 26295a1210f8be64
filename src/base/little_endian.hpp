// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

namespace cairn {

/// Number in four little-endian bytes.
inline std::uint32_t little_endian_uint32(std::span<const std::uint8_t, 4> bytes) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) value |= static_cast<std::uint32_t>(bytes[i]) << (8 * i);
  return value;
}

}  // namespace cairn
