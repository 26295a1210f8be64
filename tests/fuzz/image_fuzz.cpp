// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <opencv2/core/utils/logger.hpp>

#include "base/image_file.hpp"
#include "fuzz.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  for (const int flags : {cv::IMREAD_UNCHANGED, cv::IMREAD_COLOR})
    fuzz::expect_value_or_plain_error([&] {
      const cv::Mat image = decode_image({data, size}, flags);
      for (int y = 0; y < image.rows; ++y)
        fuzz::touch(std::span(image.ptr(y), static_cast<std::size_t>(image.cols) * image.elemSize()));
    });
  return 0;
}
