// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "fuzz.hpp"
#include "io/datasets/azure_kinect.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file = fuzz::file_of("a.mkv", fuzz::text_of(data, size));
  fuzz::expect_value_or_plain_error([&] {
    const auto source = open_azure_kinect(file);
    for (int i = 0; i < 8; ++i)
      if (const auto frame = source->next()) {
        fuzz::expect_value_or_plain_error([&] {
          if (frame->problem) throw std::runtime_error(*frame->problem);
        });
        fuzz::touch(frame->depth);
        fuzz::touch(frame->color);
        if (frame->acceleration && !frame->acceleration->allFinite()) std::abort();
      }
    if (const auto cut = source->ended_early()) throw std::runtime_error(*cut);
  });
  return 0;
}
