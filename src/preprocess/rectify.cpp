// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "preprocess/rectify.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>

#include "shaders/surface_color.h"
#include "spirv/surface_rectify.comp.h"

namespace cairn {
namespace {

constexpr float kDefaultDepth = 3;           // m, if no pixel has depth
constexpr std::size_t kSampleInterval = 37;  // sampling interval for the median

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
std::vector<float> constants_of(const Camera& c, bool keeps_lens, bool has_depth, bool has_color) {
  auto all = shader::constants_of(
      SensorModel{},
      {.camera = shader::pinhole(c), .lens = shader::lens_bend(c), .is_rolling = c.readout > 0 ? 1u : 0u}, 1);
  for (const bool is : {keeps_lens, has_depth, has_color}) all.push_back(std::bit_cast<float>(is ? 1u : 0u));
  return all;
}

}  // namespace

MotionAt at_velocity(const Vector6d& velocity) {
  return [velocity](double delay) { return retract(velocity * delay); };
}

MotionAt color_motion(const Rig& rig, const MotionAt& motion) {
  if (!rig.color) return motion;
  return [motion, from_depth = rig.color->color_from_depth, to_depth = rig.depth_from_color()](
             double delay) -> Eigen::Isometry3d { return from_depth * motion(delay) * to_depth; };
}

double shutter_difference(const Rig& rig, const MotionAt& a, const MotionAt& b) {
  const double half = 0.5 * std::max(rig.depth.readout, rig.color_view().readout);
  double max_offset = 0;
  for (const double delay : {-half, half}) {
    const Vector6d d = local_coordinates(a(delay).inverse() * b(delay));
    max_offset = std::max(max_offset, rig.depth.fx * (d.head<3>().norm() + d.tail<3>().norm()));
  }
  return max_offset;
}

/// Motion as parabolas through its values at the start, middle and end of the readout.
shader::ShutterMotion shutter_motion(const MotionAt& motion, double readout) {
  if (readout == 0) return {};
  const double half = 0.5 * readout;
  const Vector6d before = local_coordinates(motion(-half)), after = local_coordinates(motion(half));
  const Vector6d rate = (after - before) / (2 * half), change = (after + before) / (2 * half * half);
  const auto to_float = [](const auto& v) { return Eigen::Vector3f(v.template cast<float>()); };
  return {.turn = to_float(rate.head<3>()),
          .turn_change = to_float(change.head<3>()),
          .shift = to_float(rate.tail<3>()),
          .shift_change = to_float(change.tail<3>()),
          .readout = static_cast<float>(readout)};
}

float median_depth(const std::vector<float>& depth) {
  std::vector<float> samples;
  for (std::size_t i = 0; i < depth.size(); i += kSampleInterval)
    if (depth[i] > 0) samples.push_back(depth[i]);
  if (samples.empty()) return kDefaultDepth;
  const auto middle = samples.begin() + static_cast<std::ptrdiff_t>(samples.size() / 2);
  std::nth_element(samples.begin(), middle, samples.end());
  return *middle;
}

Rectifier::Rectifier(gpu::Device& device, const Camera& camera, bool has_color)
    : camera_(camera),
      depth_(device, bytes(camera)),
      color_(device, bytes(camera)),
      no_rays_(device, sizeof(Eigen::Vector2f)),
      rectify_(device, "surface_rectify", surface_rectify_comp, constants_of(camera, false, true, has_color)) {}

void Rectifier::operator()(gpu::Batch& batch, const MotionAt& motion, float distance, const gpu::Buffer& raw_depth,
                           const gpu::Buffer& raw_color) {
  rectify_(batch, threads(camera_), {.motion = shutter_motion(motion, camera_.readout), .distance = distance},
           {&raw_depth, &raw_color, &no_rays_, &depth_, &color_});
}

GlobalShutter::Images::Images(gpu::Device& device, const Camera& camera, bool has_depth, bool has_color)
    : device_(device),
      camera_(camera),
      depth_(device, bytes(camera)),
      color_(device, bytes(camera)),
      rays_(device, 2 * bytes(camera)),
      global_depth_(device, bytes(camera)),
      global_color_(device, bytes(camera)),
      correct_(device, "surface_rectify", surface_rectify_comp, constants_of(camera, true, has_depth, has_color)) {
  gpu::Batch batch(device_);
  batch.upload(rays_, rays_of(camera));
  batch.submit();
}

void GlobalShutter::Images::correct(const MotionAt& motion, float distance, std::vector<float>* depth,
                                    std::vector<std::uint32_t>* color) {
  gpu::Batch batch(device_);
  if (depth != nullptr) batch.upload(depth_, *depth);
  if (color != nullptr) batch.upload(color_, *color);
  correct_(batch, threads(camera_), {.motion = shutter_motion(motion, camera_.readout), .distance = distance},
           {&depth_, &color_, &rays_, &global_depth_, &global_color_});
  if (depth != nullptr) batch.download(global_depth_, *depth);
  if (color != nullptr) batch.download(global_color_, *color);
  batch.run();
}

GlobalShutter::GlobalShutter(gpu::Device& device, const Rig& rig) : rig_(rig) {
  if (rig.depth.readout > 0) depth_.emplace(device, rig.depth, true, !rig.color);
  if (rig.color && rig.color->camera.readout > 0) color_.emplace(device, rig.color->camera, false, true);
}

Frame GlobalShutter::operator()(const Frame& frame, const MotionAt& motion) {
  Frame global = frame;
  const float distance = median_depth(frame.depth);
  const bool is_registered = !rig_.color && frame.color.size() == frame.depth.size();
  if (depth_) depth_->correct(motion, distance, &global.depth, is_registered ? &global.color : nullptr);
  if (color_ && !frame.color.empty()) color_->correct(color_motion(rig_, motion), distance, nullptr, &global.color);
  return global;
}

}  // namespace cairn
