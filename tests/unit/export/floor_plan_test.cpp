// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Plans of scenes with exactly known walls, from exact voxels to the files' contents.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <map>
#include <set>
#include <sstream>

#include "cairn/mapping/map.hpp"
#include "cairn/synthetic/scene.hpp"
#include "support/exact_maps.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr float kVoxel = 0.03f, kTruncation = 0.09f;
constexpr double kFloorY = 1.3, kStorey = 2.8, kCut = 1.2;               // meters
constexpr double kWidth = 8.4, kDepth = 7.4, kThick = 0.1, kDoor = 0.9;  // meters
constexpr double kMeanOff = 0.01;  // mean distance of a line from the true wall, meters
constexpr double kSide = 0.01;     // meters of the plan's extent: half a voxel at each end

Scene::Solid box(const Vector3f& low, const Vector3f& high) {
  return {.shape = Scene::Shape::box, .center = (low + high) / 2, .half_size = (high - low) / 2};
}

/// Four rooms of equal size around the origin, each with doors to two others, and a table in the first.
Scene four_rooms() {
  const auto x = static_cast<float>(kWidth / 2), z = static_cast<float>(kDepth / 2), y = static_cast<float>(kFloorY),
             t = static_cast<float>(kThick / 2), d = static_cast<float>(kDoor / 2);
  Scene scene;
  scene.solids.push_back({.shape = Scene::Shape::hollow, .half_size = {x, y, z}});
  for (const float side : {-1.0f, 1.0f}) {
    const float dx = side * 2.1f, dz = side * 1.9f;  // middles of the doors
    const auto low_x = std::min(0.0f, side * (x + t)), high_x = std::max(0.0f, side * (x + t));
    scene.solids.push_back(box({low_x, -y, -t}, {dx - d, y, t}));
    scene.solids.push_back(box({dx + d, -y, -t}, {high_x, y, t}));
    const auto low_z = std::min(0.0f, side * (z + t)), high_z = std::max(0.0f, side * (z + t));
    scene.solids.push_back(box({-t, -y, low_z}, {t, y, dz - d}));
    scene.solids.push_back(box({-t, -y, dz + d}, {t, y, high_z}));
  }
  scene.solids.push_back(box({-2.9f, y - 0.75f, -3.0f}, {-1.5f, y - 0.70f, -2.3f}));
  return scene;
}

using Seen = std::function<bool(const Vector3d& middle)>;

/// Writes a map between two heights of a world with y down.
void write_map(const fs::path& file, const Distance& distance, double low_y, double high_y,
               const GravityAlignment& upright = gravity_alignment_of(Eigen::Quaterniond::Identity()),
               const Seen& is_seen = {}) {
  const double beside = 8.0 * static_cast<double>(kVoxel);
  const Vector3d low(-kWidth / 2 - beside, low_y, -kDepth / 2 - beside),
      high(kWidth / 2 + beside, high_y, kDepth / 2 + beside);
  write_exact_map(
      file, distance,
      {.voxel_size = kVoxel, .truncation = kTruncation, .box = {low, high}, .upright = upright, .is_seen = is_seen});
}

/// Points of each path of an SVG layer, millimeters of the page.
std::vector<std::vector<Vector2d>> paths_of(const std::string& svg, const std::string& layer) {
  std::vector<std::vector<Vector2d>> paths;
  const std::size_t begin = svg.find("inkscape:label=\"" + layer + "\"");
  if (begin == std::string::npos) return paths;
  const std::size_t end = svg.find("</g>", begin);
  for (std::size_t at = svg.find("d=\"", begin); at < end; at = svg.find("d=\"", at + 1)) {
    std::string text = svg.substr(at + 3, svg.find('"', at + 3) - at - 3);
    std::vector<Vector2d>& points = paths.emplace_back();
    const bool closed = text.ends_with("Z");
    for (char& c : text)
      if (c == 'M' || c == 'Z' || c == ',') c = ' ';
    std::istringstream in(text);
    for (Vector2d p; in >> p.x() >> p.y();) points.push_back(p);
    if (closed) points.push_back(points.front());
  }
  return paths;
}

