// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Distance field: cost of updates, of queries, of a loop closure for half the map, and of other transforms of the same
// surface, for the choice of method.
#include <benchmark/benchmark.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "cairn/synthetic/scene.hpp"
#include "map/global_volume.hpp"
#include "preprocess/preprocess.hpp"
#include "spirv/trial_flood.comp.h"
#include "spirv/trial_separable.comp.h"
#include "synth/render.hpp"
#include "tests/bench/shaders/trial.h"
#include "volume/esdf.hpp"
#include "volume/integrate.hpp"

namespace cairn {
namespace {

constexpr int kFrames = 60;  // five seconds of the room

/// Room fused with its true poses.
struct Room {
  gpu::Device device;
  FuseOptions fuse;
  Camera camera = synthetic_camera();
  Scene scene = synthetic_scene("room");
  SceneRenderer renderer{device, scene, camera};
  Preprocessor preprocessor{device, camera, {}, 3, 1};
  Integrator integrator{device, camera, {}};
  Volume volume{device, fuse, 5.0f};
  std::vector<Brick> bricks;

  Room() {
    for (int i = 0; i < kFrames; ++i) {
      const Eigen::Isometry3d pose = scene.world_from_camera(i / 12.0);
      auto images = renderer.render(pose);
      add_noise(images, camera, "kinect", 1, i);
      const Frame frame{.depth = std::move(images.depth), .color = std::move(images.color)};
      integrator.integrate(preprocessor.preprocess(frame), pose, volume, static_cast<std::uint32_t>(i + 1));
    }
    bricks = volume.bricks();
    const auto free = volume.on_host().free_bricks();
    bricks.insert(bricks.end(), free.begin(), free.end());
  }
};

Room& room() {
  static Room instance;
  return instance;
}

EsdfOptions options_of(const benchmark::State& state) {
  return {.voxel_size = 0.01f * static_cast<float>(state.range(0))};
}

void make_a_field_anew(benchmark::State& state) {
  auto& r = room();
  Esdf esdf(r.device, r.fuse, options_of(state));
  esdf.update(r.volume, r.bricks);
  for (auto _ : state) (void)esdf.rebuild();
  state.counters["voxels"] = static_cast<double>(esdf.blocks()) * 4096;
}

/// Sites of the field in a dense box: voxels next to a sign change.
struct Box {
  Eigen::Vector3i size = Eigen::Vector3i::Zero();
  std::vector<std::uint32_t> sites;
};

Box box_of(const benchmark::State& state) {
  auto& r = room();
  const auto field = distances_of(r.device, r.volume.on_host(), r.fuse, options_of(state));
  const Eigen::AlignedBox3f bounds = field->bounds();
  Box box;
  box.size = (bounds.sizes() / field->voxel_size()).array().round().cast<int>() + 1;
  const Eigen::Vector3i& s = box.size;
  box.sites.resize(static_cast<std::size_t>(s.x()) * static_cast<std::size_t>(s.y()) * static_cast<std::size_t>(s.z()));
  std::size_t i = 0;
  for (int z = 0; z < s.z(); ++z)
    for (int y = 0; y < s.y(); ++y)
      for (int x = 0; x < s.x(); ++x) {
        const auto a = field->query(bounds.min() + field->voxel_size() * Eigen::Vector3i(x, y, z).cast<float>());
        const bool is_site = a.known && std::abs(a.distance) <= 0.5f * field->voxel_size();
        box.sites[i++] = is_site ? static_cast<std::uint32_t>(x | y << 10 | z << 20) : shader::kNone;
      }
  return box;
}

/// Share of some random voxels with a site farther than the nearest.
double share_of_wrong(gpu::Device& device, const Box& box, const gpu::Buffer& result) {
  std::vector<std::uint32_t> found(box.sites.size());
  gpu::Batch batch(device);
  batch.download(result, found);
  batch.run();
  const auto at = [](std::uint32_t s) {
    return Eigen::Vector3i(static_cast<int>(s & 1023), static_cast<int>(s >> 10 & 1023), static_cast<int>(s >> 20));
  };
  std::vector<Eigen::Vector3i> sites;
  for (const std::uint32_t site : box.sites)
    if (site != shader::kNone) sites.push_back(at(site));
  std::mt19937 random(1);
  std::uniform_int_distribution<std::size_t> any(0, found.size() - 1);
  constexpr int kSamples = 500;
  int wrong = 0;
  for (int n = 0; n < kSamples; ++n) {
    const auto i = static_cast<int>(any(random));
    const Eigen::Vector3i v(i % box.size.x(), i / box.size.x() % box.size.y(), i / (box.size.x() * box.size.y()));
    int min_squared = std::numeric_limits<int>::max();
    for (const Eigen::Vector3i& site : sites) min_squared = std::min(min_squared, (site - v).squaredNorm());
    wrong += found[static_cast<std::size_t>(i)] == shader::kNone ||
             (at(found[static_cast<std::size_t>(i)]) - v).squaredNorm() != min_squared;
  }
  return static_cast<double>(wrong) / kSamples;
}

void separable_exact_transform(benchmark::State& state) {
  auto& r = room();
  const Box box = box_of(state);
  gpu::Kernel<shader::SeparablePush> pass(r.device, "trial_separable", trial_separable_comp);
  const std::uint64_t bytes = 4 * box.sites.size();
  const gpu::Buffer source(r.device, bytes), first(r.device, bytes), second(r.device, bytes),
      stack(r.device, 2 * bytes);
  gpu::Batch batch(r.device);
  batch.upload(source, box.sites);
  batch.run();
  const Eigen::Vector3i& s = box.size;
  for (auto _ : state) {
    const auto run = [&](std::uint32_t axis, int lines, const gpu::Buffer& from, const gpu::Buffer& to) {
      const auto count = static_cast<std::uint32_t>(lines);
      pass(batch, {count, 1, 1}, {.size = s, .axis = axis, .lines = count}, {&from, &to, &stack});
    };
    run(2, s.x() * s.y(), source, first);
    run(1, s.x() * s.z(), first, second);
    run(0, s.y() * s.z(), second, first);
    batch.run();
  }
  state.counters["voxels"] = static_cast<double>(box.sites.size());
  state.counters["wrong"] = share_of_wrong(r.device, box, first);
}

void jump_flooding(benchmark::State& state) {
  auto& r = room();
  const Box box = box_of(state);
  gpu::Kernel<shader::FloodPush> flood(r.device, "trial_flood", trial_flood_comp);
  gpu::Buffer now(r.device, 4 * box.sites.size()), next(r.device, 4 * box.sites.size());
  gpu::Batch batch(r.device);
  for (auto _ : state) {
    state.PauseTiming();
    batch.upload(now, box.sites);
    batch.run();
    state.ResumeTiming();
    for (int reach = 128; reach >= 1; reach /= 2) {
      flood(batch, {static_cast<std::uint32_t>(box.sites.size()), 1, 1}, {.size = box.size, .reach = reach},
            {&now, &next});
      std::swap(now, next);
    }
    batch.run();
  }
  state.counters["voxels"] = static_cast<double>(box.sites.size());
  state.counters["wrong"] = share_of_wrong(r.device, box, now);
}

/// Queries a million random points, mostly in known space.
void answer_a_million_points(benchmark::State& state) {
  auto& r = room();
  const auto field = distances_of(r.device, r.volume.on_host(), r.fuse, options_of(state));
  std::mt19937 random(1);
  std::vector<Eigen::Vector3f> points;
  std::uniform_int_distribution<std::size_t> block(0, field->blocks().size() - 1);
  std::uniform_real_distribution<float> inside(0.0f, 16.0f);
  while (points.size() < 1000000) {
    const Eigen::Vector3f at = 16.0f * field->blocks()[block(random)].index.cast<float>();
    points.emplace_back(field->origin() +
                        field->voxel_size() * (at + Eigen::Vector3f(inside(random), inside(random), inside(random))));
  }
  std::vector<DistanceField::Answer> answers(points.size());
  for (auto _ : state) field->query(points, answers);
  state.counters["points_per_second"] =
      benchmark::Counter(static_cast<double>(points.size()), benchmark::Counter::kIsIterationInvariantRate);
  state.counters["known"] =
      static_cast<double>(std::count_if(answers.begin(), answers.end(), [](const auto& a) { return a.known; }));
}

/// Two submaps of the room; the second moves back and forth as after a loop closure.
void follow_a_loop(benchmark::State& state) {
  auto& r = room();
  std::vector<std::shared_ptr<const BrickTree>> trees;
  Atlas atlas;
  for (int s = 0; s < 2; ++s) {
    const Brick shift(40 * s, 0, 0);
    BrickTree tree;
    for (const Brick& brick : r.volume.on_host().bricks())
      tree.put(brick + shift, std::span<const std::uint64_t, 512>(r.volume.host().find(brick), 512));
    for (const Brick& brick : r.volume.host().free_bricks())
      tree.mark_free(brick + shift, r.volume.host().free_voxels(brick));
    trees.push_back(std::make_shared<const BrickTree>(std::move(tree)));
    Keyframe keyframe{.timestamp = static_cast<double>(s), .submap = static_cast<std::size_t>(s), .follows = s > 0};
    keyframe.submap_from_camera.translation() = Eigen::Vector3d(3.2 * s, 0, 0);
    keyframe.odometry_from_camera = keyframe.submap_from_camera;
    atlas.add(keyframe);
  }
  GlobalVolume world(r.device, r.fuse);
  const auto update = [&] {
    std::vector<PlacedSubmap> placed;
    for (std::size_t s = 0; s < 2; ++s)
      placed.push_back({s, std::make_shared<const BrickSet>(trees[s]->bricks()), Deformation(atlas, s)});
    return world.update(
        placed, [&](std::size_t s, const BrickBox&) { return trees[s]; }, [&](std::size_t s) { return trees[s]; });
  };
  Esdf esdf(r.device, r.fuse, options_of(state));
  esdf.update(world.bricks(), update());
  double side = 0.06;
  std::size_t changed_bricks = 0, moved = 0;
  for (auto _ : state) {
    state.PauseTiming();
    atlas.world_from_camera[1].pretranslate(Eigen::Vector3d(side, 0, side / 2));
    side = -side;
    const std::vector<Brick> changed = update();
    state.ResumeTiming();
    moved = static_cast<std::size_t>(esdf.update(world.bricks(), changed).sites);
    changed_bricks = changed.size();
  }
  state.counters["changed_bricks"] = static_cast<double>(changed_bricks);
  state.counters["patches"] = static_cast<double>(moved);
  state.counters["voxels"] = static_cast<double>(esdf.blocks()) * 4096;
}

BENCHMARK(make_a_field_anew)->Arg(2)->Arg(4)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(separable_exact_transform)->Arg(2)->Arg(4)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(jump_flooding)->Arg(2)->Arg(4)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(answer_a_million_points)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(follow_a_loop)->Arg(2)->Arg(4)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace cairn
