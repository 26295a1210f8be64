// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/floor_plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "base/atomic_file.hpp"
#include "base/file_name.hpp"
#include "export/check_range.hpp"
#include "export/export_run.hpp"
#include "floor_plan/ifc.hpp"
#include "floor_plan/layout.hpp"
#include "floor_plan/storeys.hpp"
#include "geometry/mesh_vertices.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr double kBelow = 0.15;  // meters below a floor, included in its plan

/// Transform between the world and the map's own frame, bricks and voxels.
class MapTransform {
 public:
  explicit MapTransform(const MapChunks& map)
      : world_from_map_(map.upright.world_from_tracked), voxel_(static_cast<double>(map.voxel_size())) {}
  [[nodiscard]] double voxel() const { return voxel_; }
  /// Bounding box of a brick in the world.
  [[nodiscard]] Eigen::AlignedBox3d box_of(const Brick& brick) const {
    Eigen::AlignedBox3d box;
    for (int corner = 0; corner < 8; ++corner)
      box.extend(world_from_map_ *
                 (8 * voxel_ * (brick + Brick(corner & 1, corner >> 1 & 1, corner >> 2)).cast<double>()));
    return box;
  }
  /// Voxel nearest to a point of the world.
  [[nodiscard]] Eigen::Vector3i voxel_at(const Eigen::Vector3d& p) const {
    return (world_from_map_.conjugate() * p / voxel_).array().round().cast<int>();
  }
  [[nodiscard]] Eigen::Vector3d position_of(const Eigen::Vector3i& voxel) const {
    return world_from_map_ * (voxel.cast<double>() * voxel_);
  }

 private:
  Eigen::Quaterniond world_from_map_;
  double voxel_;  // meters
};

/// Calls `visit` with the surface of some bricks in the world, part by part, after `on_loaded` with the part's bricks,
/// whose voxels are then on the host.
template <class Loaded, class Visit>
void for_each_part(const MapChunks& map, std::vector<Brick> bricks, const Loaded& on_loaded, const Visit& visit) {
  for (const std::vector<Brick>& part : split_bricks(std::move(bricks))) {
    map.load_around(part);
    on_loaded(part);
    visit(turned(map.polygonizer.polygonize(map.volume, part), map.upright.world_from_tracked), part.size());
  }
}

/// State of a brick's voxels. Unobserved voxels are free by `bits`. `voxels` may be null.
class VoxelStates {
 public:
  VoxelStates(const std::uint64_t* voxels, const BrickBits& bits) : voxels_(voxels), bits_(bits) {}
  [[nodiscard]] bool is_free(std::size_t i) const { return is_observed(i) ? distance(i) > 0 : is_marked(i); }
  /// True for free voxels and at a surface; farther behind a surface is unknown.
  [[nodiscard]] bool is_seen(std::size_t i) const {
    constexpr float kMinSurfaceDistance = -0.25f;  // truncations: one voxel
    return is_observed(i) ? distance(i) > kMinSurfaceDistance : is_marked(i);
  }

 private:
  [[nodiscard]] bool is_observed(std::size_t i) const {
    return voxels_ != nullptr && shader::voxel_weight(voxels_[i]) > 0;
  }
  [[nodiscard]] float distance(std::size_t i) const { return shader::voxel_distance(voxels_[i]); }
  [[nodiscard]] bool is_marked(std::size_t i) const { return (bits_[i / 64] >> (i % 64) & 1) != 0; }
  const std::uint64_t* voxels_;
  BrickBits bits_;
};

/// Marks the cells in free voxels of a brick at the height where walls are cut.
void mark_free(const MapTransform& map_transform, const Brick& brick, const VoxelStates& voxels,
               plan::StoreyRaster& raster) {
  const plan::Grid& grid = raster.grid();
  const Eigen::AlignedBox3d box = map_transform.box_of(brick);
  const double reach = map_transform.voxel();
  const double at = -raster.cut_height();
  if (at < box.min().y() - reach || at > box.max().y() + reach) return;
  const cv::Point low = grid.cell_of({box.min().x() - reach, box.min().z() - reach}),
                  high = grid.cell_of({box.max().x() + reach, box.max().z() + reach});
  constexpr int kMargin = plan::Grid::kMargin;  // stays empty: free space may exceed the grid
  for (int y = std::max(kMargin, low.y); y < std::min(grid.height - kMargin, high.y + 1); ++y)
    for (int x = std::max(kMargin, low.x); x < std::min(grid.width - kMargin, high.x + 1); ++x) {
      const plan::Point p = grid.center({x, y});
      const Eigen::Vector3i voxel = map_transform.voxel_at({p.x(), at, p.y()}) - 8 * brick;
      if (voxel.minCoeff() < 0 || voxel.maxCoeff() > 7) continue;
      const auto i = static_cast<std::size_t>((voxel.x() * 8 + voxel.y()) * 8 + voxel.z());
      if (voxels.is_free(i)) raster.mark_free({x, y});
    }
}

