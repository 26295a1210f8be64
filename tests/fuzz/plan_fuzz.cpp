// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// plan.json of a map made of segments.
#include "cairn/building/project.hpp"
#include "fuzz.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  (void)fuzz::file_of("plan.json", fuzz::text_of(data, size));
  fuzz::expect_value_or_plain_error([&] {
    const Project plan = read_plan(fuzz::folder());
    for (const auto& part : plan.segments)
      if (part.recording >= plan.recordings.size() || part.begin < 0 || part.end <= part.begin ||
          part.end > plan.recordings[part.recording].frames)
        std::abort();
  });
  return 0;
}
