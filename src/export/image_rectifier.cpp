// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/image_rectifier.hpp"

#include <opencv2/imgproc.hpp>
#include <utility>

#include "geometry/undistortion_map.hpp"

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

}  // namespace

ImageRectifier::ImageRectifier(const Rig& rig)
    : lens_(rig.color_view()), camera_(without_lens(lens_)), depth_from_color_(rig.depth_from_color()) {
  if (rig.color || lens_.distorted())
    view_.emplace(Rig(rig.depth, ColorCamera{.camera = camera_, .color_from_depth = depth_from_color_.inverse()}));
  if (lens_.distorted()) map_ = undistortion_map(lens_, camera_);
}

Frame ImageRectifier::operator()(Frame frame, const Eigen::Isometry3d& world_from_map,
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

}  // namespace cairn
