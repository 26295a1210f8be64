// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/views.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <utility>

#include "export/image_rectifier.hpp"

namespace cairn {

double sharpness_of(Frame& frame, const Camera& camera) {
  if (frame.color.empty()) return -1;
  cv::Mat gray, edges;
  cv::cvtColor(cv::Mat(camera.height, camera.width, CV_8UC4, frame.color.data()), gray, cv::COLOR_RGBA2GRAY);
  cv::Laplacian(gray, edges, CV_32F);
  cv::Scalar mean, deviation;
  cv::meanStdDev(edges, mean, deviation);
  return deviation[0] * deviation[0];
}

int write_views(const ViewsInput& input, const std::filesystem::path& folder, const ViewsOptions& options,
                const ExportProgress& progress) {
  const std::size_t all = input.keyframes.size();
  const std::size_t wanted = options.images > 0 ? std::min(all, static_cast<std::size_t>(options.images)) : all;
  const ImageRectifier rectified(input.rig);
  const auto writer = options.program == ViewsFor::colmap ? write_colmap(folder, rectified.camera())
                                                          : write_layout("nerfstudio", folder, rectified.camera());
  int written = 0;
  for (std::size_t i = 0, k = 0; i < wanted; ++i) {
    std::pair<double, std::size_t> best{-1, 0};
    std::optional<Frame> sharpest;
    for (; k < (i + 1) * all / wanted; ++k) {
      Frame frame = input.get_image(input.keyframes[k].image);
      const double sharpness = sharpness_of(frame, input.rig.color_view());
      if (progress) progress(static_cast<int>(k), static_cast<int>(all), "writing images");
      if (sharpness <= best.first) continue;
      best = {sharpness, k};
      sharpest = std::move(frame);
    }
    if (!sharpest) continue;
    writer->add(rectified(*std::move(sharpest), input.world_from_map, input.keyframes[best.second]));
    ++written;
  }
  if (written == 0)
    throw std::runtime_error(
        "the map has no keyframes with color to write as images: keep them (Options::keep_keyframes), or use a "
        "recording with color");
  writer->finish();
  if (progress) progress(static_cast<int>(all), static_cast<int>(all), "done");
  return written;
}

}  // namespace cairn
