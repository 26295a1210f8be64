// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// part.json, a segment of a plan: a range of frames of a recording.
#include "fuzz.hpp"
#include "io/recording_segment.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  (void)fuzz::file_of("part.json", fuzz::text_of(data, size));
  fuzz::expect_value_or_plain_error([&] {
    const auto part = read_segment(fuzz::folder());
    if (part && (part->begin < 0 || part->end <= part->begin || part->recording.empty())) std::abort();
  });
  return 0;
}
