// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/depth_image.hpp"
#include "fuzz.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::expect_value_or_plain_error([&] {
    const cv::Mat image = decode_depth({data, size});
    for (int y = 0; y < image.rows; ++y)
      fuzz::touch(std::span(image.ptr(y), static_cast<std::size_t>(image.cols) * image.elemSize()));
  });
  return 0;
}
