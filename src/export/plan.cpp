// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "base/mesh_vertices.hpp"
#include "cairn/atomic_file.hpp"
#include "cairn/file_name.hpp"
#include "export/check_range.hpp"
#include "export/export_run.hpp"
#include "plan/layout.hpp"
#include "plan/storeys.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr double kBelow = 0.15;  // meters below a floor, included in its plan

/// Transform between the world and the map's own frame, bricks and voxels.
class Placing {
 public:
  explicit Placing(const MapParts& map)
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
  [[nodiscard]] Eigen::Vector3d place_of(const Eigen::Vector3i& voxel) const {
    return world_from_map_ * (voxel.cast<double>() * voxel_);
  }

 private:
  Eigen::Quaterniond world_from_map_;
  double voxel_;  // meters
};

/// Calls `visit` with the surface of some bricks in the world, part by part, after `loaded` with the part's bricks,
/// whose voxels are then on the host.
template <class Loaded, class Visit>
void for_each_part(const MapParts& map, std::vector<Brick> bricks, const Loaded& loaded, const Visit& visit) {
  for (const std::vector<Brick>& part : in_parts(std::move(bricks))) {
    map.bring_around(part);
    loaded(part);
    visit(turned(map.polygonizer.polygonize(map.volume, part), map.upright.world_from_tracked), part.size());
  }
}

/// State of a brick's voxels. Unobserved voxels are free by `bits`. `voxels` may be null.
class Known {
 public:
  Known(const std::uint64_t* voxels, const BrickBits& bits) : voxels_(voxels), bits_(bits) {}
  [[nodiscard]] bool is_free(std::size_t i) const { return is_observed(i) ? distance(i) > 0 : is_marked(i); }
  /// True for free voxels and at a surface; farther behind a surface is unknown.
  [[nodiscard]] bool is_seen(std::size_t i) const {
    constexpr float kAtSurface = -0.25f;  // truncations: one voxel
    return is_observed(i) ? distance(i) > kAtSurface : is_marked(i);
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
void mark_free(const Placing& placing, const Brick& brick, const Known& known, plan::Survey& survey) {
  const plan::Grid& grid = survey.grid();
  const Eigen::AlignedBox3d box = placing.box_of(brick);
  const double reach = placing.voxel();
  const double at = -survey.cut_height();
  if (at < box.min().y() - reach || at > box.max().y() + reach) return;
  const cv::Point low = grid.cell_of({box.min().x() - reach, box.min().z() - reach}),
                  high = grid.cell_of({box.max().x() + reach, box.max().z() + reach});
  constexpr int kMargin = plan::Grid::kMargin;  // stays empty: free space may exceed the grid
  for (int y = std::max(kMargin, low.y); y < std::min(grid.height - kMargin, high.y + 1); ++y)
    for (int x = std::max(kMargin, low.x); x < std::min(grid.width - kMargin, high.x + 1); ++x) {
      const plan::Point p = grid.centre({x, y});
      const Eigen::Vector3i voxel = placing.voxel_at({p.x(), at, p.y()}) - 8 * brick;
      if (voxel.minCoeff() < 0 || voxel.maxCoeff() > 7) continue;
      const auto i = static_cast<std::size_t>((voxel.x() * 8 + voxel.y()) * 8 + voxel.z());
      if (known.is_free(i)) survey.mark_free({x, y});
    }
}

/// Marks the cells with an observed brick between the floor and the cut.
void mark_seen(const Placing& placing, const Brick& brick, const Known& known, plan::Survey& survey) {
  const Eigen::AlignedBox3d box = placing.box_of(brick);
  if (-box.max().y() > survey.cut_height() || -box.min().y() < survey.floor() - kBelow) return;
  for (int i = 0; i < 512; ++i) {
    if (!known.is_seen(static_cast<std::size_t>(i))) continue;
    const Eigen::Vector3d p = placing.place_of(8 * brick + Brick(i >> 6, i >> 3 & 7, i & 7));
    if (-p.y() <= survey.cut_height() && -p.y() >= survey.floor() - kBelow) survey.mark_seen({p.x(), p.z()});
  }
}

/// Surveys an entire storey.
plan::StoreyPlan look_at(const MapParts& map, const plan::Grid& grid, double floor, const PlanOptions& options,
                         const std::function<void(std::size_t)>& step) {
  const Placing placing(map);
  plan::Survey survey(grid, floor, static_cast<double>(options.height));
  std::vector<Brick> bricks;
  for (const Brick& brick : map.bricks) {
    const Eigen::AlignedBox3d box = placing.box_of(brick);
    if (-box.max().y() - placing.voxel() <= survey.cut_height() && -box.min().y() >= floor - kBelow)
      bricks.push_back(brick);
  }
  const auto mark = [&](const Brick& brick, const Known& known) {
    mark_free(placing, brick, known, survey);
    if (options.coverage) mark_seen(placing, brick, known, survey);
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
        survey.add(mesh);
        step(count);
      });
  return plan::plan_of(survey, placing.voxel(), options.coverage ? plan::Coverage::told : plan::Coverage::left_out);
}

std::vector<double> floors_of(const PlanInput& input, const fs::path& file,
                              const std::function<void(std::size_t)>& step) {
  plan::LevelSurface levels;
  for_each_part(
      input.map, input.map.bricks, [](const std::vector<Brick>&) {},
      [&](const Mesh& mesh, std::size_t count) {
        levels.add(mesh);
        step(count);
      });
  std::vector<double> floors = levels.floors(input.paths);
  if (floors.empty())
    throw not_written(file,
                      "no floor was found: at no height under the camera's path the map has a quarter of a square "
                      "metre of surface that faces up");
  return floors;
}

std::vector<fs::path> write(const plan::Pages& pages, const fs::path& file) {
  if (extension_of(file) == ".pdf") {
    write_whole(file, plan::pdf_of(pages.sheets));
    return {file};
  }
  std::vector<fs::path> files;
  for (std::size_t i = 0; i < pages.sheets.size(); ++i) {
    fs::path one = file;
    if (pages.sheets.size() > 1)
      one.replace_filename(fmt::format("{}-{}{}", file.stem().string(), i + 1, file.extension().string()));
    write_whole(one, plan::svg_of(pages.sheets[i]));
    files.push_back(one);
  }
  return files;
}

ExportedStorey told(const plan::StoreyPlan& storey) {
  ExportedStorey told{.floor = storey.floor,
                      .floor_area = storey.floor_area,
                      .rooms = {},
                      .not_looked_at = storey.not_looked_at,
                      .not_looked_at_share = storey.not_looked_at_share,
                      .walls = storey.walls.length,
                      .mean_off = storey.walls.mean_off,
                      .p95_off = storey.walls.p95_off,
                      .max_off = storey.walls.max_off};
  for (const plan::Room& room : storey.rooms) told.rooms.push_back(room.area);
  std::sort(told.rooms.rbegin(), told.rooms.rend());
  return told;
}

}  // namespace