Eigen::AlignedBox2d box_of(const std::vector<std::vector<Vector2d>>& paths) {
  Eigen::AlignedBox2d all;
  for (const auto& path : paths)
    for (const Vector2d& p : path) all.extend(p);
  return all;
}

/// Mean distance of a drawing's lines from the scene in meters, weighted by length. The drawing's box is the scene's.
double mean_off(const std::vector<std::vector<Vector2d>>& paths, int scale, const Distance& distance) {
  const Eigen::AlignedBox2d drawn = box_of(paths);
  double sum = 0;
  int count = 0;
  for (const auto& path : paths)
    for (std::size_t i = 0; i + 1 < path.size(); ++i) {
      const int steps = 1 + static_cast<int>((path[i + 1] - path[i]).norm() / 0.1);
      for (int k = 0; k < steps; ++k) {
        const Vector2d p = path[i] + (path[i + 1] - path[i]) * (k + 0.5) / steps - drawn.center();
        sum += std::abs(distance({p.x() * scale / 1000, kFloorY - kCut, -p.y() * scale / 1000}));
        ++count;
      }
    }
  return sum / count;
}

class FloorPlan : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder = new TemporaryFolder;
    scene = new Scene(four_rooms());
    write_map(*folder / "map.vdb", &distance, -0.3, 1.45);
  }
  static void TearDownTestSuite() {
    delete folder;
    delete scene;
  }
  static double distance(const Vector3d& p) { return scene->distance(p); }
  static ExportedPlan draw(const fs::path& file, const PlanOptions& options = {}) {
    return Map::open(*folder / "map.vdb").export_plan(file, options);
  }
  static inline TemporaryFolder* folder = nullptr;
  static inline Scene* scene = nullptr;
  TemporaryFolder out;
};

TEST_F(FloorPlan, DrawsLinesAtTheWalls) {
  const ExportedPlan plan = draw(out / "plan.svg", {.scale = 100});
  ASSERT_EQ(plan.storeys.size(), 1u);
  EXPECT_NEAR(plan.storeys[0].floor, -kFloorY, 0.005);
  EXPECT_LT(plan.storeys[0].mean_off, 0.005);
  const auto faces = paths_of(read_bytes(out / "plan.svg"), "Walls, faces");
  EXPECT_NEAR(box_of(faces).sizes().x(), 10 * kWidth, 10 * kSide);
  EXPECT_NEAR(box_of(faces).sizes().y(), 10 * kDepth, 10 * kSide);
  EXPECT_LT(mean_off(faces, 100, &distance), kMeanOff);
  // All lines: the outer walls, and both faces and the ends of the inner walls.
  double drawn = 0;
  for (const auto& path : faces)
    for (std::size_t i = 0; i + 1 < path.size(); ++i) drawn += (path[i + 1] - path[i]).norm() / 10;
  const double inner = 2 * (kWidth + kDepth - 4 * kDoor - 2 * kThick) + 8 * kThick;
  EXPECT_NEAR(drawn, 2 * (kWidth + kDepth) - 4 * kThick + inner, 0.2);
}

