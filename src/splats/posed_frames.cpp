// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "splats/posed_frames.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "geometry/velocity.hpp"
#include "mapper/tracking_criteria.hpp"

namespace cairn {
namespace {

constexpr double kMaxTimeDifference = 1e-4;  // seconds: rounding of timestamps with a clock offset
constexpr double kMinViewChange = 0.02;      // image widths between two training images

void check_size(const Frame& frame, const Camera& color, const Camera& depth) {
  const auto pixels = [](const Camera& c) {
    return static_cast<std::size_t>(c.width) * static_cast<std::size_t>(c.height);
  };
  if (frame.color.size() != pixels(color) || frame.depth.size() != pixels(depth))
    throw std::runtime_error("frame " + std::to_string(frame.index) +
                             " of the recording has images of another size than the map's: give the recording of the "
                             "map");
}

}  // namespace

PosedFrames::PosedFrames(const Map& map, const ViewsInput& input, std::unique_ptr<Source> recording, int every)
    : color_(input.rig.color_view()),
      depth_(input.rig.depth),
      poses_(map.trajectory()),
      clock_offset_(map.statistics().clock_offset),
      recording_(hold_out(std::move(recording), {.every = every, .range = {}})) {
  double change = 0;
  for (std::size_t i = 0; i < poses_.size(); ++i) {
    poses_[i].timestamp -= clock_offset_;
    if (i > 0)
      change += cairn::view_change(color_, poses_[i - 1].world_from_camera.inverse() * poses_[i].world_from_camera);
    view_changes_.push_back(change);
  }
}

std::optional<std::size_t> PosedFrames::pose_of(double timestamp) const {
  const auto found = std::lower_bound(poses_.begin(), poses_.end(), timestamp - kMaxTimeDifference,
                                      [](const StampedPose& pose, double time) { return pose.timestamp < time; });
  if (found == poses_.end() || found->timestamp > timestamp + kMaxTimeDifference) return std::nullopt;
  return static_cast<std::size_t>(found - poses_.begin());
}

std::optional<PosedFrame> PosedFrames::next() {
  while (auto frame = recording_->next()) {
    if (frame->problem || frame->color.empty()) continue;
    const auto pose = pose_of(frame->timestamp);
    if (!pose) continue;
    check_size(*frame, color_, depth_);
    const TextureKeyframe keyframe{.image = *pose,
                                   .world_from_camera = poses_[*pose].world_from_camera,
                                   .velocity = velocity_at(poses_, frame->timestamp),
                                   .color_delay = frame->color_delay - clock_offset_};
    return PosedFrame{.frame = std::move(*frame), .keyframe = keyframe, .view_change = view_changes_[*pose]};
  }
  return std::nullopt;
}

void visit_sharpest(PosedFrames& frames, std::size_t max_count, const std::function<bool(PosedFrame)>& visit) {
  const double interval =
      std::max(kMinViewChange, frames.view_change() / static_cast<double>(std::max<std::size_t>(1, max_count)));
  const auto interval_of = [&](const PosedFrame& f) {
    return std::min(static_cast<std::size_t>(f.view_change / interval), max_count - 1);
  };
  std::optional<PosedFrame> sharpest;
  double best = -1;
  while (auto frame = frames.next()) {
    if (frame->frame.held_out) continue;
    if (sharpest && interval_of(*frame) != interval_of(*sharpest)) {
      if (!visit(*std::exchange(sharpest, std::nullopt))) return;
      best = -1;
    }
    const double sharpness = sharpness_of(frame->frame, frames.camera());
    if (sharpest && sharpness <= best) continue;
    best = sharpness;
    sharpest = std::move(frame);
  }
  if (sharpest) visit(*std::move(sharpest));
}

}  // namespace cairn