/// Marks the cells with an observed brick between the floor and the cut.
void mark_seen(const MapTransform& map_transform, const Brick& brick, const VoxelStates& voxels,
               plan::StoreyRaster& raster) {
  const Eigen::AlignedBox3d box = map_transform.box_of(brick);
  if (-box.max().y() > raster.cut_height() || -box.min().y() < raster.floor() - kBelow) return;
  for (int i = 0; i < 512; ++i) {
    if (!voxels.is_seen(static_cast<std::size_t>(i))) continue;
    const Eigen::Vector3d p = map_transform.position_of(8 * brick + Brick(i >> 6, i >> 3 & 7, i & 7));
    if (-p.y() <= raster.cut_height() && -p.y() >= raster.floor() - kBelow) raster.mark_seen({p.x(), p.z()});
  }
}

/// Surveys an entire storey.
plan::StoreyPlan rasterize_storey(const MapChunks& map, const plan::Grid& grid, double floor,
                                  const PlanOptions& options, const std::function<void(std::size_t)>& step) {
  const MapTransform map_transform(map);
  plan::StoreyRaster raster(grid, floor, static_cast<double>(options.height));
  std::vector<Brick> bricks;
  for (const Brick& brick : map.bricks) {
    const Eigen::AlignedBox3d box = map_transform.box_of(brick);
    if (-box.max().y() - map_transform.voxel() <= raster.cut_height() && -box.min().y() >= floor - kBelow)
      bricks.push_back(brick);
  }
  const auto mark = [&](const Brick& brick, const VoxelStates& voxels) {
    mark_free(map_transform, brick, voxels, raster);
    if (options.coverage) mark_seen(map_transform, brick, voxels, raster);
  };
  for (const Brick& brick : map.free.free_bricks()) mark(brick, {nullptr, map.free.free_voxels(brick)});
  for_each_part(
      map, bricks,
      [&](const std::vector<Brick>& part) {
        const BrickTree& tree = map.volume.on_host();
        for (const Brick& brick : part)
          if (const std::uint64_t* voxels = tree.find(brick)) mark(brick, {voxels, kNoBits});
      },
      [&](const Mesh& mesh, std::size_t count) {
        raster.add(mesh);
        step(count);
      });
  return plan::plan_of(raster, map_transform.voxel(),
                       options.coverage ? plan::Coverage::included : plan::Coverage::omitted);
}

struct Floor {
  double at = 0, height = 0;  // meters above the world's origin; to the ceiling
};

std::vector<Floor> floors_of(const PlanInput& input, const fs::path& file,
                             const std::function<void(std::size_t)>& step) {
  constexpr double kMaxHeight = 8;  // meters from a floor to its ceiling
  plan::LevelSurface levels;
  for_each_part(
      input.map, input.map.bricks, [](const std::vector<Brick>&) {},
      [&](const Mesh& mesh, std::size_t count) {
        levels.add(mesh);
        step(count);
      });
  const std::vector<double> heights = levels.floors(input.paths);
  if (heights.empty())
    throw not_written(file,
                      "no floor was found: the map has no level surface of a quarter of a square meter below the "
                      "camera's path");
  std::vector<Floor> floors;
  for (std::size_t i = 0; i < heights.size(); ++i) {
    const double max = i + 1 < heights.size() ? heights[i + 1] - heights[i] : kMaxHeight;
    floors.push_back({heights[i], levels.height_above(heights[i], max).value_or(std::min(max, plan::kNominalHeight))});
  }
  return floors;
}

