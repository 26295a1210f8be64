// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A room on two days, in exact voxels.
#include "cairn/building/change.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "cairn/mapping/mesh.hpp"
#include "cairn/synthetic/scene.hpp"
#include "support/exact_maps.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kVoxel = 0.03, kReach = 4 * kVoxel;  // meters
const Vector3f kHalfRoom(2.0f, 1.3f, 1.6f), kBoxMiddle(0.5f, 0.9f, 0.3f), kHalfBox(0.4f, 0.4f, 0.3f);

Scene room(bool has_box) {
  Scene scene;
  scene.solids.push_back({.shape = Scene::Shape::hollow, .half_size = kHalfRoom});
  if (has_box) scene.solids.push_back({.shape = Scene::Shape::box, .center = kBoxMiddle, .half_size = kHalfBox});
  return scene;
}

class Change : public testing::Test {
 protected:
  /// `moved`: offset of the map along x, meters.
  void write_day(const std::string& name, bool has_box, double moved = 0, double voxel = kVoxel,
                 const std::function<bool(const Vector3d&)>& is_seen = {}) {
    const Scene scene = room(has_box);
    const Vector3d half = kHalfRoom.cast<double>() + Vector3d::Constant(0.2);
    write_exact_map(folder / name, [&](const Vector3d& p) { return scene.distance(p - Vector3d(moved, 0, 0)); },
                    {.voxel_size = static_cast<float>(voxel),
                     .truncation = static_cast<float>(3 * voxel),
                     .box = {-half, half},
                     .upright = gravity_alignment_of(Eigen::Quaterniond::Identity()),
                     .is_seen = is_seen});
  }
  [[nodiscard]] ExportedChange change(const std::string& before, const std::string& after,
                                      const ChangeOptions& options = {}) const {
    return export_change(folder / before, folder / after, folder / "change.glb", options);
  }
  TemporaryFolder folder;
};

/// Visible area of a box on the floor: four sides and the top, except within reach of the floor.
double area_of_box() {
  const Vector3d size = 2 * kHalfBox.cast<double>();
  return size.x() * size.z() + 2 * (size.x() + size.z()) * (size.y() - kReach);
}
constexpr double kAreaTolerance = 0.12;  // m2: two voxels along the seam of the sides with the floor

/// Number of vertices with clearly more blue than red, and more red than blue.
std::pair<std::size_t, std::size_t> blue_and_orange(const Mesh& mesh) {
  std::pair<std::size_t, std::size_t> counts;
  for (const auto& c : mesh.colors) {
    counts.first += c[2] > c[0] + 50;
    counts.second += c[0] > c[2] + 50;
  }
  return counts;
}

TEST_F(Change, FindsAnAddedBoxAndNothingOfTheWalls) {
  write_day("monday.vdb", false);
  write_day("tuesday.vdb", true);
  const ExportedChange came = change("monday.vdb", "tuesday.vdb");
  EXPECT_NEAR(came.new_area, area_of_box(), kAreaTolerance);
  EXPECT_EQ(came.gone_area, 0);
  EXPECT_NEAR(came.distance, kReach, 1e-6);
  ASSERT_EQ(came.regions.size(), 1u);
  EXPECT_LT((came.regions[0].middle - kBoxMiddle.cast<double>()).norm(), 0.2);
  EXPECT_NEAR(came.regions[0].extent.x(), 0.8, 2 * kVoxel);
  EXPECT_EQ(validate_gltf(folder / "change.glb"), "");
  const Mesh mesh = read_mesh(folder / "change.glb");
  EXPECT_EQ(mesh.triangles.size(), came.triangles);
  const auto [blue, orange] = blue_and_orange(mesh);
  EXPECT_GT(blue, 100u);
  EXPECT_EQ(orange, 0u);
  for (std::size_t v = 0; v < mesh.colors.size(); ++v)
    if (mesh.colors[v][2] > mesh.colors[v][0] + 50) {
      const Vector3f off = (mesh.positions[v] - kBoxMiddle).cwiseAbs() - kHalfBox;
      EXPECT_LT(off.maxCoeff(), 0.01f);
    }
}

