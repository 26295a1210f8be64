// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/grid_bricks.hpp"

#include <algorithm>
#include <type_traits>

namespace cairn {
namespace {

constexpr int kCube = 16;  // bricks per side; the grid order keeps the bricks of a cube contiguous
static_assert(std::is_trivially_copyable_v<GridBrick>);

}  // namespace

void GridBricks::append(std::span<const GridBrick> bricks) {
  spool_.append({reinterpret_cast<const char*>(bricks.data()), bricks.size_bytes()});
  for (const GridBrick& brick : bricks) {
    const auto [cube, is_new] = cubes_.try_emplace(cell_of(brick.at(), kCube), Range{size_, size_});
    cube->second.end = ++size_;
  }
}

std::span<const GridBrick> GridBricks::all() {
  if (all_.size() != size_) all_ = {reinterpret_cast<const GridBrick*>(spool_.mapped().data()), size_};
  return all_;
}

const GridBrick* GridBricks::find(std::span<const GridBrick> all, const Brick& brick) const {
  const auto cube = cubes_.find(cell_of(brick, kCube));
  if (cube == cubes_.end()) return nullptr;
  const auto [begin, end] = cube->second;
  const auto in_cube = all.subspan(begin, end - begin);
  const auto found = std::lower_bound(in_cube.begin(), in_cube.end(), brick,
                                      [](const GridBrick& a, const Brick& b) { return before(a.at(), b); });
  return found != in_cube.end() && found->at() == brick ? &*found : nullptr;
}

std::vector<std::pair<Brick, BrickBits>> GridBricks::with_around(std::size_t begin, std::size_t end,
                                                                 BrickBits GridBrick::*mask,
                                                                 std::span<const Brick> steps) {
  const std::span<const GridBrick> all = this->all(), own = all.subspan(begin, end - begin);
  std::vector<const GridBrick*> around;
  for (const GridBrick& brick : own)
    for (const Brick& step : steps)
      if (const GridBrick* other = find(all, brick.at() + step);
          other != nullptr && (other < own.data() || other >= own.data() + own.size()))
        around.push_back(other);
  std::sort(around.begin(), around.end());
  around.erase(std::unique(around.begin(), around.end()), around.end());
  std::vector<std::pair<Brick, BrickBits>> bricks;
  bricks.reserve(own.size() + around.size());
  for (const GridBrick& brick : own) bricks.emplace_back(brick.at(), brick.*mask);
  for (const GridBrick* brick : around) bricks.emplace_back(brick->at(), brick->*mask);
  return bricks;
}

}  // namespace cairn