void check(const PlanOptions& options, const fs::path& file) {
  if (const std::string extension = extension_of(file); extension != ".svg" && extension != ".pdf")
    throw std::runtime_error(
        fmt::format("{}: '{}' is no format of a plan; use .svg or .pdf", file.string(), file.extension().string()));
  check_range("PlanOptions::height", options.height);
  check_range("PlanOptions::scale", options.scale);
}

ExportedPlan export_floor_plan(const PlanInput& input, const fs::path& file, const PlanOptions& options,
                               const ExportProgress& progress) {
  constexpr int kWhole = 1000;
  check(options, file);
  if (input.map.bricks.empty()) throw not_written(file, "the map is empty: no frame was fused into it");
  if (!input.map.upright.known)
    throw not_written(
        file, "the map does not tell which way is up, so nobody knows how to cut it: " + input.map.upright.words);
  std::size_t done = 0, whole = 2 * input.map.bricks.size();
  const auto stepping = [&](const char* next) {
    return [&, next](std::size_t count) {
      done += count;
      if (progress)
        progress(static_cast<int>(std::min(0.99, static_cast<double>(done) / static_cast<double>(whole)) * kWhole),
                 kWhole, next);
    };
  };
  const std::vector<double> floors = floors_of(input, file, stepping("finding floors"));
  const Placing placing(input.map);
  plan::Box box;
  for (const Brick& brick : input.map.bricks) {
    const Eigen::AlignedBox3d b = placing.box_of(brick);
    box.extend(plan::Point(b.min().x(), b.min().z()));
    box.extend(plan::Point(b.max().x(), b.max().z()));
  }
  const plan::Grid grid = plan::Grid::around(box, placing.voxel());
  std::vector<plan::StoreyPlan> storeys;
  for (const double floor : floors) {
    plan::StoreyPlan storey = look_at(input.map, grid, floor, options, stepping("cutting walls"));
    if (!storey.walls.lines.empty()) storeys.push_back(std::move(storey));
  }
  if (storeys.empty())
    throw not_written(
        file, fmt::format("nothing stands {} m above the floor: cut it lower, PlanOptions::height", options.height));
  const plan::Pages pages = plan::laid_out(storeys, input.paths, input.loops, options);
  ExportedPlan exported{.scale = pages.scale,
                        .paper = pages.paper,
                        .width_mm = pages.sheets[0].width,
                        .height_mm = pages.sheets[0].height,
                        .storeys = {},
                        .loops = pages.loops,
                        .loops_between = pages.loops_between,
                        .files = write(pages, file)};
  for (const plan::StoreyPlan& storey : storeys) exported.storeys.push_back(told(storey));
  if (progress) progress(kWhole, kWhole, "done");
  return exported;
}

}  // namespace cairn