TEST_F(FloorPlan, HasTheSizeOfItsScale) {
  for (const auto& [scale, paper, width, height] :
       {std::tuple(0, "A3", 420.0, 297.0), {100, "A4", 297.0, 210.0}, {20, "A1", 841.0, 594.0}, {5, "", 0.0, 0.0}}) {
    const ExportedPlan plan = draw(out / "plan.svg", {.scale = scale});
    const std::string svg = read_bytes(out / "plan.svg");
    EXPECT_EQ(plan.paper, paper);
    EXPECT_EQ(plan.scale, scale == 0 ? 50 : scale);
    double w = 0, h = 0, box_w = 0, box_h = 0;
    ASSERT_EQ(std::sscanf(svg.substr(svg.find("width=")).c_str(),
                          "width=\"%lfmm\" height=\"%lfmm\" viewBox=\"0 0 %lf %lf\"", &w, &h, &box_w, &box_h),
              4);
    EXPECT_EQ(Vector2d(w, h), Vector2d(box_w, box_h));
    EXPECT_EQ(Vector2d(w, h), Vector2d(plan.width_mm, plan.height_mm));
    if (width > 0) {
      EXPECT_EQ(Vector2d(w, h), Vector2d(width, height));
    }
    EXPECT_NEAR(box_of(paths_of(svg, "Walls, faces")).sizes().x(), 1000 * kWidth / plan.scale,
                1000 * kSide / plan.scale);
  }
}

TEST_F(FloorPlan, FillsWallsKeepsDoorsAndFindsRoomsAndFurniture) {
  const ExportedPlan plan = draw(out / "plan.svg");
  const std::string svg = read_bytes(out / "plan.svg");
  // Five segments of wall: a cross in the middle, and four connected to the outer walls.
  const auto solid = paths_of(svg, "Walls, solid");
  EXPECT_EQ(solid.size(), 5u);
  ASSERT_EQ(plan.storeys[0].rooms.size(), 4u);
  // Each with half of its two doors' depth.
  const double room = (kWidth - kThick) / 2 * (kDepth - kThick) / 2 + kDoor * kThick;
  for (const double area : plan.storeys[0].rooms) EXPECT_NEAR(area, room, 0.01 * room);
  const auto furniture = paths_of(svg, "Furniture");
  ASSERT_EQ(furniture.size(), 1u);
  EXPECT_NEAR(box_of(furniture).sizes().x() * 0.05, 1.4, 2.0 * static_cast<double>(kVoxel));
  EXPECT_NEAR(box_of(furniture).sizes().y() * 0.05, 0.7, 2.0 * static_cast<double>(kVoxel));
}

TEST_F(FloorPlan, IsTheSameForARotatedMap) {
  const Eigen::Quaterniond turn = Eigen::AngleAxisd(0.4, Vector3d::UnitY()) * Eigen::AngleAxisd(0.3, Vector3d::UnitX());
  write_map(
      out / "map.vdb", [&](const Vector3d& p) { return distance(Eigen::AngleAxisd(-0.4, Vector3d::UnitY()) * p); },
      -0.3, 1.45, gravity_alignment_of(turn));
  const ExportedPlan plan = Map::open(out / "map.vdb").export_plan(out / "plan.svg", {.scale = 100});
  EXPECT_NEAR(plan.storeys[0].floor, -kFloorY, 0.005);
  const auto faces = paths_of(read_bytes(out / "plan.svg"), "Walls, faces");
  EXPECT_NEAR(box_of(faces).sizes().x(), 10 * kWidth, 20 * kSide);
  EXPECT_NEAR(box_of(faces).sizes().y(), 10 * kDepth, 20 * kSide);
  EXPECT_LT(mean_off(faces, 100, &distance), kMeanOff);
}

TEST_F(FloorPlan, HasAPageOrAFileForEachStorey) {
  write_map(
      out / "map.vdb",
      [](const Vector3d& p) { return distance(p.y() < kFloorY - 2.7 ? p + Vector3d(0, kStorey, 0) : p); },
      -0.3 - kStorey, 1.45);
  Map map = Map::open(out / "map.vdb");
  const ExportedPlan plan = map.export_plan(out / "plan.svg");
  ASSERT_EQ(plan.storeys.size(), 2u);
  EXPECT_NEAR(plan.storeys[1].floor - plan.storeys[0].floor, kStorey, 0.005);
  EXPECT_EQ(plan.files, (std::vector<fs::path>{out / "plan-1.svg", out / "plan-2.svg"}));
  EXPECT_FALSE(fs::exists(out / "plan.svg"));
  EXPECT_NE(read_bytes(out / "plan-2.svg").find("Storey 2 of 2, floor at +2.80 m"), std::string::npos);
  EXPECT_EQ(map.export_plan(out / "plan.pdf").files, (std::vector<fs::path>{out / "plan.pdf"}));
  const std::string pdf = read_bytes(out / "plan.pdf");
  EXPECT_NE(pdf.find("/Count 2"), std::string::npos);
  EXPECT_NE(pdf.find("/MediaBox [ 0 0 1190.55"), std::string::npos) << "A3, 420 mm wide";
}

