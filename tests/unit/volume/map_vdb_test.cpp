// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// map.vdb as read by any other OpenVDB program.
#include "volume/vdb/map_vdb.hpp"

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Diagnostics.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/LevelSetUtil.h>
#include <openvdb/tools/VolumeToMesh.h>

#include <algorithm>
#include <optional>

#include "shaders/voxel.h"
#include "support/files.hpp"
#include "volume/vdb/brick_file.hpp"

namespace cairn {
namespace {

/// Reads all grids of a file with OpenVDB only.
openvdb::GridPtrVec grids_of(const std::filesystem::path& vdb) {
  openvdb::initialize();
  openvdb::io::File file(vdb.string());
  file.open();
  return *file.getGrids();
}

/// Reads a grid of a file with OpenVDB only.
template <class Grid>
typename Grid::Ptr grid_of(const std::filesystem::path& vdb, const char* name) {
  openvdb::initialize();
  openvdb::io::File file(vdb.string());
  file.open();
  return openvdb::gridPtrCast<Grid>(file.readGrid(name));
}

void expect_equal(const BrickTree& read, const BrickTree& tree) {
  ASSERT_EQ(read.bricks(), tree.bricks());
  for (const Eigen::Vector3i& b : tree.bricks())
    for (std::size_t k = 0; k < 512; ++k) ASSERT_EQ(read.find(b)[k], tree.find(b)[k]) << k;
}

/// Plane at x = 4.3 voxels, observed with weight 2, colored.
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

