// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// MCAP record kinds and sizes, shared by reader and writer. https://mcap.dev/spec
#pragma once
#include <cstdint>
#include <string_view>

namespace cairn::mcap {

constexpr std::string_view kMagic("\x89MCAP0\r\n", 8);  // at both ends of a file
constexpr std::uint64_t kHeadSize = 9;                  // bytes of a record's kind and length
constexpr std::uint64_t kFooterSize = 20;               // bytes, without the record head

enum Kind : std::uint8_t {
  kHeader = 1,
  kFooter = 2,
  kSchema = 3,
  kChannel = 4,
  kMessage = 5,
  kChunk = 6,
  kMessageIndex = 7,
  kChunkIndex = 8,
  kStatistics = 0x0b,
  kSummaryOffset = 0x0e,
  kDataEnd = 0x0f
};

}  // namespace cairn::mcap