TEST_F(FloorPlan, HasTheSameBytesTwice) {
  for (const char* name : {"plan.svg", "plan.pdf", "plan.dxf", "plan.ifc"}) {
    draw(out / name, {.title = "Flat & <co>"});
    const std::string first = read_bytes(out / name);
    draw(out / name, {.title = "Flat & <co>"});
    EXPECT_TRUE(first == read_bytes(out / name)) << name;
    EXPECT_EQ(first.find("CreationDate"), std::string::npos);
  }
}

/// Layer of a DXF file, by an independent reader.
struct DxfLayer {
  double width = 0, height = 0;
  int entities = 0;
  std::vector<std::string> texts;
};
std::map<std::string, DxfLayer> read_dxf(const fs::path& file) {
  const fs::path listed = file.parent_path() / "layers.txt";
  const std::string support = (source_folder() / "tests/support").string();
  const int status = std::system(
      fmt::format("node '{}/read_dxf.mjs' '{}' >'{}' 2>&1", support, file.string(), listed.string()).c_str());
  const std::string lines = read_bytes(listed);
  EXPECT_EQ(status, 0) << lines;
  std::map<std::string, DxfLayer> layers;
  std::istringstream in(lines);
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string name;
    DxfLayer layer;
    words >> name >> layer.width >> layer.height >> layer.entities;
    for (std::string text; words >> text;) layer.texts.push_back(text);
    layers[name] = layer;
  }
  return layers;
}

TEST_F(FloorPlan, IsReadAsDxfInMeters) {
  for (const int scale : {50, 200}) {
    const ExportedPlan plan = draw(out / "plan.dxf", {.scale = scale});
    EXPECT_EQ(plan.files, std::vector<fs::path>{out / "plan.dxf"});
    auto layers = read_dxf(out / "plan.dxf");
    EXPECT_NEAR(layers["WALLS_FACES"].width, kWidth, 2 * kSide);
    EXPECT_NEAR(layers["WALLS_FACES"].height, kDepth, 2 * kSide);
    EXPECT_GE(layers["WALLS_SOLID"].entities, 1);
    EXPECT_EQ(layers["ROOMS"].texts.size(), 4u);
    EXPECT_NE(layers["ROOMS"].texts.at(0).find("_m\\U+00B2"), std::string::npos) << layers["ROOMS"].texts[0];
    EXPECT_EQ(layers.count("GRID") + layers.count("SCALE_BAR"), 0u) << "of the page";
    const DxfLayer& doors = layers["DOORS"];
    ASSERT_EQ(doors.texts.size(), 4u);
    EXPECT_EQ(doors.entities, 8);
    for (const std::string& width : doors.texts) EXPECT_NEAR(std::stod(width), kDoor, 0.03);
  }
}

