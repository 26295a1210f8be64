// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// map.vdb as any other OpenVDB program sees it.
#include <gtest/gtest.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Interpolation.h>

#include "shaders/voxel.h"
#include "support/files.hpp"
#include "volume/grids.hpp"

namespace cairn {
namespace {

TEST(Grids, OpenAsMetricLevelSetsInOpenVdb) {
  // A plane at x = 0.043 m, seen with weight 2, coloured.
  const TemporaryFolder folder;
  BrickTree tree;
  for (int brick = -1; brick <= 1; ++brick) {
    BrickVoxels voxels;
    for (int i = 0; i < 512; ++i) {
      const double x = 0.01 * (8 * brick + (i >> 6));
      const double d = std::clamp((0.043 - x) / 0.04, -1.0, 1.0);
      voxels[static_cast<std::size_t>(i)] =
          shader::pack_voxel(static_cast<float>(d), 2, 0x01'00'80'ff);  // blue 0, green 0x80, red 0xff
    }
    tree.put({brick, 0, 0}, voxels);
  }
  write_grids(folder / "map.vdb", tree, {.voxel_size = 0.01f, .truncation = 0.04f});

  openvdb::initialize();
  openvdb::io::File file((folder / "map.vdb").string());
  file.open();
  const auto grids = file.getGrids();
  ASSERT_EQ(grids->size(), 4u);  // and colour_weight, so that a map can go on
  const auto tsdf = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("tsdf"));
  const auto weight = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("weight"));
  const auto colour = openvdb::gridPtrCast<openvdb::Vec3SGrid>(file.readGrid("colour"));
  EXPECT_EQ(tsdf->getGridClass(), openvdb::GRID_LEVEL_SET);
  for (const auto& grid : *grids) {
    EXPECT_TRUE(grid->transform().voxelSize().eq(openvdb::Vec3d(0.01), 1e-7));
    EXPECT_EQ(grid->activeVoxelCount(), 3u * 512u);
  }
  EXPECT_NEAR(tsdf->background(), 0.04, 1e-6);
  using Sampler = openvdb::tools::GridSampler<openvdb::FloatGrid, openvdb::tools::BoxSampler>;
  for (const double x : {0.01, 0.033, 0.055, 0.07})
    EXPECT_NEAR(Sampler(*tsdf).wsSample({x, 0.035, 0.02}), 0.043 - x, 2e-6) << x;
  EXPECT_EQ(weight->tree().getValue({3, 3, 3}), 2.0f);
  EXPECT_TRUE(colour->tree().getValue({3, 3, 3}).eq(openvdb::Vec3s(1.0f, 128 / 255.0f, 0.0f), 1e-6f));
}

}  // namespace
}  // namespace cairn