TEST_F(Change, FindsARemovedBox) {
  write_day("monday.vdb", true);
  write_day("tuesday.vdb", false);
  const ExportedChange gone = change("monday.vdb", "tuesday.vdb");
  EXPECT_NEAR(gone.gone_area, area_of_box(), kAreaTolerance);
  EXPECT_EQ(gone.new_area, 0);
  const auto [blue, orange] = blue_and_orange(read_mesh(folder / "change.glb"));
  EXPECT_EQ(blue, 0u);
  EXPECT_GT(orange, 100u);
}

TEST_F(Change, IgnoresSurfaceDisplacedByAFewVoxels) {
  write_day("monday.vdb", true);
  write_day("tuesday.vdb", true, 2.5 * kVoxel);
  const ExportedChange none = change("monday.vdb", "tuesday.vdb");
  EXPECT_EQ(none.regions.size(), 0u);
  // A small distance includes the walls.
  EXPECT_GT(change("monday.vdb", "tuesday.vdb", {.distance = static_cast<float>(kVoxel)}).new_area, 1);
}

TEST_F(Change, IgnoresSpaceUnobservedByTheOtherMap) {
  const auto is_seen = [](const Vector3d& p) { return p.x() < -0.3; };  // the box is beyond
  write_day("monday.vdb", false, 0, kVoxel, is_seen);
  write_day("tuesday.vdb", true);
  EXPECT_EQ(change("monday.vdb", "tuesday.vdb").regions.size(), 0u);
  EXPECT_EQ(change("tuesday.vdb", "monday.vdb").regions.size(), 0u);
}

TEST_F(Change, OmitsRegionsBelowTheMinimumArea) {
  write_day("monday.vdb", false);
  write_day("tuesday.vdb", true);
  const ExportedChange none = change("monday.vdb", "tuesday.vdb", {.min_area = 5});
  EXPECT_EQ(none.regions.size(), 0u);
  EXPECT_EQ(none.new_area, 0);
  EXPECT_EQ(blue_and_orange(read_mesh(folder / "change.glb")).first, 0u);
}

TEST_F(Change, RejectsMapsThatCannotBeCompared) {
  write_day("monday.vdb", false);
  write_day("coarse.vdb", false, 0, 0.05);
  EXPECT_NE(error_of([&] { (void)change("monday.vdb", "coarse.vdb"); }).find("make both with the same --voxel-size"),
            std::string::npos);
  // A room with an offset of 1 m and a rotation.
  const Scene scene = room(true);
  const Eigen::AngleAxisd turn(0.6, Vector3d::UnitY());
  const Vector3d half = kHalfRoom.cast<double>() + Vector3d::Constant(0.2);
  for (const double away : {0.5, 20.0}) {
    const Vector3d move(away, 0.3, 0.2);
    Eigen::AlignedBox3d box(-half, half);
    write_exact_map(folder / "elsewhere.vdb", [&](const Vector3d& p) { return scene.distance(turn * (p - move)); },
                    {.box = box.translate(move), .upright = gravity_alignment_of(Eigen::Quaterniond::Identity())});
    EXPECT_NE(error_of([&] {
                (void)change("monday.vdb", "elsewhere.vdb");
              }).find(away > 1 ? "have no observed space in common" : "are not in the same frame"),
              std::string::npos);
  }
  EXPECT_NE(error_of([&] { (void)change("monday.vdb", "monday.vdb", {.distance = 1}); }).find("must be between 0.03"),
            std::string::npos);
  EXPECT_NE(error_of([&] {
              (void)export_change(folder / "monday.vdb", folder / "monday.vdb", folder / "x.ply");
            }).find("use .glb or .gltf"),
            std::string::npos);
  EXPECT_FALSE(fs::exists(folder / "change.glb"));
}

}  // namespace
}  // namespace cairn