std::vector<fs::path> write(const plan::Pages& pages, const std::vector<plan::StoreyPlan>& storeys,
                            const std::string& title, const fs::path& file) {
  if (extension_of(file) == ".pdf") {
    write_whole(file, plan::pdf_of(pages.sheets));
    return {file};
  }
  if (extension_of(file) == ".ifc") {
    write_whole(file, plan::ifc_of(storeys, title));
    return {file};
  }
  const bool is_drawing = extension_of(file) == ".dxf";
  std::vector<fs::path> files;
  for (std::size_t i = 0; i < pages.sheets.size(); ++i) {
    fs::path one = file;
    if (pages.sheets.size() > 1)
      one.replace_filename(fmt::format("{}-{}{}", file.stem().string(), i + 1, file.extension().string()));
    write_whole(one, is_drawing ? plan::dxf_of(pages.sheets[i], pages.scale) : plan::svg_of(pages.sheets[i]));
    files.push_back(one);
  }
  return files;
}

ExportedStorey report_of(const plan::StoreyPlan& storey) {
  ExportedStorey report{.floor = storey.floor,
                        .floor_area = storey.floor_area,
                        .rooms = {},
                        .unobserved_area = storey.unobserved_area,
                        .unobserved_share = storey.unobserved_share,
                        .walls = storey.walls.length,
                        .mean_off = storey.walls.mean_off,
                        .p95_off = storey.walls.p95_off,
                        .max_off = storey.walls.max_off};
  for (const plan::Room& room : storey.rooms) report.rooms.push_back(room.area);
  std::sort(report.rooms.rbegin(), report.rooms.rend());
  return report;
}

}  // namespace

void check(const PlanOptions& options, const fs::path& file) {
  if (const std::string extension = extension_of(file);
      extension != ".svg" && extension != ".pdf" && extension != ".dxf" && extension != ".ifc")
    throw std::runtime_error(fmt::format("{}: '{}' is not a supported format for plans; use .svg, .pdf, .dxf or .ifc",
                                         file.string(), file.extension().string()));
  check_range("PlanOptions::height", options.height);
  check_range("PlanOptions::scale", options.scale);
}

ExportedPlan export_floor_plan(const PlanInput& input, const fs::path& file, const PlanOptions& options,
                               const ExportProgress& progress) {
  constexpr int kSteps = 1000;
  check(options, file);
  if (input.map.bricks.empty()) throw not_written(file, "the map is empty: no frame was fused into it");
  if (!input.map.upright.known)
    throw not_written(
        file, "the up axis is unknown, so the map cannot be cut horizontally: " + input.map.upright.description);
  std::size_t done = 0, total = 2 * input.map.bricks.size();
  const auto progress_step = [&](const char* next) {
    return [&, next](std::size_t count) {
      done += count;
      if (progress)
        progress(static_cast<int>(std::min(0.99, static_cast<double>(done) / static_cast<double>(total)) * kSteps),
                 kSteps, next);
    };
  };
  const std::vector<Floor> floors = floors_of(input, file, progress_step("finding floors"));
  const MapTransform map_transform(input.map);
  plan::Box box;
  for (const Brick& brick : input.map.bricks) {
    const Eigen::AlignedBox3d b = map_transform.box_of(brick);
    box.extend(plan::Point(b.min().x(), b.min().z()));
    box.extend(plan::Point(b.max().x(), b.max().z()));
  }
  const plan::Grid grid = plan::Grid::around(box, map_transform.voxel());
  std::vector<plan::StoreyPlan> storeys;
  for (const auto& [floor, height] : floors) {
    plan::StoreyPlan storey = rasterize_storey(input.map, grid, floor, options, progress_step("cutting walls"));
    storey.height = height;
    if (!storey.walls.lines.empty()) storeys.push_back(std::move(storey));
  }
  if (storeys.empty())
    throw not_written(
        file, fmt::format("no surface at {} m above the floor: cut lower, PlanOptions::height", options.height));
  const plan::Pages pages = plan::laid_out(storeys, input.paths, input.loops, options);
  ExportedPlan exported{.scale = pages.scale,
                        .paper = pages.paper,
                        .width_mm = pages.sheets[0].width,
                        .height_mm = pages.sheets[0].height,
                        .storeys = {},
                        .loops = pages.loops,
                        .loops_between = pages.loops_between,
                        .files = write(pages, storeys, options.title, file)};
  for (const plan::StoreyPlan& storey : storeys) exported.storeys.push_back(report_of(storey));
  if (progress) progress(kSteps, kSteps, "done");
  return exported;
}

}  // namespace cairn
