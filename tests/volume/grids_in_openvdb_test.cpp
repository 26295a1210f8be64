// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// map.vdb as any other OpenVDB program sees it.
#include <gtest/gtest.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/LevelSetUtil.h>
#include <openvdb/tools/VolumeToMesh.h>

#include <optional>

#include "shaders/voxel.h"
#include "support/files.hpp"
#include "volume/grids.hpp"

namespace cairn {
namespace {

/// A plane at x = 4.3 voxels, seen with weight 2, coloured.
BrickTree plane_tree() {
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
  return tree;
}

TEST(Grids, OpenAsMetricLevelSetsInOpenVdb) {
  const TemporaryFolder folder;
  BrickTree tree = plane_tree();
  tree.mark_free({1, 0, 0});
  tree.mark_free({-5, 0, 2}, {0, 0, 0b1011});
  write_grids(folder / "map.vdb", tree, {.voxel_size = 0.01f, .truncation = 0.04f});

  openvdb::initialize();
  openvdb::io::File file((folder / "map.vdb").string());
  file.open();
  const auto grids = file.getGrids();
  ASSERT_EQ(grids->size(), 5u);  // and colour_weight, so that a map can go on, and free
  const auto tsdf = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("tsdf"));
  const auto weight = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("weight"));
  const auto colour = openvdb::gridPtrCast<openvdb::Vec3SGrid>(file.readGrid("colour"));
  EXPECT_EQ(tsdf->getGridClass(), openvdb::GRID_LEVEL_SET);
  for (const auto& grid : *grids) {
    EXPECT_TRUE(grid->transform().voxelSize().eq(openvdb::Vec3d(0.01), 1e-7));
    EXPECT_EQ(grid->activeVoxelCount(), grid->getName() == "free" ? 512u + 3u : 3u * 512u);
  }
  EXPECT_NEAR(tsdf->background(), 0.04, 1e-6);
  const auto free = openvdb::gridPtrCast<openvdb::BoolGrid>(file.readGrid("free"));
  for (int z = 0; z < 5; ++z) EXPECT_EQ(free->tree().isValueOn({-38, 0, 16 + z}), z < 2 || z == 3) << z;
  EXPECT_TRUE(free->tree().getValue({15, 7, 7}));
  using Sampler = openvdb::tools::GridSampler<openvdb::FloatGrid, openvdb::tools::BoxSampler>;
  for (const double x : {0.01, 0.033, 0.055, 0.07})
    EXPECT_NEAR(Sampler(*tsdf).wsSample({x, 0.035, 0.02}), 0.043 - x, 2e-6) << x;
  EXPECT_EQ(weight->tree().getValue({3, 3, 3}), 2.0f);
  EXPECT_TRUE(colour->tree().getValue({3, 3, 3}).eq(openvdb::Vec3s(1.0f, 128 / 255.0f, 0.0f), 1e-6f));
}

