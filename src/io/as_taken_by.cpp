// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/as_taken_by.hpp"

#include <fmt/format.h>

#include <stdexcept>
#include <utility>
#include <vector>

#include "io/resample.hpp"

namespace cairn {
namespace {

constexpr double kSamePlace = 1e-9;  // meters, and tolerance of rotation matrix entries

bool is_same_place(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff() <= kSamePlace;
}

/// Returns the rig with its extrinsics replaced by the source's own where both agree within kSamePlace, because a rig
/// file may round.
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
    if (!std::exchange(has_places_, true)) {  // built at the first frame, so that reading the rig alone stays fast
      depth_ = Resampler(rig_.depth, own().depth);
      colour_ = Resampler(rig_.colour_view(), own().colour_view());
    }
    turn(frame->gyro);
    if (const Camera& c = own().depth; has_size_of(c, frame->depth.size())) {
      leave_out_doubtful(*frame);
      own().depth_correction.apply(c.width, c.height, frame->depth);
      frame->depth = depth_.depth(std::move(frame->depth));
    }
    frame->confidence.clear();
    if (has_size_of(own().colour_view(), frame->colour.size())) frame->colour = colour_.color(std::move(frame->colour));
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
  /// Rotates angular rates from the source's IMU frame into the target rig's. Without both rotations they are dropped.
  void turn(std::vector<AngularRate>& gyro) const {
    const auto &from = own().camera_from_imu, &to = rig_.camera_from_imu;
    if (from && to)
      for (AngularRate& at : gyro) at.rate = to->conjugate() * (*from * at.rate);
    else if (from || to)
      gyro.clear();
  }

  Rig rig_;
  bool has_places_ = false;
  Resampler depth_, colour_;
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
