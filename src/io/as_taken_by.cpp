// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/as_taken_by.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <utility>
#include <vector>

namespace cairn {
namespace {

constexpr float kJump = 0.05f;        // of the depth, between neighbours on two surfaces
constexpr double kSamePlace = 1e-9;   // metres, and of rotation matrices
constexpr float kNowhere = -1000.0f;  // pixels: no pixel is there

/// Where in another camera's images the pixels of one look, which is in the same place: pixels, x and y. Nothing where
/// the two are the same.
cv::Mat2f places(const Camera& seen_by, const Camera& from) {
  if (seen_by == from) return {};
  cv::Mat2f all(seen_by.height, seen_by.width);
  const double widest = from.widest_ray();
  for (int y = 0; y < seen_by.height; ++y)
    for (int x = 0; x < seen_by.width; ++x) {
      const Eigen::Vector2d ray = seen_by.undistorted_ray(x, y);
      const Eigen::Vector2d bent = from.distort(ray);
      all(y, x) = ray.norm() > widest ? cv::Vec2f(kNowhere, kNowhere)
                                      : cv::Vec2f(static_cast<float>(from.fx * bent.x() + from.cx),
                                                  static_cast<float>(from.fy * bent.y() + from.cy));
    }
  return all;
}

/// Depth between pixels. On a plane its inverse goes evenly from pixel to pixel; between two surfaces there is none.
float depth_between(const cv::Mat1f& depth, float u, float v) {
  const int x = static_cast<int>(std::lround(u)), y = static_cast<int>(std::lround(v));
  if (x < 0 || y < 0 || x >= depth.cols || y >= depth.rows) return 0;
  const int left = std::clamp(static_cast<int>(std::floor(u)), 0, depth.cols - 2),
            top = std::clamp(static_cast<int>(std::floor(v)), 0, depth.rows - 2);
  const float a = depth(top, left), b = depth(top, left + 1), c = depth(top + 1, left), d = depth(top + 1, left + 1);
  const auto [nearest, farthest] = std::minmax({a, b, c, d});
  if (nearest <= 0 || farthest - nearest > kJump * nearest) return depth(y, x);
  const float s = std::clamp(u - static_cast<float>(left), 0.0f, 1.0f),
              t = std::clamp(v - static_cast<float>(top), 0.0f, 1.0f);
  return 1 / ((1 - t) * ((1 - s) / a + s / b) + t * ((1 - s) / c + s / d));
}

bool is_same_place(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff() <= kSamePlace;
}

/// The same rig, with what it tells as the own one does to the last bit: a file of it may round.
Rig rounded_as(Rig rig, const Rig& own) {
  if (rig.colour && own.colour && is_same_place(rig.colour->colour_from_depth, own.colour->colour_from_depth))
    rig.colour->colour_from_depth = own.colour->colour_from_depth;
  if (rig.camera_from_imu && own.camera_from_imu && rig.camera_from_imu->isApprox(*own.camera_from_imu, kSamePlace))
    rig.camera_from_imu = own.camera_from_imu;
  return rig;
}

class AsTakenBy final : public WrappedSource {
 public:
  AsTakenBy(std::unique_ptr<Source> source, const Rig& rig)
      : WrappedSource(std::move(source)), rig_(rounded_as(rig, source_->rig())) {
    rig_.depth_correction = {};
  }
  const Rig& rig() const override { return rig_; }
  std::optional<double> next_timestamp() const override { return source_->next_timestamp(); }
  void skip() override { source_->skip(); }
  std::optional<Frame> next() override {
    auto frame = source_->next();
    if (!frame) return frame;
    if (!std::exchange(has_places_, true)) {  // whoever only asks for the rig waits for none
      depth_places_ = places(rig_.depth, own().depth);
      colour_places_ = places(rig_.colour_view(), own().colour_view());
    }
    turn(frame->gyro);
    if (const Camera& c = own().depth; has_size_of(c, frame->depth.size())) {
      leave_out_doubtful(*frame);
      own().depth_correction.apply(c.width, c.height, frame->depth);
      if (!depth_places_.empty()) frame->depth = seen(frame->depth);
    }
    frame->confidence.clear();
    if (const Camera& c = own().colour_view(); !colour_places_.empty() && has_size_of(c, frame->colour.size())) {
      cv::Mat image(colour_places_.size(), CV_8UC4);
      cv::remap(cv::Mat(c.height, c.width, CV_8UC4, frame->colour.data()), image, colour_places_, cv::noArray(),
                cv::INTER_LINEAR, cv::BORDER_REPLICATE);
      const auto* pixels = image.ptr<std::uint32_t>();
      frame->colour.assign(pixels, pixels + image.total());
    }
    return frame;
  }

 private:
  [[nodiscard]] const Rig& own() const { return source_->rig(); }
  [[nodiscard]] static bool has_size_of(const Camera& camera, std::size_t pixels) {
    return pixels == static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  }
  void leave_out_doubtful(Frame& frame) const {
    const SensorModel& model = own().sensor;
    for (std::size_t i = 0; i < frame.depth.size(); ++i)
      if (frame.depth[i] < model.min_depth || frame.depth[i] > model.max_depth ||
          (frame.confidence.size() == frame.depth.size() && frame.confidence[i] < model.least_confidence))
        frame.depth[i] = 0;
  }
  [[nodiscard]] std::vector<float> seen(std::vector<float>& depth) const {
    const cv::Mat1f image(own().depth.height, own().depth.width, depth.data());
    std::vector<float> all(depth_places_.total());
    std::transform(depth_places_.begin(), depth_places_.end(), all.begin(),
                   [&](const cv::Vec2f& place) { return depth_between(image, place[0], place[1]); });
    return all;
  }
  /// The other rig tells how an inertial sensor is turned.
  void turn(std::vector<AngularRate>& gyro) const {
    const auto &from = own().camera_from_imu, &to = rig_.camera_from_imu;
    if (from && to)
      for (AngularRate& at : gyro) at.rate = to->conjugate() * (*from * at.rate);
    else if (from || to)
      gyro.clear();
  }

  Rig rig_;
  bool has_places_ = false;
  cv::Mat2f depth_places_, colour_places_;
};

}  // namespace

std::unique_ptr<Source> as_taken_by(std::unique_ptr<Source> source, const Rig& rig) {
  if (!rig.colour) source = with_colour_on_depth(std::move(source));
  const Rig& own = source->rig();
  if (!is_same_place(own.depth_from_colour(), rig.depth_from_colour()))
    throw std::runtime_error(
        "its colour camera looks from another place, which `cairn convert --registered` undoes, in both");
  for (const auto& [is, wanted] :
       {std::pair{own.depth.readout, rig.depth.readout}, {own.colour_view().readout, rig.colour_view().readout}})
    if (is != wanted)
      throw std::runtime_error(
          fmt::format("its shutter takes {:.1f} ms for an image, and not {:.1f}", 1000 * is, 1000 * wanted));
  return std::make_unique<AsTakenBy>(std::move(source), rig);
}

}  // namespace cairn
