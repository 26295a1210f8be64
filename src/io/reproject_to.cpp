// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/reproject_to.hpp"

#include <fmt/format.h>

#include <stdexcept>
#include <utility>
#include <vector>

#include "io/resample.hpp"

namespace cairn {
namespace {

constexpr double kPoseTolerance = 1e-9;  // meters, and tolerance of rotation matrix entries

bool is_same_pose(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff() <= kPoseTolerance;
}

/// Returns the rig with its extrinsics replaced by the source's own where both agree within kPoseTolerance, because a
/// rig file may round.
Rig with_exact_extrinsics(Rig rig, const Rig& own) {
  if (rig.color && own.color && is_same_pose(rig.color->color_from_depth, own.color->color_from_depth))
    rig.color->color_from_depth = own.color->color_from_depth;
  if (rig.camera_from_imu && own.camera_from_imu && rig.camera_from_imu->isApprox(*own.camera_from_imu, kPoseTolerance))
    rig.camera_from_imu = own.camera_from_imu;
  return rig;
}

class ReprojectedSource final : public WrappedSource {
 public:
  ReprojectedSource(std::unique_ptr<Source> source, const Rig& rig)
      : WrappedSource(std::move(source)), rig_(with_exact_extrinsics(rig, source_->rig())) {
    rig_.depth_correction = {};
  }
  const Rig& rig() const override { return rig_; }
  std::optional<double> next_timestamp() const override { return source_->next_timestamp(); }
  void skip() override { source_->skip(); }
  std::optional<Frame> next() override {
    auto frame = source_->next();
    if (!frame) return frame;
    if (!std::exchange(has_resamplers_, true)) {  // built at the first frame, so that reading the rig alone stays fast
      depth_resampler_ = Resampler(rig_.depth, own().depth);
      color_resampler_ = Resampler(rig_.color_view(), own().color_view());
    }
    rotate(frame->gyro);
    if (const Camera& c = own().depth; has_size_of(c, frame->depth.size())) {
      remove_unreliable_depth(*frame);
      own().depth_correction.apply(c.width, c.height, frame->depth);
      frame->depth = depth_resampler_.depth(std::move(frame->depth));
    }
    frame->confidence.clear();
    if (has_size_of(own().color_view(), frame->color.size()))
      frame->color = color_resampler_.color(std::move(frame->color));
    return frame;
  }

 private:
  [[nodiscard]] const Rig& own() const { return source_->rig(); }
  [[nodiscard]] static bool has_size_of(const Camera& camera, std::size_t pixels) {
    return pixels == static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  }
  void remove_unreliable_depth(Frame& frame) const {
    const SensorModel& model = own().sensor;
    for (std::size_t i = 0; i < frame.depth.size(); ++i)
      if (frame.depth[i] < model.min_depth || frame.depth[i] > model.max_depth ||
          (frame.confidence.size() == frame.depth.size() && frame.confidence[i] < model.min_confidence))
        frame.depth[i] = 0;
  }
  /// Rotates angular rates from the source's IMU frame into the target rig's. Without both rotations they are dropped.
  void rotate(std::vector<AngularRate>& gyro) const {
    const auto &from = own().camera_from_imu, &to = rig_.camera_from_imu;
    if (from && to)
      for (AngularRate& at : gyro) at.rate = to->conjugate() * (*from * at.rate);
    else if (from || to)
      gyro.clear();
  }

  Rig rig_;
  bool has_resamplers_ = false;
  Resampler depth_resampler_, color_resampler_;
};

}  // namespace

std::unique_ptr<Source> reproject_to(std::unique_ptr<Source> source, const Rig& rig) {
  if (!rig.color) source = with_color_on_depth(std::move(source));
  const Rig& own = source->rig();
  if (!is_same_pose(own.depth_from_color(), rig.depth_from_color()))
    throw std::runtime_error(
        "its color camera has another position; register color to depth in both recordings with `cairn convert "
        "--registered`");
  for (const auto& [actual, expected] :
       {std::pair{own.depth.readout, rig.depth.readout}, {own.color_view().readout, rig.color_view().readout}})
    if (actual != expected)
      throw std::runtime_error(
          fmt::format("its shutter readout is {:.1f} ms, not {:.1f} ms", 1000 * actual, 1000 * expected));
  return std::make_unique<ReprojectedSource>(std::move(source), rig);
}

}  // namespace cairn
