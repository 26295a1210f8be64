// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <memory>
#include <stdexcept>
#include <utility>

#include "cairn/building/project.hpp"
#include "export/cells.hpp"
#include "export/map_contents.hpp"
#include "multisession/cells.hpp"
#include "volume/vdb/map_vdb.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr int kMarginBricks = 2;  // bricks around the requested range: surfaces and queries read neighboring voxels
// Meters: a distance field also covers gaps up to this width between observed places.
constexpr double kMinMargin = 0.8;

constexpr const char* kVoxels = "map.vdb";

[[nodiscard]] Brick brick_of(const CellName& cell) { return {cell[0], cell[1], cell[2]}; }

}  // namespace

CellMap::CellMap(const fs::path& plan, const CellName& cell, double max_distance, int device)
    : plan_(plan), cell_(cell), max_distance_(max_distance), device_(device) {
  const std::vector<CellName> cells = cells_of(plan);
  if (!std::binary_search(cells.begin(), cells.end(), cell))
    throw std::runtime_error(cell_file(plan, cell).string() + ": is missing: the map does not reach this cell");
  const GridInfo info = MapFile(file_of_cell(plan, cell, kVoxels)).info();
  voxel_size_ = info.voxel_size;
  world_from_map_ = info.upright.world_from_tracked.cast<float>();
}

Map& CellMap::map() {
  if (map_) return *map_;
  const fs::path file = file_of_cell(plan_, cell_, kVoxels);
  const MapFile own(file);
  ReadGrids grids{.info = own.info()};
  const double brick = 8.0 * static_cast<double>(voxel_size_);
  const Brick margin =
      Brick::Constant(kMarginBricks + static_cast<int>(std::ceil(std::max(kMinMargin, max_distance_) / brick)));
  BrickBox box = Cells::box_of(brick_of(cell_));
  box = {box.min() - margin, box.max() + margin};
  own.read(box, grids.tree);
  for (const CellName& other : cells_of(plan_))
    if (other != cell_ && box.intersects(Cells::box_of(brick_of(other))))
      MapFile(file_of_cell(plan_, other, kVoxels)).read(box, grids.tree);
  return map_.emplace(map_of_box(file, std::move(grids), box, device_));
}

void CellMap::set_up_axis(Up up) {
  map().set_up_axis(up);
  world_from_map_ = map().upright().world_from_tracked.cast<float>();
}

bool CellMap::contains(const Eigen::Vector3f& point) const {
  constexpr int kSide = 8 * Cells::kBlockSide;  // voxels
  const Eigen::Vector3f voxel = world_from_map_.conjugate() * point / voxel_size_;
  for (int i = 0; i < 3; ++i)
    if (static_cast<int>(std::floor((voxel[i] + 0.5f) / kSide)) != cell_[static_cast<std::size_t>(i)]) return false;
  return true;
}

std::shared_ptr<const DistanceField> CellMap::within(const DistanceField& field) const {
  DistanceField::Blocks own;
  std::copy_if(field.blocks().begin(), field.blocks().end(), std::back_inserter(own), [&](const auto& block) {
    return contains(field.point(16.0f * (block.index.template cast<float>() + Eigen::Vector3f::Constant(0.5f))));
  });
  return std::make_shared<const DistanceField>(field.voxel_size(), field.origin(), field.max_distance(), std::move(own),
                                               field.world_from_field());
}

}  // namespace cairn
