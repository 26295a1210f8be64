// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Gaussian splats: cost of an image, and of a step of training, for a million surfels on the walls of a room.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "splats/trainer.hpp"

namespace cairn {
namespace {

const Camera kCamera{.width = 640, .height = 480, .fx = 525, .fy = 525, .cx = 319.5, .cy = 239.5};
const Eigen::Vector3f kRoom(5, 2.5f, 4);  // meters; y down

/// Points spread evenly over the faces of a box around the camera.
Splats surfels(std::size_t count) {
  std::minstd_rand random(5);
  const auto uniform = [&](float from, float to) { return std::uniform_real_distribution<float>(from, to)(random); };
  const std::array<float, 3> area = {kRoom.y() * kRoom.z(), kRoom.x() * kRoom.z(), kRoom.x() * kRoom.y()};
  const float total = area[0] + area[1] + area[2];
  const float sigma = 0.6f * std::sqrt(2 * total / static_cast<float>(count));
  Splats splats;
  splats.degree = 1;
  for (std::size_t i = 0; i < count; ++i) {
    const float at = uniform(0, total);
    const int axis = at < area[0] ? 0 : at < area[0] + area[1] ? 1 : 2;
    Eigen::Vector3f position(uniform(-0.5f, 0.5f), uniform(-0.5f, 0.5f), uniform(-0.5f, 0.5f));
    position[axis] = position[axis] < 0 ? -0.5f : 0.5f;
    Eigen::Vector3f scale = Eigen::Vector3f::Constant(std::log(sigma));
    scale[axis] = std::log(0.15f * sigma);
    splats.positions.emplace_back(position.cwiseProduct(kRoom));
    splats.log_scales.push_back(scale);
    splats.rotations.emplace_back(1, 0, 0, 0);
    splats.opacities.push_back(2.2f);
    splats.colors.emplace_back(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    splats.harmonics.resize(3 * splats.size(), Eigen::Vector3f::Zero());
  }
  return splats;
}

void an_image(benchmark::State& state) {
  gpu::Device device;
  const SplatModel model = upload(device, surfels(static_cast<std::size_t>(state.range(0))));
  SplatRasterizer rasterizer(device);
  for (auto _ : state) {
    rasterizer.forward(model, {.camera = kCamera});
    device.wait();
  }
  state.counters["visible"] = rasterizer.visible();
  state.counters["entries"] = rasterizer.entries();
}
BENCHMARK(an_image)->Arg(100'000)->Arg(1'000'000)->Unit(benchmark::kMillisecond);

void a_training_step(benchmark::State& state) {
  gpu::Device device;
  TrainingView view{.camera = kCamera, .color = {}, .depth = {}};
  const std::size_t pixels = std::size_t{640} * 480;
  view.depth.assign(pixels, 2.0f);
  std::minstd_rand random(6);
  for (std::size_t i = 0; i < pixels; ++i) view.color.push_back(0xff000000u | static_cast<std::uint32_t>(random()));
  const auto count = static_cast<std::size_t>(state.range(0));
  SplatTrainer trainer(device, surfels(count), {view},
                       {.iterations = 1'000'000, .max_splats = count, .densify_interval = 1'000'000, .levels = 1});
  for (auto _ : state) benchmark::DoNotOptimize(trainer.step());
  for (const auto& [name, time] : device.kernel_times())
    if (time.calls > 0) state.counters[name] = time.total_ms / static_cast<double>(state.iterations());
}
BENCHMARK(a_training_step)->Arg(100'000)->Arg(1'000'000)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace cairn
