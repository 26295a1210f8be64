// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <unordered_set>
#include <utility>

#include "base/mesh_vertices.hpp"
#include "cairn/atomic_file.hpp"
#include "cairn/file_name.hpp"
#include "export/export_run.hpp"
#include "plan/layout.hpp"
#include "plan/storeys.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kPart = 8192;  // bricks: 32 MiB
constexpr int kCell = 16;            // bricks a side of what is made together
constexpr double kBelow = 0.15;      // metres below a floor that a plan looks at

/// The map's own frame, bricks and voxels, in the world.
class Placing {
 public:
  explicit Placing(const PlanInput& input)
      : world_from_map_(input.upright.world_from_tracked),
        voxel_(static_cast<double>(input.volume.options().voxel_size)) {}
  [[nodiscard]] double voxel() const { return voxel_; }
  /// Around a brick, in the world.
  [[nodiscard]] Eigen::AlignedBox3d box_of(const Brick& brick) const {
    Eigen::AlignedBox3d box;
    for (int corner = 0; corner < 8; ++corner)
      box.extend(world_from_map_ *
                 (8 * voxel_ * (brick + Brick(corner & 1, corner >> 1 & 1, corner >> 2)).cast<double>()));
    return box;
  }
  /// The voxel that is nearest to a point of the world.
  [[nodiscard]] Eigen::Vector3i voxel_at(const Eigen::Vector3d& p) const {
    return (world_from_map_.conjugate() * p / voxel_).array().round().cast<int>();
  }

 private:
  Eigen::Quaterniond world_from_map_;
  double voxel_;  // metres
};

