// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Cost of place recognition among 20,000 keyframes: views of rendered rooms, each with a hundred variants that differ
// in an eighth of the bits, like views of the same corner. Real buildings have more places with fewer views of each.
#include <benchmark/benchmark.h>

#include <random>

#include "cairn/synthetic/scene.hpp"
#include "place/keyframe_database.hpp"
#include "synth/render.hpp"

namespace cairn {
namespace {

constexpr int kViews = 200, kTimes = 100;

Features another_view(Features features, std::mt19937& random) {
  for (auto& descriptor : features.descriptors)
    for (std::uint8_t& byte : descriptor) byte ^= static_cast<std::uint8_t>(random() & random() & random());
  return features;
}

struct Bench {
  std::vector<Features> views;
  KeyframeDatabase places;
  std::mt19937 random{1};

  Bench() {
    gpu::Device device;
    const Camera camera = synthetic_camera();
    for (const char* name : {"room", "flat"}) {
      const Scene scene = synthetic_scene(name);
      SceneRenderer renderer(device, scene, camera);
      for (int i = 0; i < kViews / 2; ++i) {
        const auto images = renderer.render(scene.world_from_camera(0.5 * i));
        views.push_back(extract_features(images.color, images.depth, camera));
      }
    }
    for (int i = 0; i < kTimes; ++i)
      for (const Features& view : views) places.add(std::nullopt, another_view(view, random));
  }
};

Bench& bench() {
  static Bench instance;
  return instance;
}

void find_among_twenty_thousand(benchmark::State& state) {
  Bench& b = bench();
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(b.places.query(b.views[i++ % b.views.size()], 3));
  state.counters["bytes_in_memory"] = static_cast<double>(b.places.bytes().in_memory);
  state.counters["bytes_in_files"] = static_cast<double>(b.places.bytes().in_files);
}

void add_a_thousand(benchmark::State& state) {
  Bench& b = bench();
  for (auto _ : state) {
    KeyframeDatabase places;
    for (std::size_t i = 0; i < 1000; ++i) places.add(std::nullopt, b.views[i % b.views.size()]);
  }
}

BENCHMARK(find_among_twenty_thousand)->Unit(benchmark::kMillisecond);
BENCHMARK(add_a_thousand)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace cairn
