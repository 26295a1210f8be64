// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/image_file.hpp"
#include "fuzz.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  for (const Pixels pixels : {Pixels::as_stored, Pixels::rgb, Pixels::rgba})
    fuzz::expect_value_or_plain_error([&] {
      const cv::Mat image = decode_image({data, size}, pixels);
      for (int y = 0; y < image.rows; ++y)
        fuzz::touch(std::span(image.ptr(y), static_cast<std::size_t>(image.cols) * image.elemSize()));
    });
  return 0;
}
