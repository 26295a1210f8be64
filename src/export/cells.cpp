// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/cells.hpp"

#include <algorithm>
#include <cmath>

namespace cairn {
namespace {

constexpr std::size_t kMaxSingleCell = 32768;         // bricks: smaller maps are not divided into cells by default
constexpr int kDefaultCellSide = 64, kTileSide = 32;  // bricks a side

}  // namespace

int Cells::margin(const CleanOptions& clean, float brick_size) {
  return 2 + static_cast<int>(std::max(3 * clean.min_component, clean.fill_holes) / brick_size);
}

Cells::Cells(const std::vector<Brick>& bricks, float brick_size, bool as_tiles, const ExportOptions& options,
             const std::optional<Brick>& block) {
  static_assert(kBlockSide == kTileSide << kBlockLevels);
  if (block)
    side_ = kTileSide;
  else if (options.cell_size > 0)
    side_ = std::max(4, static_cast<int>(std::lround(options.cell_size / brick_size)));
  else if (as_tiles || bricks.size() > kMaxSingleCell)
    side_ = as_tiles ? kTileSide : kDefaultCellSide;
  if (side_ == 0) {
    cells_[{0, 0, 0}] = bricks;
    return;
  }
  side_length_ = static_cast<float>(side_) * brick_size;
  origin_ = block ? Brick(*block * (kBlockSide / side_)) : cell_of(bricks[0], side_);
  if (!block)
    for (const Brick& b : bricks) origin_ = origin_.cwiseMin(cell_of(b, side_));
  for (const Brick& b : bricks) cells_[key(cell_of(b, side_) - origin_)].push_back(b);
  margin_ = margin(options.clean, brick_size);
}

std::vector<Brick> Cells::around(const Key& cell) const {
  if (is_single()) return cells_.at(cell);
  std::vector<Brick> bricks;
  const Brick low = (brick(cell) + origin_) * side_ - Brick::Constant(margin_),
              high = (brick(cell) + origin_ + Brick::Ones()) * side_ + Brick::Constant(margin_);
  const int reach = 1 + (margin_ - 1) / side_;
  for (int x = -reach; x <= reach; ++x)
    for (int y = -reach; y <= reach; ++y)
      for (int z = -reach; z <= reach; ++z)
        if (const auto it = cells_.find(key(brick(cell) + Brick(x, y, z))); it != cells_.end())
          for (const Brick& b : it->second)
            if ((b.array() >= low.array()).all() && (b.array() < high.array()).all()) bricks.push_back(b);
  std::sort(bricks.begin(), bricks.end(), before);
  return bricks;
}

Brick Cells::owner(const Mesh& mesh, const std::array<std::uint32_t, 3>& t) const {
  const Eigen::Vector3f middle = (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3;
  return (middle / side_length_).array().floor().cast<int>().matrix() - origin_;
}

}  // namespace cairn