/// Calls `visit` with the surface in some bricks, in the world, part by part; before it `loaded` with the bricks of the
/// part, whose voxels are on the host then.
template <class Loaded, class Visit>
void for_each_part(const PlanInput& input, std::vector<Brick> bricks, const Loaded& loaded, const Visit& visit) {
  std::sort(bricks.begin(), bricks.end(), [](const Brick& a, const Brick& b) { return before_by_cell(a, b, kCell); });
  for (std::size_t i = 0; i < bricks.size(); i += kPart) {
    std::vector<Brick> part(bricks.begin() + static_cast<std::ptrdiff_t>(i),
                            bricks.begin() + static_cast<std::ptrdiff_t>(std::min(bricks.size(), i + kPart)));
    std::sort(part.begin(), part.end(), before);
    if (input.load) {
      std::unordered_set<Brick, BrickHash> around;
      for (const Brick& brick : part)
        for (int k = 0; k < 27; ++k)
          if (const Brick b = brick + Brick(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
              std::binary_search(input.bricks.begin(), input.bricks.end(), b, before))
            around.insert(b);
      std::vector<Brick> wanted(around.begin(), around.end());
      std::sort(wanted.begin(), wanted.end(), before);
      input.load(wanted);
    }
    loaded(part);
    visit(turned(input.polygonizer.polygonize(input.volume, part), input.upright.world_from_tracked), part.size());
  }
}

/// Marks the cells that lie in free voxels of a brick. `voxels` may be null.
void mark_free(const Placing& placing, const Brick& brick, const std::uint64_t* voxels, const BrickBits& bits,
               plan::Survey& survey) {
  const plan::Grid& grid = survey.grid();
  const Eigen::AlignedBox3d box = placing.box_of(brick);
  const double reach = placing.voxel();
  const double at = -survey.cut_height();
  if (at < box.min().y() - reach || at > box.max().y() + reach) return;
  const cv::Point low = grid.cell_of({box.min().x() - reach, box.min().z() - reach}),
                  high = grid.cell_of({box.max().x() + reach, box.max().z() + reach});
  constexpr int kMargin = plan::Grid::kMargin;  // stays empty: more may be free than the grid is around
  for (int y = std::max(kMargin, low.y); y < std::min(grid.height - kMargin, high.y + 1); ++y)
    for (int x = std::max(kMargin, low.x); x < std::min(grid.width - kMargin, high.x + 1); ++x) {
      const plan::Point p = grid.centre({x, y});
      const Eigen::Vector3i voxel = placing.voxel_at({p.x(), at, p.y()}) - 8 * brick;
      if (voxel.minCoeff() < 0 || voxel.maxCoeff() > 7) continue;
      const auto i = static_cast<std::size_t>((voxel.x() * 8 + voxel.y()) * 8 + voxel.z());
      const bool is_observed = voxels != nullptr && shader::voxel_weight(voxels[i]) > 0;
      if (is_observed ? shader::voxel_distance(voxels[i]) > 0 : (bits[i / 64] >> (i % 64) & 1) != 0)
        survey.mark_free({x, y});
    }
}

/// Looks at all of a storey.
plan::StoreyPlan look_at(const PlanInput& input, const plan::Grid& grid, double floor, const PlanOptions& options,
                         const std::function<void(std::size_t)>& step) {
  const Placing placing(input);
  plan::Survey survey(grid, floor, static_cast<double>(options.height));
  std::vector<Brick> bricks;
  for (const Brick& brick : input.bricks) {
    const Eigen::AlignedBox3d box = placing.box_of(brick);
    if (-box.max().y() - placing.voxel() <= survey.cut_height() && -box.min().y() >= floor - kBelow)
      bricks.push_back(brick);
  }
  for (const Brick& brick : input.free.free_bricks())
    mark_free(placing, brick, nullptr, input.free.free_voxels(brick), survey);
  for_each_part(
      input, bricks,
      [&](const std::vector<Brick>& part) {
        const BrickTree& tree = input.volume.on_host();
        for (const Brick& brick : part)
          if (const std::uint64_t* voxels = tree.find(brick)) mark_free(placing, brick, voxels, {}, survey);
      },
      [&](const Mesh& mesh, std::size_t count) {
        survey.add(mesh);
        step(count);
      });
  return plan::plan_of(survey, placing.voxel());
}

std::vector<double> floors_of(const PlanInput& input, const fs::path& file,
                              const std::function<void(std::size_t)>& step) {
  plan::LevelSurface levels;
  for_each_part(
      input, input.bricks, [](const std::vector<Brick>&) {},
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
  constexpr float kLeast = 0.3f, kMost = 3.0f;
  constexpr int kMostScale = 5000;
  if (const std::string extension = extension_of(file); extension != ".svg" && extension != ".pdf")
    throw std::runtime_error(
        fmt::format("{}: '{}' is no format of a plan; use .svg or .pdf", file.string(), file.extension().string()));
  if (!(options.height >= kLeast && options.height <= kMost))
    throw std::runtime_error(
        fmt::format("PlanOptions::height is {}: it must be between {} and {}", options.height, kLeast, kMost));
  if (options.scale < 0 || options.scale > kMostScale)
    throw std::runtime_error(
        fmt::format("PlanOptions::scale is {}: it must be between 1 and {}, or 0", options.scale, kMostScale));
}

ExportedPlan export_floor_plan(const PlanInput& input, const fs::path& file, const PlanOptions& options,
                               const ExportProgress& progress) {
  constexpr int kWhole = 1000;
  check(options, file);
  if (input.bricks.empty()) throw not_written(file, "the map is empty: no frame was fused into it");
  if (!input.upright.known)
    throw not_written(file,
                      "the map does not tell which way is up, so nobody knows how to cut it: " + input.upright.words);
  std::size_t done = 0, whole = 2 * input.bricks.size();
  const auto stepping = [&](const char* next) {
    return [&, next](std::size_t count) {
      done += count;
      if (progress)
        progress(static_cast<int>(std::min(0.99, static_cast<double>(done) / static_cast<double>(whole)) * kWhole),
                 kWhole, next);
    };
  };
  const std::vector<double> floors = floors_of(input, file, stepping("finding floors"));
  const Placing placing(input);
  plan::Box box;
  for (const Brick& brick : input.bricks) {
    const Eigen::AlignedBox3d b = placing.box_of(brick);
    box.extend(plan::Point(b.min().x(), b.min().z()));
    box.extend(plan::Point(b.max().x(), b.max().z()));
  }
  const plan::Grid grid = plan::Grid::around(box, placing.voxel());
  std::vector<plan::StoreyPlan> storeys;
  for (const double floor : floors) {
    plan::StoreyPlan storey = look_at(input, grid, floor, options, stepping("cutting walls"));
    if (!storey.walls.lines.empty()) storeys.push_back(std::move(storey));
  }
  if (storeys.empty())
    throw not_written(
        file, fmt::format("nothing stands {} m above the floor: cut it lower, PlanOptions::height", options.height));
  const plan::Pages pages = plan::laid_out(storeys, input.paths, options);
  ExportedPlan exported{.scale = pages.scale,
                        .paper = pages.paper,
                        .width_mm = pages.sheets[0].width,
                        .height_mm = pages.sheets[0].height,
                        .storeys = {},
                        .files = write(pages, file)};
  for (const plan::StoreyPlan& storey : storeys) exported.storeys.push_back(told(storey));
  if (progress) progress(kWhole, kWhole, "done");
  return exported;
}

}  // namespace cairn
