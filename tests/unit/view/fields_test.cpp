// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/fields.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>

#include "shaders/voxel.h"
#include "support/files.hpp"
#include "volume/vdb/map_vdb.hpp"

namespace cairn {
namespace {

constexpr float kVoxel = 0.01f, kTruncation = 0.04f, kWeight = 4;
constexpr float kByte = 1.0f / 127;    // meters per unit of a byte: 2 m are 127
constexpr float kSpreadError = 0.01f;  // meters of error of propagated vectors to the nearest point

/// Writes a map of the space from `low` to `high` (bricks) with a surface given by its distance; voxels behind the
/// surface are unobserved, and bricks in front without a surface are free.
void write_map(const std::filesystem::path& file, const Eigen::Vector3i& low, const Eigen::Vector3i& high,
               const std::function<float(const Eigen::Vector3f&)>& distance) {
  BrickTree tree;
  for (int x = low.x(); x < high.x(); ++x)
    for (int y = low.y(); y < high.y(); ++y)
      for (int z = low.z(); z < high.z(); ++z) {
        const Eigen::Vector3i brick(x, y, z);
        BrickVoxels voxels{};
        float min_distance = 10, max_distance = -10;
        for (int n = 0; n < 512; ++n) {
          const Eigen::Vector3i voxel = 8 * brick + Eigen::Vector3i(n >> 6, n >> 3 & 7, n & 7);
          const float d = distance(kVoxel * voxel.cast<float>());
          min_distance = std::min(min_distance, d), max_distance = std::max(max_distance, d);
          if (d > -kTruncation)
            voxels[static_cast<std::size_t>(n)] =
                shader::pack_voxel(std::min(d / kTruncation, 1.0f), kWeight, 0x01000000u);
        }
        if (min_distance > kTruncation)
          tree.mark_free(brick);
        else if (max_distance > -kTruncation)
          tree.put(brick, voxels);
      }
  write_grids(file, tree, {.voxel_size = kVoxel, .truncation = kTruncation});
}

struct Sampled {
  Eigen::Vector3f place;
  std::uint8_t distance, weight, sigma;
  [[nodiscard]] float meters() const { return (static_cast<float>(distance) - 128) * 2 / 127; }
};
std::vector<Sampled> samples(const Fields& f) {
  std::vector<Sampled> all;
  std::size_t n = 0;
  for (int z = 0; z < f.size.z(); ++z)
    for (int y = 0; y < f.size.y(); ++y)
      for (int x = 0; x < f.size.x(); ++x, ++n)
        all.push_back({f.origin + f.spacing * Eigen::Vector3f(Eigen::Vector3i(x, y, z).cast<float>()), f.distance[n],
                       f.weight[n], f.sigma[n]});
  return all;
}

TEST(Fields, StoreTheDistanceToTheSurface) {
  const TemporaryFolder folder;
  const auto sphere = [](const Eigen::Vector3f& p) { return (p - Eigen::Vector3f(0.1f, 0, 0.05f)).norm() - 0.3f; };
  write_map(folder / "map.vdb", {-8, -8, -8}, {9, 9, 9}, sphere);
  const Fields fields = make_fields(folder / "map.vdb", {}, {});
  EXPECT_FLOAT_EQ(fields.spacing, 0.02f);
  int known = 0, behind = 0;
  for (const Sampled& s : samples(fields)) {
    const float truth = sphere(s.place);
    if (std::abs(truth + kTruncation) < fields.spacing) continue;  // limit of the observed range
    EXPECT_EQ(s.distance != 0, truth > -kTruncation) << s.place.transpose();
    if (s.distance == 0) continue;
    ++known, behind += truth < 0;
    EXPECT_NEAR(s.meters(), truth, kByte + kSpreadError) << s.place.transpose();
  }
  EXPECT_GT(known, 100'000);
  EXPECT_GT(behind, 1000);
}

TEST(Fields, RespectTheMaximumNumberOfCells) {
  const TemporaryFolder folder;
  const auto plane = [](const Eigen::Vector3f& p) { return 0.503f - p.z(); };
  write_map(folder / "map.vdb", {-8, -8, 0}, {8, 8, 8}, plane);
  const Fields fields = make_fields(folder / "map.vdb", {}, {}, 5000);
  EXPECT_LE(fields.size.prod(), 5000);
  EXPECT_GT(fields.size.prod(), 1000);
  const float inside = 0.64f - fields.spacing / 2;  // range where cells stay inside the map
  for (const Sampled& s : samples(fields))
    if (s.place.z() < 0.5f && s.place.head<2>().cwiseAbs().maxCoeff() < inside) {
      EXPECT_NEAR(s.meters(), plane(s.place), kByte + kSpreadError) << s.place.transpose();
    }
}

TEST(Fields, StoreObservationsAndUncertainty) {
  const TemporaryFolder folder;
  const auto plane = [](const Eigen::Vector3f& p) { return 0.503f - p.z(); };
  write_map(folder / "map.vdb", {-4, -4, 4}, {4, 4, 8}, plane);
  const SensorModel sensor;
  Trajectory path(20);  // from 2 m before the surface, plus a pose facing away
  for (std::size_t i = 0; i < path.size(); ++i) {
    path[i].timestamp = static_cast<double>(i);
    path[i].world_from_camera.translation().z() = 0.503 - 2;
  }
  path.back().world_from_camera.linear() = Eigen::AngleAxisd(3, Eigen::Vector3d::UnitY()).matrix();
  const float w = 0.25f, alone = 1e4f * sensor.sigma(2) * std::sqrt(w / kWeight),
              without_path = 1e4f * sensor.sigma(1) * std::sqrt(1 / kWeight);
  for (const bool has_path : {true, false}) {
    int on_surface = 0;
    for (const Sampled& s : samples(make_fields(folder / "map.vdb", sensor, has_path ? path : Trajectory())))
      if (std::abs(plane(s.place)) < 0.01f) {
        ++on_surface;
        EXPECT_EQ(s.weight, 4);
        EXPECT_NEAR(s.sigma, has_path ? alone : without_path, 1.5f);  // depth at the point itself, rounded to an
                                                                      // integer
      } else if (std::abs(plane(s.place)) > 0.06f) {
        EXPECT_EQ(s.sigma, 0) << s.place.transpose();
      }
    EXPECT_GT(on_surface, 500);
  }
}

TEST(Fields, StoreFreeSpacePerVoxel) {
  // A wall fused only within the truncation; a slanted half of the space in front is free.
  const TemporaryFolder folder;
  const auto wall = [](const Eigen::Vector3f& p) { return 0.503f - p.z(); };
  const auto free_side = [](const Eigen::Vector3f& p) { return 0.6f * p.x() - 0.8f * p.y(); };
  BrickTree tree;
  for (int x = -4; x < 4; ++x)
    for (int y = -4; y < 4; ++y)
      for (int z = 0; z < 8; ++z) {
        BrickVoxels voxels{};
        BrickBits free{};
        bool has_voxels = false;
        for (int n = 0; n < 512; ++n) {
          const Eigen::Vector3i voxel = 8 * Eigen::Vector3i(x, y, z) + Eigen::Vector3i(n >> 6, n >> 3 & 7, n & 7);
          const Eigen::Vector3f p = kVoxel * voxel.cast<float>();
          const float d = wall(p);
          if (std::abs(d) < kTruncation) {
            voxels[static_cast<std::size_t>(n)] = shader::pack_voxel(d / kTruncation, kWeight, 0x01000000u);
            has_voxels = true;
          }
          // Free space from before the wall existed: the fused voxels are newer.
          if (free_side(p) > 0) free[static_cast<std::size_t>(n >> 6)] |= 1ull << (n & 63);
        }
        if (has_voxels) tree.put({x, y, z}, voxels);
        tree.mark_free({x, y, z}, free);
      }
  write_grids(folder / "map.vdb", tree, {.voxel_size = kVoxel, .truncation = kTruncation});
  const Fields fields = make_fields(folder / "map.vdb", {}, {});
  ASSERT_FLOAT_EQ(fields.spacing, 2 * kVoxel);
  int free = 0, unknown = 0;
  for (const Sampled& s : samples(fields)) {
    const float d = wall(s.place), side = free_side(s.place);
    if (std::abs(d) < kTruncation - 2 * kVoxel) {
      EXPECT_NEAR(s.meters(), d, kByte + kSpreadError) << s.place.transpose();
    } else if (d > kTruncation + kVoxel) {
      if (std::abs(side) < 1.5f * kVoxel) continue;  // a partially free cell
      EXPECT_EQ(s.distance != 0, side > 0) << s.place.transpose();
      if (s.distance == 0) {
        ++unknown;
        continue;
      }
      ++free;
      EXPECT_NEAR(s.meters(), d, kByte + kSpreadError) << s.place.transpose();
    }
  }
  EXPECT_GT(free, 10'000);
  EXPECT_GT(unknown, 10'000);
}

TEST(Fields, AreWrittenInThePageFormat) {
  const Fields fields{.size = {2, 1, 1},
                      .origin = {1, 2, 3},
                      .spacing = 0.5f,
                      .max_distance = 2,
                      .distance = {0, 255},
                      .weight = {3, 4},
                      .sigma = {5, 6}};
  const std::string bytes = bytes_of(fields);
  ASSERT_EQ(bytes.size(), 4u + 4 * 4 + 5 * 4 + 6);
  EXPECT_EQ(bytes.substr(0, 4), "CFLD");
  std::uint32_t head[4];
  float numbers[5];
  std::memcpy(head, bytes.data() + 4, sizeof head);
  std::memcpy(numbers, bytes.data() + 20, sizeof numbers);
  EXPECT_EQ(head[0], 1u);
  EXPECT_EQ(head[1], 2u);
  EXPECT_EQ(head[3], 1u);
  EXPECT_EQ(numbers[2], 3);
  EXPECT_EQ(numbers[3], 0.5f);
  EXPECT_EQ(bytes.substr(40), std::string("\0\xff\3\4\5\6", 6));
}

TEST(Fields, RejectFilesThatAreNotMaps) {
  const TemporaryFolder folder;
  write_text(folder / "map.vdb", "not a grid");
  EXPECT_NE(error_of([&] { (void)make_fields(folder / "map.vdb", {}, {}); }).find("expected a map.vdb"),
            std::string::npos);
}

}  // namespace
}  // namespace cairn