/// Element of an IFC file, by an independent reader. Meters, z up.
struct IfcElement {
  std::string name;
  Vector3d low, size;
  double area = 0;
  int openings = 0;
};
std::multimap<std::string, IfcElement> read_ifc(const fs::path& file) {
  const fs::path listed = file.parent_path() / "elements.txt";
  const std::string support = (source_folder() / "tests/support").string();
  const int status = std::system(
      fmt::format("node '{}/read_ifc.mjs' '{}' >'{}' 2>&1", support, file.string(), listed.string()).c_str());
  EXPECT_EQ(status, 0) << read_bytes(listed);
  std::multimap<std::string, IfcElement> elements;
  std::istringstream in(read_bytes(listed));
  std::string type;
  for (IfcElement e; in >> type >> e.name >> e.low.x() >> e.low.y() >> e.low.z() >> e.size.x() >> e.size.y() >>
                     e.size.z() >> e.area >> e.openings;)
    elements.emplace(type, e);
  return elements;
}

TEST_F(FloorPlan, IsReadAsBuildingModel) {
  const ExportedPlan plan = draw(out / "plan.ifc", {.title = "Flat d'été"});
  EXPECT_EQ(plan.files, std::vector<fs::path>{out / "plan.ifc"});
  const auto elements = read_ifc(out / "plan.ifc");
  SCOPED_TRACE(read_bytes(out / "elements.txt"));
  ASSERT_EQ(elements.count("storey"), 1u);
  EXPECT_NEAR(elements.find("storey")->second.low.z(), -kFloorY, 0.01);
  // Two inner walls through the middle with two doors each, and the four outer faces between them.
  int inner = 0, doors = 0;
  double outer = 0;
  for (auto [wall, end] = elements.equal_range("wall"); wall != end; ++wall) {
    const IfcElement& e = wall->second;
    EXPECT_NEAR(e.low.z(), -kFloorY, 0.01);
    EXPECT_NEAR(e.size.z(), 2.5, 1e-3) << "no ceiling was observed";
    EXPECT_NEAR(std::min(e.size.x(), e.size.y()), kThick, 0.02);
    const double length = std::max(e.size.x(), e.size.y());
    if (e.openings == 0) {
      outer += length;
      continue;
    }
    ++inner;
    doors += e.openings;
    EXPECT_NEAR(length, e.size.x() > e.size.y() ? kWidth : kDepth, 0.1);
  }
  EXPECT_EQ(inner, 2);
  EXPECT_EQ(doors, 4);
  EXPECT_NEAR(outer, 2 * (kWidth + kDepth) - 4 * kThick, 0.2);
  EXPECT_EQ(elements.count("door"), 4u);
  for (auto [door, end] = elements.equal_range("door"); door != end; ++door)
    EXPECT_NEAR(std::max(door->second.size.x(), door->second.size.y()), kDoor, 0.05);
  ASSERT_EQ(elements.count("space"), 4u);
  const double room = (kWidth - kThick) / 2 * (kDepth - kThick) / 2;
  for (auto [space, end] = elements.equal_range("space"); space != end; ++space) {
    EXPECT_NEAR(space->second.area, room + kDoor * kThick, 0.02 * room);
    // Its outline includes half of the doors' depth.
    EXPECT_NEAR(space->second.size.x(), kWidth / 2, kThick / 2 + 0.01);
    EXPECT_NEAR(space->second.size.y(), kDepth / 2, kThick / 2 + 0.01);
  }
  EXPECT_GE(elements.count("slab"), 1u);
}

TEST_F(FloorPlan, HasTheHeightOfTheCeilingInAModel) {
  write_map(
      out / "map.vdb",
      [](const Vector3d& p) { return distance(p.y() < kFloorY - 2.7 ? p + Vector3d(0, kStorey, 0) : p); },
      -0.3 - kStorey, 1.45);
  (void)Map::open(out / "map.vdb").export_plan(out / "plan.ifc");
  const auto elements = read_ifc(out / "plan.ifc");
  ASSERT_EQ(elements.count("storey"), 2u);
  std::set<long> heights;
  for (auto [wall, end] = elements.equal_range("wall"); wall != end; ++wall)
    heights.insert(std::lround(10 * wall->second.size.z()));
  EXPECT_TRUE(heights.contains(26)) << "from the floor at 1.3 to the ceiling at -1.3 m";
}