TEST(Grids, LieInTheUprightWorldByTheirTransform) {
  const TemporaryFolder folder;
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 0.2, -0.4).normalized()));
  Upright upright{
      .source = Upright::Source::structure, .known = true, .world_from_tracked = turn, .words = "found", .off = {}};
  for (const float voxel : {0.002f, 0.01f, 0.2f}) {  // the options' range
    write_grids(folder / "map.vdb", plane_tree(), {.voxel_size = voxel, .truncation = 4 * voxel, .upright = upright});
    openvdb::initialize();
    openvdb::io::File file((folder / "map.vdb").string());
    file.open();
    const auto tsdf = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("tsdf"));
    EXPECT_TRUE(tsdf->hasUniformVoxels());
    EXPECT_NEAR(tsdf->voxelSize().x(), static_cast<double>(voxel), 1e-8);
    EXPECT_EQ(tsdf->getMetadata<openvdb::StringMetadata>("up_source")->value(), "structure");
    EXPECT_TRUE(tsdf->getMetadata<openvdb::BoolMetadata>("up_known")->value());
    using Sampler = openvdb::tools::GridSampler<openvdb::FloatGrid, openvdb::tools::BoxSampler>;
    for (const double x : {1.0, 3.3, 5.5, 7.0}) {
      const Eigen::Vector3d p = turn * Eigen::Vector3d(x, 3.5, 2) * static_cast<double>(voxel);
      EXPECT_NEAR(Sampler(*tsdf).wsSample({p.x(), p.y(), p.z()}), (4.3 - x) * static_cast<double>(voxel),
                  2e-4 * static_cast<double>(voxel));
    }
    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec4I> quads;
    openvdb::tools::volumeToMesh(*tsdf, points, quads);
    int inside = 0;
    for (const auto& p : points) {
      const Eigen::Vector3d in_grid =
          turn.conjugate() * Eigen::Vector3d(p.x(), p.y(), p.z()) / static_cast<double>(voxel);
      const Eigen::Vector2d aside = in_grid.tail<2>();  // where the bricks end there is a surface, too
      if (std::abs(in_grid.x() - 4.3) > 1 || aside.minCoeff() < 1.5 || aside.maxCoeff() > 5.5) continue;
      EXPECT_NEAR(in_grid.x(), 4.3, 1e-3);
      ++inside;
    }
    EXPECT_GE(inside, 9);
    const ReadGrids read = read_grids(folder / "map.vdb");
    EXPECT_LT(read.info.upright.world_from_tracked.angularDistance(turn), 1e-6);
    EXPECT_EQ(read.info.upright.words, "found");
  }
  upright = {};
  write_grids(folder / "map.vdb", plane_tree(), {.voxel_size = 0.01f, .truncation = 0.04f, .upright = upright});
  EXPECT_FALSE(read_grids(folder / "map.vdb").info.upright.known);
}

TEST(Grids, AreRefusedWhereTheyAreStretchedOrMirrored) {
  const TemporaryFolder folder;
  openvdb::initialize();
  for (const openvdb::Vec3d& scale : {openvdb::Vec3d(0.01, 0.01, 0.02), openvdb::Vec3d(0.01, -0.01, 0.01)}) {
    auto grid = openvdb::FloatGrid::create(1);
    grid->setName("esdf");
    openvdb::Mat4d m = openvdb::Mat4d::identity();
    m.preScale(scale);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(m));
    openvdb::io::File((folder / "field.vdb").string()).write({grid});
    EXPECT_NE(error_of([&] { (void)DistanceField::read(folder / "field.vdb"); }).find("stretched or mirrored"),
              std::string::npos);
  }
}

TEST(FreeSpace, IsReadFromFilesThatKnowWholeBricksAlone) {
  // As versions before 2026-11-24 wrote them: free bricks are tiles of the voxels' own grids.
  const TemporaryFolder folder;
  BrickTree tree;
  BrickVoxels voxels;
  voxels.fill(shader::pack_voxel(0.5f, 2));
  tree.put({0, 0, 0}, voxels);
  tree.mark_free({3, -1, 0});
  write_grids(folder / "map.vdb", tree, {.voxel_size = 0.01f, .truncation = 0.04f});
  openvdb::initialize();
  openvdb::io::File file((folder / "map.vdb").string());
  file.open();
  openvdb::GridPtrVec old;
  const auto grids = file.getGrids();
  for (const auto& grid : *grids)
    if (grid->getName() != "free") old.push_back(grid);
  ASSERT_EQ(old.size(), 4u);
  openvdb::io::File((folder / "old.vdb").string()).write(old);
  const BrickTree read = read_grids(folder / "old.vdb").tree;
  EXPECT_EQ(read.free_bricks(), tree.free_bricks());
  EXPECT_TRUE(read.is_free({3, -1, 0}));

  const auto bricks = openvdb::Int64Grid::create();
  bricks->tree().touchLeaf({0, 0, 0})->setValueOn(5, 0x10000);
  bricks->tree().addTile(1, {24, -8, 0}, 0, true);
  openvdb::io::File session((folder / "submap.vdb").string());
  session.setCompression(openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK);
  session.write(openvdb::GridPtrVec{bricks});
  session.close();
  const BrickFile submap(folder / "submap.vdb");
  EXPECT_EQ(submap.bricks(), (std::vector<Eigen::Vector3i>{{0, 0, 0}}));
  EXPECT_TRUE(submap.read().is_free({3, -1, 0}));
  EXPECT_TRUE(submap.read_free().is_free({3, -1, 0}));
}

}  // namespace
}  // namespace cairn
