// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "geometry/encode_frame.hpp"

#include <opencv2/imgproc.hpp>
#include <string_view>

#include "base/image_file.hpp"

namespace cairn {

std::vector<std::uint8_t> encode_depth(std::span<const float> depth, const Camera& camera, double units_per_meter,
                                       std::uint16_t none) {
  auto units = depth_units(depth, units_per_meter, none);
  return encode_png(cv::Mat(camera.height, camera.width, CV_16U, units.data()));
}

std::vector<std::uint8_t> encode_color(std::span<const std::uint32_t> color, const Camera& camera,
                                       const char* extension) {
  const cv::Mat rgba(camera.height, camera.width, CV_8UC4, const_cast<std::uint32_t*>(color.data()));
  if (extension != std::string_view(".png")) return encode_jpeg(rgba);
  cv::Mat rgb;
  cv::cvtColor(rgba, rgb, cv::COLOR_RGBA2RGB);
  return encode_png(rgb);
}

}  // namespace cairn
