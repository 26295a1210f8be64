// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Checks of an .oni file before OpenNI2, which is not fuzzed itself.
#include "fuzz.hpp"
#include "io/sensors/oni_file.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file = fuzz::file_of("a.oni", fuzz::text_of(data, size));
  fuzz::expect_value_or_plain_error([&] { check_oni(file); });
  return 0;
}
