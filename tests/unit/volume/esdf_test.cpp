// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/esdf.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cstdio>
#include <cstring>
#include <limits>
#include <map>
#include <memory>
#include <thread>

#include "base/latest_value.hpp"
#include "cairn/io/source.hpp"
#include "map/global_volume.hpp"
#include "preprocess/preprocess.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"
#include "support/volumes.hpp"
#include "volume/integrate.hpp"
#include "volume/vdb/map_vdb.hpp"

namespace cairn {
namespace {

const FuseOptions kFuse{.voxel_size = 0.02f, .truncation = 0.08f};

float sphere(const Eigen::Vector3f& p) { return p.norm() - 0.4f; }
float ball_over_floor(const Eigen::Vector3f& p) {
  return std::min((p - Eigen::Vector3f(0.2f, 0, 0)).norm() - 0.25f, 0.5f - p.y());
}
float floor_alone(const Eigen::Vector3f& p) { return 0.5f - p.y(); }

const Eigen::Vector3f kLow = Eigen::Vector3f::Constant(-0.9f), kHigh = Eigen::Vector3f::Constant(0.9f);

struct Difference {
  double mean = 0, max = 0;  // voxels
  int voxels = 0, states = 0;
};

/// Difference over all voxels of two fields of the same map.
Difference difference(const DistanceField& a, const DistanceField& b) {
  Difference d;
  std::map<std::array<int, 3>, const DistanceField::Block*> of_b;
  for (const auto& [at, samples] : b.blocks()) of_b[{at.x(), at.y(), at.z()}] = samples.get();
  for (const auto& [at, samples] : a.blocks()) {
    const auto other = of_b.find({at.x(), at.y(), at.z()});
    for (std::size_t i = 0; i < 4096; ++i) {
      const float x = (*samples)[i],
                  y = other == of_b.end() ? std::numeric_limits<float>::quiet_NaN() : (*other->second)[i];
      d.states += std::isnan(x) != std::isnan(y);
      if (std::isnan(x) || std::isnan(y)) continue;
      const double by = std::abs(x - y) / a.voxel_size();
      d.mean += by, d.max = std::max(d.max, by), ++d.voxels;
    }
  }
  d.mean /= std::max(1, d.voxels);
  return d;
}

/// Errors against a distance function, at the voxels, in voxels.
template <class Distance>
Difference error(const DistanceField& field, const Distance& distance) {
  Difference d;
  for (const auto& [at, samples] : field.blocks())
    for (int i = 0; i < 4096; ++i) {
      const float found = (*samples)[static_cast<std::size_t>(i)];
      if (std::isnan(found)) continue;
      const Eigen::Vector3i voxel = DistanceField::voxel(at, i);
      const Eigen::Vector3f p = field.origin() + field.voxel_size() * voxel.cast<float>();
      const float truth = distance(p);
      const double by = std::abs(found - truth) / field.voxel_size();
      d.mean += by, d.max = std::max(d.max, by), ++d.voxels;
      d.states += std::abs(truth) > 0.001f && (found < 0) != (truth < 0);
    }
  d.mean /= std::max(1, d.voxels);
  return d;
}

TEST(Esdf, FindsExactDistancesAroundASphereAtEveryScale) {
  const BrickTree tree = distance_bricks(kFuse, kLow, kHigh, sphere);
  for (const float voxel : {0.02f, 0.04f, 0.08f}) {
    const auto field = distances_of(test_device(), tree, kFuse, {.voxel_size = voxel});
    const Difference d = error(*field, sphere);
    // Patches are planes: the error is half of the sphere's curvature over a cell, and accumulates deep inside.
    EXPECT_LT(d.mean, 0.08) << voxel;
    EXPECT_LT(d.max, 1.0) << voxel;
    EXPECT_EQ(d.states, 0) << voxel;
    EXPECT_NEAR(d.voxels, std::pow(12 * 8 * 0.02 / static_cast<double>(voxel), 3), 1e-3 * d.voxels) << voxel;
  }
}

TEST(Esdf, EqualsARebuildAfterSurfacesWereAddedAndRemoved) {
  const BrickTree with = distance_bricks(kFuse, kLow, kHigh, ball_over_floor);
  const BrickTree without = distance_bricks(kFuse, kLow, kHigh, floor_alone);
  Esdf esdf(test_device(), kFuse, {.voxel_size = 0.02f});
  esdf.update(with, with.bricks());
  // Bricks in the ball's truncation band change.
  std::vector<Brick> changed;
  for (const Brick& brick : with.bricks())
    if (std::memcmp(with.find(brick), without.find(brick), sizeof(BrickVoxels)) != 0) changed.push_back(brick);
  ASSERT_GT(changed.size(), 20u);
  ASSERT_LT(changed.size(), with.size() / 2);
  for (int round = 0; round < 2; ++round) {
    const bool is_there = round == 1;
    const Esdf::Updated updated = esdf.update(is_there ? with : without, changed);
    EXPECT_FALSE(updated.rebuilt);
    EXPECT_GT(updated.sites, 500);
    const auto field = esdf.field();
    const auto fresh = distances_of(test_device(), is_there ? with : without, kFuse, {.voxel_size = 0.02f});
    const Difference d = difference(*field, *fresh);
    EXPECT_EQ(d.states, 0);
    // Vector propagation may select a neighbor of the nearest patch, here as in a rebuild.
    EXPECT_LT(d.mean, 0.002);
    EXPECT_LT(d.max, 0.3);
  }
}

TEST(Esdf, DoesNothingWithoutChanges) {
  const BrickTree tree = distance_bricks(kFuse, kLow, kHigh, sphere);
  Esdf esdf(test_device(), kFuse, {});
  esdf.update(tree, tree.bricks());
  const auto before = esdf.field();
  const Esdf::Updated updated = esdf.update(tree, tree.bricks());
  EXPECT_EQ(updated.sites, 0);
  EXPECT_EQ(updated.voxels, 0);
  const auto after = esdf.field();
  ASSERT_EQ(before->blocks().size(), after->blocks().size());
  for (std::size_t i = 0; i < before->blocks().size(); ++i)
    EXPECT_EQ(before->blocks()[i].samples, after->blocks()[i].samples);  // shared
}

/// Number of blocks with different bits in two fields; all if the sets of blocks differ.
std::size_t blocks_that_differ(const DistanceField& a, const DistanceField& b) {
  if (a.blocks().size() != b.blocks().size()) return std::max(a.blocks().size(), b.blocks().size());
  std::size_t differ = 0;
  for (std::size_t i = 0; i < a.blocks().size(); ++i)
    differ +=
        a.blocks()[i].index != b.blocks()[i].index ||
        std::memcmp(a.blocks()[i].samples->data(), b.blocks()[i].samples->data(), sizeof(DistanceField::Block)) != 0;
  return differ;
}

TEST(Esdf, IsDeterministic) {
  const BrickTree tree = distance_bricks(kFuse, kLow, kHigh, ball_over_floor);
  const auto a = distances_of(test_device(), tree, kFuse, {}), b = distances_of(test_device(), tree, kFuse, {});
  EXPECT_EQ(blocks_that_differ(*a, *b), 0u);
}

TEST(Esdf, IsIdenticalIfReadByAddress) {
  const BrickTree with = distance_bricks(kFuse, kLow, kHigh, ball_over_floor);
  const BrickTree without = distance_bricks(kFuse, kLow, kHigh, floor_alone);
  const EsdfOptions options{.voxel_size = 0.02f};
  Esdf texels(test_device(), kFuse, options), addresses(test_device(), kFuse, options, 1);
  for (const BrickTree* map : {&with, &without, &with}) {
    EXPECT_EQ(texels.update(*map, with.bricks()).sites, addresses.update(*map, with.bricks()).sites);
    const Difference d = difference(*texels.field(), *addresses.field());
    EXPECT_EQ(d.states, 0);
    EXPECT_LT(d.mean, 0.002);  // one of them is rebuilt by waves alone
    EXPECT_LT(d.max, 0.3);
  }
}

TEST(Esdf, RebuildsALargeBoxInParts) {
  BrickTree map;
  for (const float at : {0.0f, 6.0f, -9.0f}) {
    const Eigen::Vector3f center(at, -at / 2, at / 3);
    const BrickTree part = distance_bricks(kFuse, center + kLow, center + kHigh,
                                           [&](const Eigen::Vector3f& p) { return (p - center).norm() - 0.3f; });
    for (const Brick& brick : part.bricks()) map.put(brick, std::span<const std::uint64_t, 512>(part.find(brick), 512));
  }
  // Nine million cells in parts of four million, with borders inside the balls.
  const EsdfOptions options{.max_distance = 0.4f};
  Esdf complete(test_device(), kFuse, options), parts(test_device(), kFuse, options, 1 << 22);
  complete.update(map, map.bricks()), parts.update(map, map.bricks());
  EXPECT_EQ(complete.rebuild().steps, parts.rebuild().steps);
  const Difference d = difference(*complete.field(), *parts.field());
  EXPECT_GT(d.voxels, 200000);
  EXPECT_EQ(d.states, 0);
  EXPECT_LT(d.max, 0.02);  // lengths are rounded relative to another corner: of two equally distant sites either may be
                           // found
}

/// Scattered particles of one voxel: few kinds of patches, and thus many voxels with two equally distant patches.
float crumbs(const Eigen::Vector3f& p) {
  const Eigen::Array3i at = (p / kFuse.voxel_size).array().round().cast<int>();
  std::uint32_t hash = static_cast<std::uint32_t>(at.x()) * 73856093u ^ static_cast<std::uint32_t>(at.y()) * 19349669u ^
                       static_cast<std::uint32_t>(at.z()) * 83492791u;
  hash = (hash ^ hash >> 15) * 0x2c1b3c6du;
  hash = (hash ^ hash >> 12) * 0x297a2d39u;
  return ((hash ^ hash >> 15) % 32 == 0 ? -0.25f : 0.25f) * kFuse.truncation;
}

TEST(Esdf, IsDeterministicAtEqualDistances) {
  const BrickTree tree = distance_bricks(kFuse, 0.5f * kLow, 0.5f * kHigh, crumbs);
  const EsdfOptions options{.voxel_size = kFuse.voxel_size};
  const auto first = distances_of(test_device(), tree, kFuse, options);
  std::atomic<bool> is_over = false;  // a busy core changes the order of threads
  std::thread load([&] {
    while (!is_over) std::this_thread::yield();
  });
  for (int i = 0; i < 8; ++i)
    EXPECT_EQ(blocks_that_differ(*first, *distances_of(test_device(), tree, kFuse, options)), 0u) << i;
  is_over = true;
  load.join();
}

TEST(Esdf, ProcessesADuplicateBrickOnce) {
  const BrickTree tree = distance_bricks(kFuse, 0.5f * kLow, 0.5f * kHigh, crumbs);
  std::vector<Brick> twice = tree.bricks();
  const std::vector<Brick> once = twice;
  twice.insert(twice.end(), once.begin(), once.end());
  const EsdfOptions options{.voxel_size = kFuse.voxel_size};
  Esdf a(test_device(), kFuse, options), b(test_device(), kFuse, options);
  EXPECT_EQ(a.update(tree, once).sites, b.update(tree, twice).sites);
  EXPECT_EQ(blocks_that_differ(*a.field(), *b.field()), 0u);
}

TEST(Esdf, SeparatesUnknownFromFreeAndCrossesUnknownSpace) {
  // A floor, free space far above it, and unknown space between.
  BrickTree tree = distance_bricks(kFuse, {-0.5f, 0.4f, -0.5f}, {0.5f, 0.6f, 0.5f}, floor_alone);
  for (int x = -3; x < 3; ++x)
    for (int z = -3; z < 3; ++z) tree.mark_free({x, -4, z});
  const auto field = distances_of(test_device(), tree, kFuse, {});
  const auto free = field->query({0.0f, -0.56f, 0.0f}), between = field->query({0.0f, -0.1f, 0.0f});
  EXPECT_TRUE(free.known);
  EXPECT_NEAR(free.distance, 1.06f, 0.01f);
  EXPECT_NEAR(free.gradient.y(), -1.0f, 0.02f);
  EXPECT_FALSE(between.known);
  EXPECT_TRUE(field->query({0.0f, 0.55f, 0.0f}).known);
  EXPECT_LT(field->query({0.0f, 0.55f, 0.0f}).distance, 0.0f);
}

TEST(Esdf, GrowsInAllDirectionsAndDropsRemovedSurfaces) {
  Esdf esdf(test_device(), kFuse, {});
  BrickTree map;
  std::vector<Brick> first;
  for (const float at : {0.0f, 6.0f, -9.0f}) {
    const Eigen::Vector3f center(at, -at / 2, at / 3);
    const BrickTree part = distance_bricks(kFuse, center + kLow, center + kHigh,
                                           [&](const Eigen::Vector3f& p) { return (p - center).norm() - 0.3f; });
    for (const Brick& brick : part.bricks()) map.put(brick, std::span<const std::uint64_t, 512>(part.find(brick), 512));
    if (first.empty()) first = part.bricks();
    esdf.update(map, part.bricks());
    EXPECT_NEAR(esdf.field()->query(center + Eigen::Vector3f(0.6f, 0, 0)).distance, 0.3f, 0.005f) << at;
  }
  for (const Brick& brick : first) map.erase(brick);
  esdf.update(map, first);
  EXPECT_FALSE(esdf.field()->query({0.6f, 0, 0}).known);
  EXPECT_TRUE(esdf.field()->query({6.6f, -3.0f, 2.0f}).known);
}

TEST(Esdf, FollowsALoopClosureOfHalfTheMap) {
  // Two submaps of a wall with a ball in front; the second keyframe moves as after a loop closure.
  const auto scene = [](const Eigen::Vector3f& p) {
    return std::min(0.6f - p.z(), (p - Eigen::Vector3f(0, 0, 0.1f)).norm() - 0.2f);
  };
  std::vector<std::shared_ptr<const BrickTree>> trees;
  Atlas atlas;
  for (int s = 0; s < 2; ++s) {
    const Eigen::Vector3f shift(1.6f * static_cast<float>(s), 0, 0);
    BrickTree tree =
        distance_bricks(kFuse, shift + Eigen::Vector3f(-0.8f, -0.6f, -0.3f), shift + Eigen::Vector3f(0.7f, 0.6f, 0.7f),
                        [&](const Eigen::Vector3f& p) { return scene(p - shift); });
    for (int x = 0; x < 4; ++x) tree.mark_free({10 * s + x - 2, 0, -4});
    trees.push_back(std::make_shared<const BrickTree>(std::move(tree)));
    Keyframe keyframe{.timestamp = static_cast<double>(s), .submap = static_cast<std::size_t>(s), .follows = s > 0};
    keyframe.submap_from_camera.translation() = shift.cast<double>() - Eigen::Vector3d(0, 0, 1);
    keyframe.odometry_from_camera = keyframe.submap_from_camera;
    atlas.add(keyframe);
  }
  GlobalVolume world(test_device(), kFuse);
  const auto update = [&] {
    std::vector<PlacedSubmap> placed;
    for (std::size_t s = 0; s < 2; ++s)
      placed.push_back({s, std::make_shared<const BrickSet>(trees[s]->bricks()), Deformation(atlas, s)});
    return world.update(
        placed, [&](std::size_t s, const BrickBox&) { return trees[s]; }, [&](std::size_t s) { return trees[s]; });
  };
  Esdf esdf(test_device(), kFuse, {.voxel_size = 0.02f});
  esdf.update(world.bricks(), update());
  EXPECT_TRUE(esdf.field()->query({1.6f, 0.08f, -0.56f}).known);  // in a free brick
  atlas.world_from_camera[1].pretranslate(Eigen::Vector3d(0.05, 0.013, -0.07));
  const std::vector<Brick> changed = update();
  ASSERT_GT(changed.size(), 50u);
  esdf.update(world.bricks(), changed);
  const auto moved = esdf.field();
  const auto fresh = distances_of(test_device(), world.bricks(), kFuse, {.voxel_size = 0.02f});
  const Difference d = difference(*moved, *fresh);
  EXPECT_EQ(d.states, 0);
  EXPECT_LT(d.mean, 0.05);  // patches that moved by less than a quarter of a voxel stay
  EXPECT_LT(d.max, 0.6);
  EXPECT_NEAR(moved->query({1.65f, 0.013f, -0.37f}).distance, 0.2f, 0.02f);
}

TEST(Esdf, EqualsARebuildAllAlongARecording) {
  CAIRN_REQUIRE_DATA("7scenes_redkitchen_600");
  const auto folder = data_folder() / "7scenes_redkitchen_600";
  const auto source =
      with_poses(open_source(folder, {.range = {.begin = 0, .end = 180, .step = 6}}), recorded_truth(folder));
  const FuseOptions fuse;
  Preprocessor preprocessor(test_device(), source->rig(), {}, 3, 1);
  Integrator integrator(test_device(), preprocessor.camera(), {});
  Volume volume(test_device(), fuse, 5.0f);
  Esdf live(test_device(), fuse, {});
  std::uint32_t frames = 0;
  double mean = 0, max_spread = 0, mean_of_new_fields = 0;
  int times = 0;
  while (const auto frame = source->next()) {
    const IntegrationResult fused =
        integrator.integrate(preprocessor.preprocess(*frame), *frame->world_from_camera, volume, ++frames);
    std::vector<Brick> changed = fused.changed;
    changed.insert(changed.end(), fused.newly_free.begin(), fused.newly_free.end());
    live.update(volume, changed);
    if (frames % 10 != 0) continue;
    // A rebuild from the same patches, and a new field of the current map.
    const auto before = live.field();
    live.rebuild();
    const Difference spread = difference(*before, *live.field());
    EXPECT_EQ(spread.states, 0);
    EXPECT_LT(spread.mean, 0.02);
    EXPECT_LT(spread.max, 3.0);
    mean += spread.mean, max_spread = std::max(max_spread, spread.max), ++times;
    if (frames == 30) {
      const auto fresh = distances_of(test_device(), volume.on_host(), fuse, {});
      const Difference made = difference(*before, *fresh);
      EXPECT_LT(made.states, 1e-3 * made.voxels);
      EXPECT_LT(made.mean, 0.15);  // patches stay until they moved by a quarter of a voxel
      mean_of_new_fields = made.mean;
    }
  }
  std::printf("spread anew %d times: mean %.4f, max %.2f voxels; made anew: mean %.3f voxels\n", times, mean / times,
              max_spread, mean_of_new_fields);
}

TEST(Esdf, RejectsAVoxelSizeThatIsNoMultipleOfTheMaps) {
  for (const float voxel : {0.03f, 0.01f, 0.32f})
    EXPECT_THROW(Esdf(test_device(), kFuse, {.voxel_size = voxel}), std::runtime_error) << voxel;
}

TEST(DistanceField, InterpolatesBetweenVoxelsAndIsUnknownBeyond) {
  const auto field =
      distances_of(test_device(), distance_bricks(kFuse, kLow, kHigh, sphere), kFuse, {.voxel_size = 0.02f});
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < 500; ++i) {
    const float a = 0.1f * static_cast<float>(i), r = 0.25f + 0.001f * static_cast<float>(i);
    points.emplace_back(r * std::cos(a), r * std::sin(a) * 0.8f, r * std::sin(a) * 0.6f);
  }
  std::vector<DistanceField::Answer> answers(points.size());
  field->query(points, answers);
  float sum = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    ASSERT_TRUE(answers[i].known);
    EXPECT_NEAR(answers[i].distance, sphere(points[i]), 0.003f);
    const float angle = std::acos(std::min(1.0f, answers[i].gradient.dot(points[i].normalized())));
    EXPECT_LT(angle, 0.15f) << i;  // the sphere consists of patches of 2 cm, with 0.05 radians between neighbors
    sum += angle;
  }
  EXPECT_LT(sum / static_cast<float>(points.size()), 0.035f);
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinite = std::numeric_limits<float>::infinity();
  for (const Eigen::Vector3f& p : {Eigen::Vector3f(kNan, 0, 0), Eigen::Vector3f(0, kInfinite, 0),
                                   Eigen::Vector3f(0, 0, 1e30f), Eigen::Vector3f(50, 0, 0)})
    EXPECT_FALSE(field->query(p).known) << p.transpose();
  std::vector<DistanceField::Answer> too_few(2);
  EXPECT_THROW(field->query(points, too_few), std::invalid_argument);
}

