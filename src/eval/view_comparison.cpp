// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "eval/view_comparison.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

namespace cairn {
namespace {

constexpr float kMaxDepthDifference = 0.05f;  // meters between surface and measurement, to compare colors
constexpr float kMaxDepthError = 0.1f;        // meters: beyond this distance, another surface

/// Undistorts a frame: nearest depth, interpolated color.
Frame rectified(const Frame& frame, const Camera& camera) {
  Frame undistorted{.depth = std::vector<float>(frame.depth.size()),
                    .color = std::vector<std::uint32_t>(frame.color.size())};
  const auto at = [&](int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width) + static_cast<std::size_t>(x);
  };
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector2d distorted = camera.distort(camera.ray(x, y).head<2>());
      const double u = camera.fx * distorted.x() + camera.cx, v = camera.fy * distorted.y() + camera.cy;
      if (!(u >= 0 && v >= 0 && u < camera.width - 1 && v < camera.height - 1)) continue;
      undistorted.depth[at(x, y)] = frame.depth[at(static_cast<int>(std::lround(u)), static_cast<int>(std::lround(v)))];
      if (frame.color.empty()) continue;
      const int left = static_cast<int>(u), top = static_cast<int>(v);
      const double a = u - left, b = v - top;
      std::uint32_t& word = undistorted.color[at(x, y)] = 0xff000000u;
      for (int c = 0; c < 24; c += 8) {
        const auto level = [&](int i, int j) {
          return static_cast<double>(frame.color[at(left + i, top + j)] >> c & 255);
        };
        const double mean =
            (1 - b) * ((1 - a) * level(0, 0) + a * level(1, 0)) + b * ((1 - a) * level(0, 1) + a * level(1, 1));
        word |= static_cast<std::uint32_t>(std::lround(mean)) << c;
      }
    }
  return undistorted;
}

Frame without_lens(Frame frame, const Camera& camera) {
  return camera.distorted() ? rectified(frame, camera) : std::move(frame);
}

/// Pixels with a measurement, and their depth.
std::vector<std::pair<std::size_t, float>> measured_in(const Frame& frame) {
  std::vector<std::pair<std::size_t, float>> measured;
  for (std::size_t p = 0; p < frame.depth.size(); ++p)
    if (frame.depth[p] > 0) measured.emplace_back(p, frame.depth[p]);
  return measured;
}

/// Relative poses of the rows of a rolling-shutter image at their capture time.
class Rows {
 public:
  Rows(const Camera& camera, const Vector6d& velocity) : camera_(camera) {
    for (int y = 0; y < camera.height; ++y) now_from_row_.push_back(retract(velocity * camera.row_delay(y)));
  }
  /// Corrects a measured pixel for the rolling shutter: pixel (x, y) and depth z at the image's time; nullopt outside
  /// the image.
  [[nodiscard]] std::optional<Eigen::Vector3d> at_image_time(std::size_t pixel, float z) const {
    const auto x = static_cast<int>(pixel % static_cast<std::size_t>(camera_.width)),
               y = static_cast<int>(pixel / static_cast<std::size_t>(camera_.width));
    if (camera_.readout == 0) return Eigen::Vector3d(x, y, static_cast<double>(z));
    const Eigen::Vector3d point =
        now_from_row_[static_cast<std::size_t>(y)] * (static_cast<double>(z) * camera_.ray(x, y));
    if (!(point.z() > 0)) return std::nullopt;
    const Eigen::Vector2d at = camera_.project(point);
    if (!(at.x() >= 0 && at.y() >= 0 && at.x() <= camera_.width - 1 && at.y() <= camera_.height - 1))
      return std::nullopt;
    return Eigen::Vector3d(at.x(), at.y(), point.z());
  }

 private:
  const Camera& camera_;
  std::vector<Eigen::Isometry3d> now_from_row_;
};

std::size_t nearest(const Camera& camera, const Eigen::Vector2d& pixel) {
  return static_cast<std::size_t>(std::lround(pixel.y())) * static_cast<std::size_t>(camera.width) +
         static_cast<std::size_t>(std::lround(pixel.x()));
}

/// R, G and B.
Eigen::Array3d channels(std::uint32_t word) {
  return {static_cast<double>(word & 255), static_cast<double>(word >> 8 & 255), static_cast<double>(word >> 16 & 255)};
}

/// R, G and B, interpolated between four pixels.
Eigen::Vector3d color_at(const std::vector<std::uint32_t>& image, const Camera& camera, const Eigen::Vector2d& pixel) {
  const int x = std::min(static_cast<int>(pixel.x()), camera.width - 2),
            y = std::min(static_cast<int>(pixel.y()), camera.height - 2);
  const double u = pixel.x() - x, v = pixel.y() - y;
  const std::size_t at = nearest(camera, {x, y}), below = at + static_cast<std::size_t>(camera.width);
  const auto of = [&](std::size_t i) -> Eigen::Vector3d { return channels(image[i]); };
  if (u == 0 && v == 0) return of(at);
  return (1 - v) * ((1 - u) * of(at) + u * of(at + 1)) + v * ((1 - u) * of(below) + u * of(below + 1));
}

}  // namespace

