// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "floor_plan/layout.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

namespace cairn::plan {
namespace {

/// A room of 8 by 5 m on each storey, 3 m high.
std::vector<StoreyPlan> storeys(int count) {
  std::vector<StoreyPlan> all;
  for (int i = 0; i < count; ++i)
    all.push_back({.floor = 3.0 * i,
                   .walls = {.lines = {{.points = {{0, 0}, {8, 0}, {8, 5}, {0, 5}}, .closed = true}}, .length = 26}});
  return all;
}

/// Straight path through the room, 1.5 m above a floor.
Trajectory path(double floor, double z) {
  Trajectory poses;
  for (int i = 0; i <= 20; ++i) {
    StampedPose pose{.timestamp = 0.1 * i, .world_from_camera = Eigen::Isometry3d::Identity()};
    pose.world_from_camera.translation() = Eigen::Vector3d(1 + 0.3 * i, -floor - 1.5, z + 0.2 * (i % 2));
    poses.push_back(pose);
  }
  return poses;
}

LoopLine loop(double x, double floor, bool is_between) {
  return {.from = {x, -floor - 1.5, 1}, .to = {x + 1, -floor - 1.5, 3}, .is_between = is_between};
}

const Layer* layer_of(const Sheet& sheet, const std::string& name) {
  const auto found =
      std::find_if(sheet.layers.begin(), sheet.layers.end(), [&](const Layer& l) { return l.name == name; });
  return found == sheet.layers.end() ? nullptr : &*found;
}

/// Expects all shapes and texts inside the page.
void expect_on_page(const Sheet& sheet) {
  for (const Layer& layer : sheet.layers) {
    for (const Shape& shape : layer.shapes)
      for (const auto& ring : shape.rings)
        for (const Point& p : ring)
          EXPECT_TRUE(p.x() >= 0 && p.y() >= 0 && p.x() <= sheet.width && p.y() <= sheet.height) << layer.name;
    for (const Label& label : layer.labels)
      EXPECT_TRUE(label.at.x() >= 0 && label.at.x() <= sheet.width && label.at.y() <= sheet.height) << layer.name;
  }
}

TEST(Layout, GivesEachPathAColorAndAName) {
  std::vector<Trajectory> paths;
  for (int i = 0; i < 7; ++i) paths.push_back(path(0, 0.5 + 0.5 * i));
  const Pages pages = laid_out(storeys(1), paths, {}, {.path = true, .recordings = {"monday", "tuesday"}});
  const Sheet& sheet = pages.sheets[0];
  std::set<Color> colors;
  for (const char* name : {"monday", "tuesday", "recording 2", "recording 3", "recording 4"}) {
    const Layer* layer = layer_of(sheet, std::string("Path of the camera: ") + name);
    ASSERT_NE(layer, nullptr) << name;
    EXPECT_EQ(layer->shapes.size(), 1u);
    EXPECT_TRUE(layer->style.dashed);
    colors.insert(layer->style.stroke.value_or(0));
    const Layer* legend = layer_of(sheet, std::string("Legend: path: ") + name);
    ASSERT_NE(legend, nullptr) << name;
    EXPECT_EQ(legend->style.stroke, layer->style.stroke);
  }
  EXPECT_EQ(colors.size(), 5u);
  EXPECT_EQ(layer_of(sheet, "Path of the camera: recording 5")->style.stroke,
            layer_of(sheet, "Path of the camera: monday")->style.stroke);
  EXPECT_EQ(layer_of(sheet, "Path of the camera"), nullptr);
  expect_on_page(sheet);
}

TEST(Layout, DrawsPathsOnTheirStoreys) {
  const Pages pages = laid_out(storeys(2), {path(0, 1), path(3, 2)}, {}, {.path = true});
  EXPECT_NE(layer_of(pages.sheets[0], "Path of the camera: recording 0"), nullptr);
  EXPECT_EQ(layer_of(pages.sheets[0], "Path of the camera: recording 1"), nullptr);
  EXPECT_NE(layer_of(pages.sheets[1], "Path of the camera: recording 1"), nullptr);
  const Pages alone = laid_out(storeys(1), {path(0, 1)}, {}, {.path = true});
  EXPECT_NE(layer_of(alone.sheets[0], "Path of the camera"), nullptr);
}

TEST(Layout, DistinguishesLoopsBetweenAndWithinRecordings) {
  const std::vector<LoopLine> loops{loop(1, 0, false), loop(2, 0, true), loop(3, 0, true), loop(4, 3, false)};
  const Pages pages = laid_out(storeys(2), {path(0, 1), path(3, 2)}, loops, {.loops = true});
  EXPECT_EQ(pages.loops, 4);
  EXPECT_EQ(pages.loops_between, 2);
  const Layer *within = layer_of(pages.sheets[0], "Loops"),
              *between = layer_of(pages.sheets[0], "Loops between recordings");
  ASSERT_TRUE(within != nullptr && between != nullptr);
  EXPECT_EQ(within->shapes.size(), 1u);
  EXPECT_EQ(between->shapes.size(), 2u);
  EXPECT_NE(within->style.stroke, between->style.stroke);
  EXPECT_NE(within->style.width, between->style.width);
  EXPECT_EQ(layer_of(pages.sheets[1], "Loops")->shapes.size(), 1u);
  EXPECT_EQ(layer_of(pages.sheets[0], "Path of the camera: recording 0"), nullptr);
  // As long on the paper as in the room.
  const auto& line = within->shapes[0].rings[0];
  EXPECT_NEAR((line[1] - line[0]).norm(), std::hypot(1, 2) * 1000 / pages.scale, 1e-6);
  EXPECT_EQ(laid_out(storeys(1), {path(0, 1)}, loops, {}).loops, 0);
}

TEST(Layout, EnlargesThePageForALongLegend) {
  std::vector<Trajectory> paths;
  PlanOptions options{.scale = 100, .path = true};
  for (int i = 0; i < 30; ++i) {
    paths.push_back(path(0, 1));
    options.recordings.push_back("a recording of the second floor " + std::to_string(i));
  }
  expect_on_page(laid_out(storeys(1), paths, {}, options).sheets[0]);
}

}  // namespace
}  // namespace cairn::plan
