// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Maps frames from any source: depth in meters, color as bytes R, G, B, 255. Here: a ball on a floor, rendered on the
// CPU.
#include <cairn/mapping/mapper.hpp>
#include <cmath>
#include <cstdio>
#include <exception>

namespace {

/// View of a camera `x` meters to the right of the origin.
cairn::Frame draw(const cairn::Camera& camera, int index, double x) {
  cairn::Frame frame{.index = index, .timestamp = index / 30.0};
  const Eigen::Vector3d ball(0, 0, 2);
  constexpr double kRadius = 0.4, kFloor = 0.5;  // meters; the world is y down
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u) {
      const Eigen::Vector3d ray = camera.ray(u, v), from(x, 0, 0), gap = from - ball;
      const double a = ray.dot(ray), b = ray.dot(gap), inside = b * b - a * (gap.dot(gap) - kRadius * kRadius);
      const double on_ball = inside > 0 ? (-b - std::sqrt(inside)) / a : 0,
                   on_floor = ray.y() > 0 ? kFloor / ray.y() : 0;
      const double z = on_ball > 0 ? on_ball : on_floor < 6 ? on_floor : 0;  // 0: no measurement
      const Eigen::Vector3d at = from + z * ray;
      const bool is_light = (std::lround(5 * at.x() + 100) + std::lround(5 * at.z())) % 2 == 0;
      frame.depth.push_back(static_cast<float>(z));
      frame.color.push_back(on_ball > 0 ? 0xff2060d0u : is_light ? 0xffd0d0d0u : 0xff606060u);
    }
  return frame;
}

}  // namespace

int main() try {
  const cairn::Camera camera{320, 240, 262.5, 262.5, 159.5, 119.5, {}};
  cairn::Options options;
  options.fuse.voxel_size = 0.02f;
  options.fuse.truncation = 0.08f;
  cairn::Mapper mapper(camera, options);
  for (int i = 0; i < 20; ++i)
    if (const auto report = mapper.add(draw(camera, i, 0.01 * i)); report.state != cairn::FrameState::fused)
      std::printf("frame %d: %s\n", i, report.reason.c_str());
  const cairn::Trajectory path = mapper.trajectory();
  const double x = path.empty() ? 0 : path.back().world_from_camera.translation().x();
  std::printf("%zu frames fused; estimated motion %.3f m to the right, true motion 0.190 m\n", path.size(), x);
  return path.size() == 20 && std::abs(x - 0.19) < 0.005 ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
