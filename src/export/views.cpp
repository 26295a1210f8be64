// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/views.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <utility>

#include "geometry/color_view.hpp"

namespace cairn {
namespace {

constexpr double kFocalStep = 1.01;  // ratio of successive focal lengths to try
constexpr int kMaxTries = 140;       // up to four times the lens' own

/// True if each pixel of a camera is inside the lens' image.
bool is_within(const Camera& camera, const Camera& lens) {
  const double max_tangent = lens.widest_ray();
  const auto undistorted = [&](int x, int y) {
    const Eigen::Vector2d ray = camera.ray(x, y).head<2>();
    if (ray.norm() > max_tangent) return false;
    const Eigen::Vector2d distorted = lens.distort(ray);
    const double u = lens.fx * distorted.x() + lens.cx, v = lens.fy * distorted.y() + lens.cy;
    return u >= 0 && v >= 0 && u <= lens.width - 1 && v <= lens.height - 1;
  };
  for (int x = 0; x < camera.width; ++x)
    if (!undistorted(x, 0) || !undistorted(x, camera.height - 1)) return false;
  for (int y = 0; y < camera.height; ++y)
    if (!undistorted(0, y) || !undistorted(camera.width - 1, y)) return false;
  return true;
}

/// Pinhole camera of the same pose and size, with the largest field of view without black borders.
Camera without_lens(const Camera& lens) {
  Camera camera = lens.rectified();
  if (!lens.distorted()) return camera;
  for (int i = 0; i < kMaxTries && !is_within(camera, lens); ++i) camera.fx *= kFocalStep, camera.fy *= kFocalStep;
  return camera;
}

/// Frames rectified to the pinhole color camera.
class Rectified {
 public:
  explicit Rectified(const Rig& rig)
      : lens_(rig.color_view()), camera_(without_lens(lens_)), depth_from_color_(rig.depth_from_color()) {
    if (rig.color || lens_.distorted())
      view_.emplace(Rig(rig.depth, ColorCamera{.camera = camera_, .color_from_depth = depth_from_color_.inverse()}));
    if (!lens_.distorted()) return;
    map_.create(camera_.height, camera_.width, CV_32FC2);
    for (int y = 0; y < camera_.height; ++y)
      for (int x = 0; x < camera_.width; ++x) {
        const Eigen::Vector2d distorted = lens_.distort(camera_.ray(x, y).head<2>());
        map_.at<cv::Vec2f>(y, x) = {static_cast<float>(lens_.fx * distorted.x() + lens_.cx),
                                    static_cast<float>(lens_.fy * distorted.y() + lens_.cy)};
      }
  }
  [[nodiscard]] const Camera& camera() const { return camera_; }
  [[nodiscard]] Frame operator()(Frame frame, const Eigen::Isometry3d& world_from_map,
                                 const TextureKeyframe& keyframe) const {
    if (view_) frame = (*view_)(std::move(frame));
    if (!map_.empty()) {
      std::vector<std::uint32_t> undistorted(frame.color.size());
      const auto image = [&](std::vector<std::uint32_t>& pixels) {
        return cv::Mat(camera_.height, camera_.width, CV_8UC4, pixels.data());
      };
      cv::Mat to = image(undistorted);
      cv::remap(image(frame.color), to, map_, cv::noArray(), cv::INTER_LINEAR);
      frame.color = std::move(undistorted);
    }
    frame.world_from_camera = world_from_map * keyframe.world_from_camera *
                              retract(keyframe.velocity * keyframe.color_delay) * depth_from_color_;
    return frame;
  }

 private:
  Camera lens_, camera_;
  Eigen::Isometry3d depth_from_color_;
  std::optional<ColorView> view_;  // where depth is not already in these pixels
  cv::Mat map_;                    // by pixel: position in the distorted image
};

/// Variance of the Laplacian (Pech-Pacheco et al. 2000); less than 0 without color.
double sharpness_of(Frame& frame, const Camera& camera) {
  if (frame.color.empty()) return -1;
  cv::Mat gray, edges;
  cv::cvtColor(cv::Mat(camera.height, camera.width, CV_8UC4, frame.color.data()), gray, cv::COLOR_RGBA2GRAY);
  cv::Laplacian(gray, edges, CV_32F);
  cv::Scalar mean, deviation;
  cv::meanStdDev(edges, mean, deviation);
  return deviation[0] * deviation[0];
}

}  // namespace

int write_views(const ViewsInput& input, const std::filesystem::path& folder, const ViewsOptions& options,
                const ExportProgress& progress) {
  const std::size_t all = input.keyframes.size();
  const std::size_t wanted = options.images > 0 ? std::min(all, static_cast<std::size_t>(options.images)) : all;
  const Rectified rectified(input.rig);
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
