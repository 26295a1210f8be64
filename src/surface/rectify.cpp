// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "surface/rectify.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>

#include "shaders/surface_colour.h"
#include "spirv/surface_rectify.comp.h"

namespace cairn {
namespace {

constexpr float kFarAway = 3;            // m, if no pixel has depth
constexpr std::size_t kEveryPixel = 37;  // sampling interval for the median

std::uint64_t bytes(const Camera& c) {
  return sizeof(float) * static_cast<std::uint64_t>(c.width) * static_cast<std::uint64_t>(c.height);
}
std::array<std::uint32_t, 3> threads(const Camera& c) {  // one per pixel
  return {static_cast<std::uint32_t>(c.width), static_cast<std::uint32_t>(c.height), 1};
}

/// Undistorted rays by pixel.
std::vector<Eigen::Vector2f> rays_of(const Camera& c) {
  std::vector<Eigen::Vector2f> rays(static_cast<std::size_t>(c.width) * static_cast<std::size_t>(c.height));
  tbb::parallel_for(0, c.height, [&](int y) {
    for (int x = 0; x < c.width; ++x)
      rays[static_cast<std::size_t>(y) * static_cast<std::size_t>(c.width) + static_cast<std::size_t>(x)] =
          c.undistorted_ray(x, y).cast<float>();
  });
  return rays;
}

/// The camera is passed in the color camera's constants.
std::vector<float> constants_of(const Camera& c, bool keeps_lens, bool has_depth, bool has_colour) {
  auto all = shader::constants_of(
      SensorModel{},
      {.camera = shader::pinhole(c), .lens = shader::lens_bend(c), .is_rolling = c.readout > 0 ? 1u : 0u}, 1);
  for (const bool is : {keeps_lens, has_depth, has_colour}) all.push_back(std::bit_cast<float>(is ? 1u : 0u));
  return all;
}

}  // namespace

MotionAt at_velocity(const Vector6d& velocity) {
  return [velocity](double delay) { return retract(velocity * delay); };
}

Rig at_one_moment(Rig rig) {
  rig.depth.readout = 0;
  if (rig.colour) rig.colour->camera.readout = 0;
  return rig;
}

MotionAt colour_motion(const Rig& rig, const MotionAt& motion) {
  if (!rig.colour) return motion;
  return [motion, from_depth = rig.colour->colour_from_depth, to_depth = rig.depth_from_colour()](
             double delay) -> Eigen::Isometry3d { return from_depth * motion(delay) * to_depth; };
}

double shutter_difference(const Rig& rig, const MotionAt& a, const MotionAt& b) {
  const double half = 0.5 * std::max(rig.depth.readout, rig.colour_view().readout);
  double most = 0;
  for (const double delay : {-half, half}) {
    const Vector6d d = local_coordinates(a(delay).inverse() * b(delay));
    most = std::max(most, rig.depth.fx * (d.head<3>().norm() + d.tail<3>().norm()));
  }
  return most;
}

/// Motion as parabolas through its values at the start, middle and end of the readout.
shader::ShutterMotion shutter_motion(const MotionAt& motion, double readout) {
  if (readout == 0) return {};
  const double half = 0.5 * readout;
  const Vector6d before = local_coordinates(motion(-half)), after = local_coordinates(motion(half));
  const Vector6d rate = (after - before) / (2 * half), change = (after + before) / (2 * half * half);
  const auto part = [](const auto& v) { return Eigen::Vector3f(v.template cast<float>()); };
  return {.turn = part(rate.head<3>()),
          .turn_change = part(change.head<3>()),
          .shift = part(rate.tail<3>()),
          .shift_change = part(change.tail<3>()),
          .readout = static_cast<float>(readout)};
}

float median_depth(const std::vector<float>& depth) {
  std::vector<float> some;
  for (std::size_t i = 0; i < depth.size(); i += kEveryPixel)
    if (depth[i] > 0) some.push_back(depth[i]);
  if (some.empty()) return kFarAway;
  const auto middle = some.begin() + static_cast<std::ptrdiff_t>(some.size() / 2);
  std::nth_element(some.begin(), middle, some.end());
  return *middle;
}

Rectifier::Rectifier(gpu::Device& device, const Camera& camera, bool has_colour)
    : camera_(camera),
      depth_(device, bytes(camera)),
      colour_(device, bytes(camera)),
      no_rays_(device, sizeof(Eigen::Vector2f)),
      rectify_(device, "surface_rectify", surface_rectify_comp, constants_of(camera, false, true, has_colour)) {}

void Rectifier::operator()(gpu::Batch& batch, const MotionAt& motion, float distance, const gpu::Buffer& raw_depth,
                           const gpu::Buffer& raw_colour) {
  rectify_(batch, threads(camera_), {.motion = shutter_motion(motion, camera_.readout), .distance = distance},
           {&raw_depth, &raw_colour, &no_rays_, &depth_, &colour_});
}

GlobalShutter::Images::Images(gpu::Device& device, const Camera& camera, bool has_depth, bool has_colour)
    : device_(device),
      camera_(camera),
      depth_(device, bytes(camera)),
      colour_(device, bytes(camera)),
      rays_(device, 2 * bytes(camera)),
      global_depth_(device, bytes(camera)),
      global_colour_(device, bytes(camera)),
      undo_(device, "surface_rectify", surface_rectify_comp, constants_of(camera, true, has_depth, has_colour)) {
  gpu::Batch batch(device_);
  batch.upload(rays_, rays_of(camera));
  batch.submit();
}

void GlobalShutter::Images::undo(const MotionAt& motion, float distance, std::vector<float>* depth,
                                 std::vector<std::uint32_t>* colour) {
  gpu::Batch batch(device_);
  if (depth != nullptr) batch.upload(depth_, *depth);
  if (colour != nullptr) batch.upload(colour_, *colour);
  undo_(batch, threads(camera_), {.motion = shutter_motion(motion, camera_.readout), .distance = distance},
        {&depth_, &colour_, &rays_, &global_depth_, &global_colour_});
  if (depth != nullptr) batch.download(global_depth_, *depth);
  if (colour != nullptr) batch.download(global_colour_, *colour);
  batch.run();
}

GlobalShutter::GlobalShutter(gpu::Device& device, const Rig& rig) : rig_(rig) {
  if (rig.depth.readout > 0) depth_.emplace(device, rig.depth, true, !rig.colour);
  if (rig.colour && rig.colour->camera.readout > 0) colour_.emplace(device, rig.colour->camera, false, true);
}

Frame GlobalShutter::operator()(const Frame& frame, const MotionAt& motion) {
  Frame global = frame;
  const float distance = median_depth(frame.depth);
  const bool is_registered = !rig_.colour && frame.colour.size() == frame.depth.size();
  if (depth_) depth_->undo(motion, distance, &global.depth, is_registered ? &global.colour : nullptr);
  if (colour_ && !frame.colour.empty()) colour_->undo(colour_motion(rig_, motion), distance, nullptr, &global.colour);
  return global;
}

}  // namespace cairn
