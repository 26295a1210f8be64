// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// ScanNet's .sens files.
#include "fuzz.hpp"
#include "io/datasets/sens.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file = fuzz::file_of("a.sens", fuzz::text_of(data, size));
  fuzz::expect_value_or_plain_error([&] {
    const auto source = open_sens(file);
    for (int i = 0; i < 4; ++i)
      if (const auto frame = source->next()) {
        fuzz::touch(frame->depth);
        fuzz::touch(frame->color);
      }
    for (const auto& pose : sens_truth(file))
      if (!pose.world_from_camera.matrix().allFinite()) std::abort();
  });
  return 0;
}