  const openvdb::GridPtrVec grids = grids_of(folder / "map.vdb");
  ASSERT_EQ(grids.size(), 6u);  // and color_weight, needed for resuming, observed and free
  const auto tsdf = grid_of<openvdb::FloatGrid>(folder / "map.vdb", "tsdf");
  const auto weight = grid_of<openvdb::FloatGrid>(folder / "map.vdb", "weight");
  const auto color = grid_of<openvdb::Vec3SGrid>(folder / "map.vdb", "color");
  EXPECT_EQ(tsdf->getGridClass(), openvdb::GRID_LEVEL_SET);
  for (const auto& grid : grids) {
    EXPECT_TRUE(grid->transform().voxelSize().eq(openvdb::Vec3d(0.01), 1e-7));
    // Cubes of eight voxels are 23 by 7 by 7.
    EXPECT_EQ(grid->activeVoxelCount(), grid->getName() == "free"       ? 512u + 3u
                                        : grid->getName() == "observed" ? 23u * 7u * 7u
                                                                        : 3u * 512u)
        << grid->getName();
    EXPECT_TRUE(grid->isType<openvdb::FloatGrid>() || grid->isType<openvdb::BoolGrid>() ||
                grid->isType<openvdb::Vec3SGrid>())
        << grid->getName() << ": other programs do not know " << grid->type();
  }
  EXPECT_EQ(tsdf->getMetadata<openvdb::StringMetadata>("axes")->value(), "axes world: x right, y down, z forward");
  EXPECT_NEAR(tsdf->background(), 0.04, 1e-6);
  const auto free = grid_of<openvdb::BoolGrid>(folder / "map.vdb", "free");
  for (int z = 0; z < 5; ++z) EXPECT_EQ(free->tree().isValueOn({-38, 0, 16 + z}), z < 2 || z == 3) << z;
  EXPECT_TRUE(free->tree().getValue({15, 7, 7}));
  using Sampler = openvdb::tools::GridSampler<openvdb::FloatGrid, openvdb::tools::BoxSampler>;
  for (const double x : {0.01, 0.033, 0.055, 0.07})
    EXPECT_NEAR(Sampler(*tsdf).wsSample({x, 0.035, 0.02}), 0.043 - x, 2e-6) << x;
  EXPECT_EQ(weight->tree().getValue({3, 3, 3}), 2.0f);
  EXPECT_TRUE(color->tree().getValue({3, 3, 3}).eq(openvdb::Vec3s(1.0f, 128 / 255.0f, 0.0f), 1e-6f));
}

/// Half a ball of voxels observed from one side: voxels more than the truncation behind the surface are unknown.
BrickTree seen_ball() {
  BrickTree tree;
  for (int bx = -5; bx < 5; ++bx)
    for (int by = -5; by < 5; ++by)
      for (int bz = -5; bz < 0; ++bz) {
        BrickVoxels voxels{};
        bool any = false;
        for (int i = 0; i < 512; ++i) {
          const Eigen::Vector3i v(8 * bx + (i >> 6), 8 * by + (i >> 3 & 7), 8 * bz + (i & 7));
          const double d = v.cast<double>().norm() - 30.3;  // voxels
          if (v.z() > -6 || d < -4 || d > 8) continue;
          voxels[static_cast<std::size_t>(i)] = shader::pack_voxel(static_cast<float>(std::min(d / 4, 1.0)), 2);
          any = true;
        }
        if (any) tree.put({bx, by, bz}, voxels);
      }
  return tree;
}

TEST(Grids, HaveNoFalseSurfaceInOpenVdb) {
  const TemporaryFolder folder;
  write_grids(folder / "map.vdb", seen_ball(), {.voxel_size = 0.01f, .truncation = 0.04f});
  const auto tsdf = grid_of<openvdb::FloatGrid>(folder / "map.vdb", "tsdf");
  const auto observed = grid_of<openvdb::BoolGrid>(folder / "map.vdb", "observed");
  const auto share = [&](const openvdb::BoolGrid::ConstPtr& mask) {
    openvdb::tools::VolumeToMesh mesher(0.0);
    mesher.setSurfaceMask(mask);
    mesher(*tsdf);
    std::size_t right = 0;
    for (std::size_t i = 0; i < mesher.pointListSize(); ++i)
      right += std::abs(mesher.pointList()[i].length() - 0.303f) < 0.01f && mesher.pointList()[i].z() < -0.045f;
    EXPECT_GT(mesher.pointListSize(), 1000u);
    return static_cast<double>(right) / static_cast<double>(mesher.pointListSize());
  };
  EXPECT_GT(share(nullptr), 0.9);  // without the rim of the observed part
  EXPECT_EQ(share(observed), 1.0);
  // Earlier behavior: unknown voxels counted as in front of the surface, which added a false back surface of the same
  // size.
  const auto plain = tsdf->deepCopy();
  for (auto leaf = plain->tree().beginLeaf(); leaf; ++leaf)
    for (auto value = leaf->beginValueOff(); value; ++value) value.setValue(plain->background());
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec4I> quads;
  openvdb::tools::volumeToMesh(*plain, points, quads);
  const auto right =
      std::count_if(points.begin(), points.end(), [](const auto& p) { return std::abs(p.length() - 0.303f) < 0.01f; });
  EXPECT_LT(static_cast<double>(right), 0.7 * static_cast<double>(points.size()));
  // OpenVDB's check: distances along the viewing rays are not Euclidean; all other checks pass.
  EXPECT_EQ(openvdb::tools::checkLevelSet(*tsdf, 8), "");  // all but the last check, of the gradient
}

TEST(Grids, StoreTheSurfaceSigma) {
  const TemporaryFolder folder;
  const Eigen::Vector3d place(0.04, 0.06, 0.11);
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 0.2, -0.4).normalized()));
  GridInfo info{.voxel_size = 0.01f, .truncation = 0.04f};
  info.upright.world_from_tracked = turn;
  info.sigma.add(place, 0.003);
  info.sigma.add({5, 0, -1}, 0.001);
  write_grids(folder / "map.vdb", plane_tree(), info);
  const auto sigma = grid_of<openvdb::FloatGrid>(folder / "map.vdb", "sigma");
  EXPECT_NEAR(sigma->voxelSize().x(), 0.05, 1e-8);
  EXPECT_EQ(sigma->activeVoxelCount(), 2u);
  EXPECT_EQ(sigma->background(), 0.0f);
  const Eigen::Vector3d p = turn * place;
  EXPECT_EQ(openvdb::tools::PointSampler::sample(sigma->tree(), sigma->worldToIndex({p.x(), p.y(), p.z()})), 0.003f);
  const SurfaceSigma read = read_grids(folder / "map.vdb").info.sigma;
  EXPECT_EQ(read.cells().size(), 2u);
  for (const Eigen::Vector3d& at : {place, Eigen::Vector3d(5, 0, -1)}) EXPECT_EQ(read.at(at), info.sigma.at(at));
}