ViewComparison::ViewComparison(Render render, const Rig& rig) : render_(std::move(render)), rig_(rig), in_color_(rig) {}

ViewComparison::ViewComparison(const std::vector<Mesh>& parts, const Rig& rig)
    : ViewComparison([&parts](const Camera& camera, const Eigen::Isometry3d& pose,
                              int samples) { return render_mesh(parts, camera, pose, samples); },
                     rig) {}

std::vector<ViewComparison::Pixel> ViewComparison::compare_depth(const Frame& frame,
                                                                 const Eigen::Isometry3d& world_from_camera,
                                                                 const Vector6d& velocity) const {
  const Camera& camera = rig_.depth;
  const std::vector<float> rendered = render_(camera, world_from_camera, 1).depth;
  const Rows rows(camera, velocity);
  std::vector<Pixel> pixels;
  for (const Frame undistorted = without_lens({.depth = frame.depth, .color = {}}, camera);
       const auto& [p, z] : measured_in(undistorted))
    if (const auto at = rows.at_image_time(p, z))
      pixels.push_back({static_cast<float>(at->z()), rendered[nearest(camera, at->head<2>())]});
  return pixels;
}

void ViewComparison::compare_color(Frame frame, const Eigen::Isometry3d& world_from_camera, const Vector6d& velocity,
                                   double delay) {
  const Camera& camera = rig_.color_view();
  const Eigen::Isometry3d depth_from_color = rig_.depth_from_color();
  constexpr int kSamples = 2;
  const RenderedView view = render_(camera, world_from_camera * retract(velocity * delay) * depth_from_color, kSamples);
  const Vector6d of_color = adjoint(depth_from_color.inverse()) * velocity;
  const Rows rows(camera, of_color);
  frame = without_lens(in_color_(std::move(frame)), camera);
  Eigen::Array3d drawn_drawn = Eigen::Array3d::Zero(), drawn_seen = drawn_drawn, seen_seen = drawn_drawn;
  for (const auto& [p, z] : measured_in(frame)) {
    ++measured_;
    const auto at = rows.at_image_time(p, z);
    if (!at) continue;
    const float rendered = view.depth[nearest(camera, at->head<2>())];
    const float depth_error = rendered - static_cast<float>(at->z());
    if (rendered == 0 || std::abs(depth_error) > kMaxDepthError) continue;
    ++depths_;
    depth_squared_ += static_cast<double>(depth_error * depth_error);
    if (std::abs(depth_error) > kMaxDepthDifference) continue;
    ++compared_;
    const Eigen::Array3d drawn = color_at(view.color, camera, at->head<2>()).array(), seen = channels(frame.color[p]);
    drawn_drawn += drawn.square(), drawn_seen += drawn * seen, seen_seen += seen.square();
  }
  squared_ += (drawn_drawn - 2 * drawn_seen + seen_seen).sum();
  squared_with_gain_ += (seen_seen - drawn_seen.square() / drawn_drawn.max(1)).sum();
}

double ViewComparison::psnr(double squared) const {
  if (compared_ == 0) return 0;
  return 10 * std::log10(255.0 * 255.0 * 3 * static_cast<double>(compared_) / std::max(squared, 1e-9));
}

double ViewComparison::covered() const {
  return measured_ == 0 ? 0 : static_cast<double>(compared_) / static_cast<double>(measured_);
}

double ViewComparison::depth_rmse() const {
  return depths_ == 0 ? 0 : std::sqrt(depth_squared_ / static_cast<double>(depths_));
}

ViewError ViewComparison::error(int frames) const {
  return {.psnr = psnr(),
          .psnr_with_gain = psnr_with_gain(),
          .covered = covered(),
          .depth_rmse = depth_rmse(),
          .frames = frames};
}

ViewError compare_views(ViewComparison& views, Source& recording, const Eigen::Isometry3d& world_from_recording,
                        int step) {
  int frames = 0;
  for (int i = 0; auto frame = recording.next(); ++i) {
    if (i % step != 0 || !frame->world_from_camera || frame->color.empty() || frame->problem) continue;
    const Eigen::Isometry3d pose = world_from_recording * *frame->world_from_camera;
    views.compare_color(std::move(*frame), pose, Vector6d::Zero(), 0);
    ++frames;
  }
  if (!views.has_compared())
    throw std::runtime_error(
        "no image of the recording shows the mesh: the recording needs color images with poses in the "
        "mesh's frame");
  return views.error(frames);
}

ViewError evaluate_views(const std::vector<Mesh>& parts, Source& recording,
                         const Eigen::Isometry3d& world_from_recording, int step) {
  ViewComparison views(parts, recording.rig());
  return compare_views(views, recording, world_from_recording, step);
}

}  // namespace cairn