TEST_F(FloorPlan, ShowsUnobservedSpaceWithinTheOutline) {
  const double brick = 8.0 * static_cast<double>(kVoxel);
  // Entire bricks: 5 by 4 in the middle of a room, from the floor to the ceiling, and 2 by 8 along its outer wall.
  const auto is_hidden = [brick](const Vector3d& p) {
    const Eigen::Vector3d b = (p / brick).array().floor();
    return (b.x() >= 6 && b.x() < 11 && b.z() >= 5 && b.z() < 9) || (b.x() >= 15 && b.z() >= -12 && b.z() < -4);
  };
  write_map(out / "map.vdb", &distance, -0.3, 1.45, gravity_alignment_of(Eigen::Quaterniond::Identity()),
            [&](const Vector3d& p) { return !is_hidden(p); });
  const auto draw_hidden = [&](bool coverage) {
    return Map::open(out / "map.vdb").export_plan(out / "plan.svg", {.scale = 100, .coverage = coverage}).storeys[0];
  };
  const ExportedStorey storey = draw_hidden(true);
  const std::string svg = read_bytes(out / "plan.svg");
  const double hidden = (5 * 4 + (kWidth / 2 / brick - 15) * 8) * brick * brick;
  constexpr double kRim = 0.35;  // m2: half a voxel around the hidden areas, and rounded corners
  EXPECT_NEAR(storey.unobserved_area, hidden, kRim);
  EXPECT_NEAR(storey.unobserved_share, storey.unobserved_area / (kWidth * kDepth), 0.01);
  EXPECT_EQ(paths_of(svg, "Not looked at").size(), 2u);
  EXPECT_NE(svg.find("not observed: "), std::string::npos);
  EXPECT_EQ(svg.find("\"Not seen\""), std::string::npos);
  // Low objects do not hide the space above: a completely observed storey has no unobserved area.
  const ExportedStorey seen = draw(out / "plan.svg", {.scale = 100, .coverage = true}).storeys[0];
  EXPECT_LT(seen.unobserved_area, 0.02);
  EXPECT_EQ(draw_hidden(false).unobserved_area, 0);
}

TEST_F(FloorPlan, ExplainsWhyThereIsNoPlan) {
  EXPECT_NE(error_of([&] { draw(out / "plan.svg", {.loops = true}); }).find("has no loops"), std::string::npos);
  EXPECT_NE(error_of([&] { draw(out / "plan.dwg"); }).find("use .svg, .pdf, .dxf or .ifc"), std::string::npos);
  EXPECT_NE(error_of([&] { draw(out / "plan.svg", {.height = 0}); }).find("must be between 0.3 and 3"),
            std::string::npos);
  EXPECT_NE(error_of([&] { draw(out / "plan.svg", {.scale = -1}); }).find("PlanOptions::scale is -1"),
            std::string::npos);
  write_map(out / "lying.vdb", &distance, 0.9, 1.45, {.description = "not known; hold the camera upright"});
  EXPECT_NE(
      error_of([&] {
        (void)Map::open(out / "lying.vdb").export_plan(out / "plan.svg");
      }).find("the up axis is unknown, so the map cannot be cut horizontally: not known; hold the camera upright"),
      std::string::npos);
  write_map(out / "wall.vdb", &distance, -0.3, 0.3);
  EXPECT_NE(
      error_of([&] { (void)Map::open(out / "wall.vdb").export_plan(out / "plan.svg"); }).find("no floor was found"),
      std::string::npos);
  write_map(out / "low.vdb", &distance, 0.9, 1.45);
  EXPECT_NE(error_of([&] {
              (void)Map::open(out / "low.vdb").export_plan(out / "plan.svg");
            }).find("no surface at 1.2 m above the floor"),
            std::string::npos);
  EXPECT_FALSE(fs::exists(out / "plan.svg"));
}

}  // namespace
}  // namespace cairn
