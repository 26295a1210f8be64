// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/options.hpp"
#include "fuzz.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file = fuzz::file_of("options.yaml", fuzz::text_of(data, size));
  fuzz::expect_value_or_plain_error([&] {
    Options options;
    read_options(file, options);
    check(options);
  });
  return 0;
}
