// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Cost of a loop closure: optimization of a graph of 2,000 keyframes, and deformation of the world's volume from 30
// submaps.
#include <benchmark/benchmark.h>

#include <filesystem>
#include <numbers>

#include "cairn/synthetic/scene.hpp"
#include "loop_closing/match.hpp"
#include "map/global_volume.hpp"
#include "mesh/clean.hpp"
#include "mesh/gltf.hpp"
#include "preprocess/preprocess.hpp"
#include "synth/render.hpp"
#include "volume/integrate.hpp"
#include "volume/polygonize.hpp"

namespace cairn {
namespace {

constexpr std::size_t kSubmaps = 30, kKeyframes = 2000;
constexpr double kShift = 2.4;  // meters from one submap to the next: they overlap by half

/// Thirty copies of a second of the room, in a row, with keyframes along the row.
struct Bench {
  gpu::Device device;
  FuseOptions fuse;
  Atlas atlas;
  std::vector<std::shared_ptr<const BrickTree>> voxels;
  GlobalVolume world{device, fuse};
  Polygonizer polygonizer{device};

  Bench() {
    const Camera camera = synthetic_camera();
    const Scene scene = synthetic_scene("room");
    Preprocessor preprocessor(device, camera, {}, 3, 1);
    Integrator integrator(device, camera, {});
    SceneRenderer renderer(device, scene, camera);
    Volume volume(device, fuse, 5.0f);
    for (int i = 0; i < 10; ++i) {
      const Eigen::Isometry3d pose = scene.world_from_camera(0.2 * i);
      const auto images = renderer.render(pose);
      Frame frame{.depth = images.depth, .color = images.color};
      integrator.integrate(preprocessor.preprocess(frame), pose, volume, static_cast<std::uint32_t>(i + 1));
    }
    const BrickTree& room = volume.on_host();
    for (std::size_t s = 0; s < kSubmaps; ++s) {
      const Brick shift(static_cast<int>(kShift / 0.08 * static_cast<double>(s)), 0, 0);
      BrickTree copy;
      for (const Brick& brick : room.bricks())
        copy.put(brick + shift, std::span<const std::uint64_t, 512>(room.find(brick), 512));
      voxels.push_back(std::make_shared<const BrickTree>(std::move(copy)));
    }
    for (std::size_t k = 0; k < kKeyframes; ++k) {
      const double along = static_cast<double>(k) / kKeyframes * kSubmaps;
      Keyframe keyframe{
          .timestamp = static_cast<double>(k), .submap = static_cast<std::size_t>(along), .follows = k > 0};
      keyframe.submap_from_camera = scene.world_from_camera(0.03 * static_cast<double>(k % 67));
      keyframe.submap_from_camera.pretranslate(Eigen::Vector3d(kShift * along, 0, 0));
      keyframe.odometry_from_camera = keyframe.submap_from_camera;
      keyframe.information = 1e6 * Matrix6d::Identity();
      atlas.add(keyframe);
    }
  }
  /// Bends the row: moves its end aside by `meters`.
  void bend(double meters) {
    for (std::size_t k = 0; k < kKeyframes; ++k) {
      const double share = static_cast<double>(k) / kKeyframes;
      atlas.world_from_camera[k] = atlas.keyframes[k].submap_from_camera;
      atlas.world_from_camera[k].pretranslate(Eigen::Vector3d(0, 0, meters * share * share));
    }
  }
  std::vector<Brick> update() {
    std::vector<PlacedSubmap> placed;
    for (std::size_t s = 0; s < kSubmaps; ++s)
      placed.push_back({s, std::make_shared<const BrickSet>(voxels[s]->bricks()), Deformation(atlas, s)});
    return world.update(
        placed, [&](std::size_t s, const BrickBox&) { return voxels[s]; }, [&](std::size_t s) { return voxels[s]; });
  }
};

Bench& bench() {
  static Bench instance;
  return instance;
}

void move_thirty_submaps(benchmark::State& state) {
  auto& b = bench();
  b.bend(0);
  (void)b.update();
  double side = 0.5;
  const double before = b.device.kernel_times().at("submap_merge").total_ms;
  std::size_t bricks = 0;
  for (auto _ : state) {
    b.bend(side);
    bricks = b.update().size();
    side = -side;
  }
  state.counters["submap_merge_ms"] =
      (b.device.kernel_times().at("submap_merge").total_ms - before) / static_cast<double>(state.iterations());
  state.counters["world_bricks"] = static_cast<double>(bricks);
  std::size_t sources = 0;
  for (const auto& tree : b.voxels) sources += tree->size();
  state.counters["submap_bricks"] = static_cast<double>(sources);
}

/// Surface of the row.
const Mesh& surface(benchmark::State& state) {
  static const Mesh mesh = [] {
    auto& b = bench();
    (void)b.update();
    Volume complete(b.device, b.fuse, 5.0f);
    complete.adopt(b.world.release());
    return b.polygonizer.polygonize(complete);
  }();
  state.counters["triangles"] = static_cast<double>(mesh.triangles.size());
  return mesh;
}

void mesh_the_world(benchmark::State& state) {
  auto& b = bench();
  (void)b.update();
  Volume complete(b.device, b.fuse, 5.0f);
  complete.adopt(b.world.release());
  std::size_t triangles = 0;
  const auto before = b.device.kernel_times();
  for (auto _ : state) triangles = b.polygonizer.polygonize(complete).triangles.size();
  state.counters["triangles"] = static_cast<double>(triangles);
  for (const auto& [kernel, time] : b.device.kernel_times())
    if (kernel.starts_with("polygonize"))
      state.counters[kernel + "_ms"] = (time.total_ms - (before.contains(kernel) ? before.at(kernel).total_ms : 0)) /
                                       static_cast<double>(state.iterations());
}

void clean_the_world(benchmark::State& state) {
  const Mesh& mesh = surface(state);
  for (auto _ : state) {
    state.PauseTiming();
    Mesh cleaned = mesh;
    state.ResumeTiming();
    (void)clean(cleaned, {});
    state.counters["left"] = static_cast<double>(cleaned.triangles.size());
  }
}

void write_the_world(benchmark::State& state) {
  const Mesh& mesh = surface(state);
  const auto file = std::filesystem::temp_directory_path() / "cairn_bench.glb";
  for (auto _ : state) {
    GltfWriter writer(GltfOptions{.file = file});
    writer.add("map", mesh);
    writer.write(file);
  }
  std::filesystem::remove(file);
}

/// A circular path with a loop closure at its end.
void optimize_two_thousand_keyframes(benchmark::State& state) {
  PoseGraph drifted;
  const auto truth = [](std::size_t k) {
    const double angle = 2 * std::numbers::pi * static_cast<double>(k) / kKeyframes;
    Eigen::Isometry3d t(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()));
    t.translation() = Eigen::Vector3d(30 * std::cos(angle), 0, -30 * std::sin(angle));
    return t;
  };
  Vector6d drift;
  drift << 0.0002, -0.0001, 0.0003, 0.0005, 0.0002, -0.0004;
  const Matrix6d information = inflate_information(1e8 * Matrix6d::Identity());
  for (std::size_t k = 0; k < kKeyframes; ++k) {
    if (k == 0) {
      drifted.world_from_node.push_back(truth(0));
      continue;
    }
    const Eigen::Isometry3d step = truth(k - 1).inverse() * truth(k) * retract(drift);
    drifted.world_from_node.push_back(drifted.world_from_node.back() * step);
    drifted.edges.push_back({.i = k - 1, .j = k, .i_from_j = step, .information = information});
  }
  for (std::size_t k = 0; k < 40; ++k)
    drifted.edges.push_back({.i = k,
                             .j = kKeyframes - 40 + k,
                             .i_from_j = truth(k).inverse() * truth(kKeyframes - 40 + k),
                             .information = information,
                             .is_loop_closure = true});
  double cost = 0;
  for (auto _ : state) {
    PoseGraph graph = drifted;
    cost = optimize(graph).cost;
  }
  state.counters["cost"] = cost;
}

BENCHMARK(move_thirty_submaps)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(mesh_the_world)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(clean_the_world)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(write_the_world)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(optimize_two_thousand_keyframes)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace cairn