TEST(Grids, RejectInvalidStandardDeviations) {
  const TemporaryFolder folder;
  GridInfo info{.voxel_size = 0.01f, .truncation = 0.04f};
  info.sigma.add({0, 0, 0}, 0.003);
  write_grids(folder / "map.vdb", plane_tree(), info);
  const auto with = [&](auto change) {
    openvdb::GridPtrVec grids = grids_of(folder / "map.vdb");
    for (auto& grid : grids)
      if (grid->getName() == "sigma") change(grid);
    openvdb::io::File((folder / "bad.vdb").string()).write(grids);
    return error_of([&] { (void)read_grids(folder / "bad.vdb"); });
  };
  using Base = openvdb::GridBase::Ptr;
  EXPECT_NE(with([](Base& grid) {
              openvdb::gridPtrCast<openvdb::FloatGrid>(grid)->tree().setValueOn({1, 2, 3}, -1);
            }).find("`sigma` has a value that is not a standard deviation"),
            std::string::npos);
  EXPECT_NE(with([](Base& grid) {
              grid->setTransform(openvdb::math::Transform::createLinearTransform(0.1));
            }).find("`sigma` has an unexpected type or voxel size"),
            std::string::npos);
  EXPECT_NE(with([](Base& grid) {
              grid = openvdb::Int32Grid::create();
              grid->setName("sigma");
            }).find("`sigma` has an unexpected type or voxel size"),
            std::string::npos);
}

TEST(Grids, HaveTheRequestedAxes) {
  const TemporaryFolder folder;
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 0.2, -0.4).normalized()));
  for (const Axes axes : {Axes::world, Axes::y_up, Axes::z_up}) {
    GridInfo info{.voxel_size = 0.01f, .truncation = 0.04f, .axes = axes};
    info.upright.world_from_tracked = turn;
    write_grids(folder / "map.vdb", plane_tree(), info);
    const auto tsdf = grid_of<openvdb::FloatGrid>(folder / "map.vdb", "tsdf");
    const Eigen::Vector3f world = (turn * Eigen::Vector3d(0.033, 0.035, 0.02)).cast<float>();
    const Eigen::Vector3f p = axes == Axes::y_up   ? Eigen::Vector3f(world.x(), -world.y(), -world.z())
                              : axes == Axes::z_up ? Eigen::Vector3f(world.x(), world.z(), -world.y())
                                                   : world;
    using Sampler = openvdb::tools::GridSampler<openvdb::FloatGrid, openvdb::tools::BoxSampler>;
    EXPECT_NEAR(Sampler(*tsdf).wsSample({p.x(), p.y(), p.z()}), 0.01, 5e-6);
    EXPECT_LT(read_grids(folder / "map.vdb").info.upright.world_from_tracked.angularDistance(turn), 1e-6);
  }
}

TEST(Grids, ReadNamesOfVersion01) {
  const TemporaryFolder folder;
  const BrickTree tree = plane_tree();
  write_grids(folder / "map.vdb", tree, {.voxel_size = 0.01f, .truncation = 0.04f});
  const openvdb::GridPtrVec grids = grids_of(folder / "map.vdb");
  int renamed = 0;
  for (const auto& grid : grids)
    if (const std::string name = grid->getName(); name == "color" || name == "color_weight") {
      grid->setName("colour" + name.substr(5));
      ++renamed;
    }
  ASSERT_EQ(renamed, 2);
  openvdb::io::File((folder / "old.vdb").string()).write(grids);
  openvdb::io::File written((folder / "old.vdb").string());
  written.open();
  ASSERT_TRUE(written.hasGrid("colour") && written.hasGrid("colour_weight"));
  ASSERT_FALSE(written.hasGrid("color") || written.hasGrid("color_weight"));
  const ReadGrids read = read_grids(folder / "old.vdb");
  expect_equal(read.tree, tree);
}

