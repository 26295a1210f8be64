// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/esdf.hpp"
#include "fuzz.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file = fuzz::file_of("points.csv", fuzz::text_of(data, size));
  fuzz::expect_value_or_plain_error([&] {
    for (const Eigen::Vector3f& point : read_query_points(file)) fuzz::touch(point);
  });
  return 0;
}