TEST(DistanceField, AnswersEquallyInSeparateArrays) {
  const auto field =
      distances_of(test_device(), distance_bricks(kFuse, kLow, kHigh, sphere), kFuse, {.voxel_size = 0.02f});
  std::vector<Eigen::Vector3f> points{{50, 0, 0}};
  for (int i = 0; i < 9999; ++i) points.emplace_back(0.5f * Eigen::Vector3f::Random());
  std::vector<DistanceField::Answer> answers(points.size());
  field->query(points, answers);
  std::vector<float> distances(points.size());
  std::vector<Eigen::Vector3f> gradients(points.size());
  const auto known = std::make_unique<bool[]>(points.size());
  field->query(points, distances, gradients, std::span(known.get(), points.size()));
  EXPECT_TRUE(std::isnan(distances[0]));
  for (std::size_t i = 0; i < points.size(); ++i) {
    ASSERT_EQ(known[i], answers[i].known);
    ASSERT_TRUE(!known[i] || distances[i] == answers[i].distance);
    ASSERT_EQ(gradients[i], answers[i].gradient);
  }
  EXPECT_THROW(field->query(points, distances, std::span(gradients).first(2), std::span(known.get(), points.size())),
               std::invalid_argument);
}

TEST(DistanceField, CanBeQueriedDuringAnUpdate) {
  const BrickTree with = distance_bricks(kFuse, kLow, kHigh, ball_over_floor);
  const BrickTree without = distance_bricks(kFuse, kLow, kHigh, floor_alone);
  Esdf esdf(test_device(), kFuse, {});
  esdf.update(with, with.bricks());
  LatestValue<DistanceField> newest;
  newest.put(esdf.field());
  std::atomic<bool> ended = false;
  std::atomic<int> wrong = 0, asked = 0;
  std::thread planner([&] {
    while (!ended) {
      const std::shared_ptr<const DistanceField> field = newest.get();
      const float d = field->query({0.2f, 0.05f, 0.3f}).distance;  // 0.05 with the ball, 0.45 without it
      wrong += std::abs(d - ball_over_floor({0.2f, 0.05f, 0.3f})) > 0.01f && std::abs(d - 0.45f) > 0.01f;
      ++asked;
    }
  });
  for (int i = 0; i < 6; ++i) {
    const BrickTree& map = i % 2 == 0 ? without : with;
    esdf.update(map, map.bricks());
    newest.put(esdf.field());
  }
  ended = true;
  planner.join();
  EXPECT_EQ(wrong, 0);
  EXPECT_GT(asked, 0);
}

TEST(DistanceField, RoundTripsThroughItsFile) {
  const auto field = distances_of(test_device(), distance_bricks(kFuse, kLow, kHigh, sphere), kFuse, {});
  const TemporaryFolder folder;
  write_distances(folder / "esdf.vdb", *field);
  const DistanceField read = DistanceField::read(folder / "esdf.vdb");
  const Difference d = difference(*field, read);
  EXPECT_EQ(d.states, 0);
  EXPECT_EQ(d.max, 0.0);
  EXPECT_EQ(read.voxel_size(), field->voxel_size());
  EXPECT_TRUE(read.origin().isApprox(field->origin()));
  EXPECT_EQ(read.max_distance(), field->max_distance());
  write_grids(folder / "map.vdb", distance_bricks(kFuse, kLow, kHigh, sphere),
              {.voxel_size = 0.02f, .truncation = 0.08f});
  EXPECT_THROW((void)DistanceField::read(folder / "map.vdb"), std::runtime_error);
  EXPECT_THROW((void)DistanceField::read(folder / "none.vdb"), std::runtime_error);
}

}  // namespace
}  // namespace cairn
