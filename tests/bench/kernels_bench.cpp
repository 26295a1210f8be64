// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Time of each stage and of each of its kernels, on the synthetic room, 640x480, 1 cm voxels. Keep the settings:
// numbers stay comparable.
#include <benchmark/benchmark.h>

#include "alignment/align.hpp"
#include "cairn/synthetic/scene.hpp"
#include "preprocess/preprocess.hpp"
#include "synth/render.hpp"
#include "volume/integrate.hpp"
#include "volume/polygonize.hpp"
#include "volume/raycast.hpp"

namespace cairn {
namespace {

/// A second of the room fused with its true poses.
struct Bench {
  gpu::Device device;
  Camera camera = synthetic_camera();
  Scene scene = synthetic_scene("room");
  TrackOptions track;
  SceneRenderer renderer{device, scene, camera};
  Preprocessor preprocessor{device, camera, {}, track.levels, track.finest_level};
  Volume volume{device, {}, 5.0f};
  Integrator integrator{device, camera, {}};
  Raycaster raycaster{device, camera, {}, track.levels, track.finest_level};
  Aligner aligner{device, track};
  Polygonizer polygonizer{device};
  Frame frame;
  Eigen::Isometry3d pose;
  std::uint32_t fused_count = 0;

  Bench() {
    for (int i = 0; i < 30; i += 3) {
      pose = scene.world_from_camera(i / 30.0);
      auto images = renderer.render(pose);
      add_noise(images, camera, "kinect", 1, i);
      frame.depth = std::move(images.depth);
      frame.color = std::move(images.color);
      integrator.integrate(preprocessor.preprocess(frame), pose, volume, ++fused_count);
    }
  }
};

Bench& bench() {
  static Bench instance;
  return instance;
}

/// Adds the mean milliseconds of each kernel run by the benchmark, from the device's timestamps.
class KernelCounters {
 public:
  explicit KernelCounters(benchmark::State& state) : state_(state), before_(bench().device.kernel_times()) {}
  ~KernelCounters() {
    for (const auto& [name, now] : bench().device.kernel_times()) {
      const gpu::KernelTime before = before_[name];
      if (now.calls > before.calls)
        state_.counters[name + "_ms"] = (now.total_ms - before.total_ms) / (now.calls - before.calls);
    }
  }

 private:
  benchmark::State& state_;
  std::map<std::string, gpu::KernelTime> before_;
};

void preprocess(benchmark::State& state) {
  auto& b = bench();
  const KernelCounters counters(state);
  for (auto _ : state) benchmark::DoNotOptimize(b.preprocessor.preprocess(b.frame));
}
void integrate(benchmark::State& state) {
  auto& b = bench();
  const FramePyramid surface = b.preprocessor.preprocess(b.frame);
  const KernelCounters counters(state);
  for (auto _ : state) benchmark::DoNotOptimize(b.integrator.integrate(surface, b.pose, b.volume, ++b.fused_count));
}
void raycast(benchmark::State& state) {
  auto& b = bench();
  const KernelCounters counters(state);
  for (auto _ : state) benchmark::DoNotOptimize(b.raycaster.raycast(b.volume, b.pose));
}
void align(benchmark::State& state) {
  auto& b = bench();
  const FramePyramid live = b.preprocessor.preprocess(b.frame);
  const SurfacePrediction model = b.raycaster.raycast(b.volume, b.pose);
  const Eigen::Isometry3d guess = b.pose * Eigen::Translation3d(0.01, 0.005, -0.01);
  const KernelCounters counters(state);
  for (auto _ : state) benchmark::DoNotOptimize(b.aligner.align(live, model, guess));
}
void polygonize(benchmark::State& state) {
  auto& b = bench();
  const KernelCounters counters(state);
  for (auto _ : state) benchmark::DoNotOptimize(b.polygonizer.polygonize(b.volume));
}
void render_scene(benchmark::State& state) {
  auto& b = bench();
  const KernelCounters counters(state);
  for (auto _ : state) benchmark::DoNotOptimize(b.renderer.render(b.pose));
}

BENCHMARK(preprocess)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(raycast)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(align)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(integrate)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(polygonize)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(render_scene)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace cairn