TEST(Grids, ReadFilesOfVersion02) {
  const TemporaryFolder folder;
  const BrickTree tree = plane_tree();
  write_grids(folder / "map.vdb", tree, {.voxel_size = 0.01f, .truncation = 0.04f});
  openvdb::GridPtrVec old;
  const openvdb::GridPtrVec grids = grids_of(folder / "map.vdb");
  for (const auto& grid : grids)
    if (grid->getName() == "color_weight") {  // integers
      old.push_back(std::make_shared<openvdb::Int32Grid>(*openvdb::gridPtrCast<openvdb::FloatGrid>(grid)));
      old.back()->setName("color_weight");
    } else if (grid->getName() != "observed") {
      old.push_back(grid);
    }
  openvdb::io::File((folder / "old.vdb").string()).write(old);
  const ReadGrids read = read_grids(folder / "old.vdb");
  expect_equal(read.tree, tree);
}

TEST(Grids, TransformIntoTheGravityAlignedWorld) {
  const TemporaryFolder folder;
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 0.2, -0.4).normalized()));
  GravityAlignment upright{.source = GravityAlignment::Source::structure,
                           .known = true,
                           .world_from_tracked = turn,
                           .description = "found",
                           .off = {}};
  for (const float voxel : {0.002f, 0.01f, 0.2f}) {  // the options' range
    write_grids(folder / "map.vdb", plane_tree(), {.voxel_size = voxel, .truncation = 4 * voxel, .upright = upright});
    const auto tsdf = grid_of<openvdb::FloatGrid>(folder / "map.vdb", "tsdf");
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
      const Eigen::Vector2d aside = in_grid.tail<2>();  // the ends of the bricks create a surface as well
      if (std::abs(in_grid.x() - 4.3) > 1 || aside.minCoeff() < 1.5 || aside.maxCoeff() > 5.5) continue;
      EXPECT_NEAR(in_grid.x(), 4.3, 1e-3);
      ++inside;
    }
    EXPECT_GE(inside, 9);
    const ReadGrids read = read_grids(folder / "map.vdb");
    EXPECT_LT(read.info.upright.world_from_tracked.angularDistance(turn), 1e-6);
    EXPECT_EQ(read.info.upright.description, "found");
  }
  upright = {};
  write_grids(folder / "map.vdb", plane_tree(), {.voxel_size = 0.01f, .truncation = 0.04f, .upright = upright});
  EXPECT_FALSE(read_grids(folder / "map.vdb").info.upright.known);
}

TEST(Grids, RejectStretchedOrMirroredTransforms) {
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

TEST(FreeSpace, IsReadFromFilesWithCompletelyFreeBricksOnly) {
  // Format of versions before 2026-11-24: free bricks are tiles of the voxels' own grids.
  const TemporaryFolder folder;
  BrickTree tree;
  BrickVoxels voxels;
  voxels.fill(shader::pack_voxel(0.5f, 2));
  tree.put({0, 0, 0}, voxels);
  tree.mark_free({3, -1, 0});
  write_grids(folder / "map.vdb", tree, {.voxel_size = 0.01f, .truncation = 0.04f});
  openvdb::GridPtrVec old;
  const openvdb::GridPtrVec grids = grids_of(folder / "map.vdb");
  for (const auto& grid : grids)
    if (grid->getName() != "free" && grid->getName() != "observed") old.push_back(grid);
  ASSERT_EQ(old.size(), 4u);
  for (const auto& grid : old)
    if (grid->getName() == "tsdf")
      openvdb::gridPtrCast<openvdb::FloatGrid>(grid)->tree().addTile(1, {24, -8, 0}, 0.04f, true);
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
