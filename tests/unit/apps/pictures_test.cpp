// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "apps/cli/pictures.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <memory>

#include "support/cost.hpp"
#include "support/files.hpp"

namespace cairn::apps {
namespace {

/// Field with a single known voxel, the first, in each of these blocks.
DistanceField field_of(const std::vector<Eigen::Vector3i>& at) {
  DistanceField::Blocks blocks;
  for (const Eigen::Vector3i& block : at) {
    auto samples = std::make_shared<DistanceField::Block>();
    samples->fill(std::numeric_limits<float>::quiet_NaN());
    (*samples)[0] = 0.5f;
    blocks.push_back({block, std::move(samples)});
  }
  return {0.02f, Eigen::Vector3f::Zero(), 1.0f, std::move(blocks)};
}

TEST(Pictures, RefusesACostmapOfDistantBlocks) {
  for (const int far : {(1 << 27) - 1, 100'000}) {
    const Cost cost = cost_of([&] {
      const DistanceField field = field_of({{0, 0, 0}, {far, 0, far}});
      Costmap({.low = 0, .high = 1}).add(field, {}, field.bounds());
    });
    EXPECT_TRUE(cost.ended);
    EXPECT_NE(cost.error.find("too sparse for a costmap"), std::string::npos) << cost.error;
    EXPECT_LT(cost.seconds, 10);
  }
  const DistanceField near = field_of({{0, 0, 0}, {20, 0, 20}});
  EXPECT_NO_THROW(Costmap({.low = -1, .high = 1}).add(near, {}, near.bounds()));
}

TEST(Pictures, WritesSlicesOfOneVoxelAndOfTheFullRange) {
  const TemporaryFolder folder;
  for (const std::vector<Eigen::Vector3i>& blocks :
       {std::vector<Eigen::Vector3i>{{0, 0, 0}}, {{0, 0, 0}, {(1 << 27) - 1, 0, 0}}}) {
    const Cost cost = cost_of([&] { write_slice(folder / "slice.png", field_of(blocks), 1, 0); });
    EXPECT_TRUE(cost.ended);
    EXPECT_EQ(cost.error, "");
    EXPECT_LT(cost.seconds, 10);
    EXPECT_TRUE(std::filesystem::exists(folder / "slice.png"));
    std::filesystem::remove(folder / "slice.png");
  }
}

}  // namespace
}  // namespace cairn::apps
