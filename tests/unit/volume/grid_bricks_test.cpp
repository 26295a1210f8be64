// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/grid_bricks.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <random>
#include <set>

#include "support/files.hpp"
#include "volume/sign_fill.hpp"

namespace cairn {
namespace {

/// Thick sheet through several cubes, with holes, in the order of the grids.
std::vector<GridBrick> sheet() {
  std::mt19937_64 random(1);
  std::vector<GridBrick> bricks;
  for (int x = -20; x < 20; ++x)
    for (int y = -20; y < 20; ++y)
      for (int z = x / 8; z < x / 8 + 3; ++z) {
        if (random() % 7 == 0) continue;
        GridBrick& brick = bricks.emplace_back(GridBrick{.brick = {x, y, z}});
        for (std::size_t w = 0; w < 8; ++w) {
          brick.known[w] = random() | random() | random();
          brick.behind[w] = random() | random();
        }
      }
  std::sort(bricks.begin(), bricks.end(),
            [](const GridBrick& a, const GridBrick& b) { return before_in_grid(a.at(), b.at()); });
  return bricks;
}

GridBricks on_disk(const TemporaryFolder& folder, const std::vector<GridBrick>& bricks) {
  GridBricks kept(folder / "map.vdb");
  kept.append(std::span(bricks).first(100));
  EXPECT_EQ(kept.all().size(), 100u);
  kept.append(std::span(bricks).subspan(100));
  return kept;
}

std::vector<std::pair<Brick, BrickBits>> masks(const std::vector<GridBrick>& bricks, BrickBits GridBrick::*mask) {
  std::vector<std::pair<Brick, BrickBits>> list;
  for (const GridBrick& brick : bricks) list.emplace_back(brick.at(), brick.*mask);
  return list;
}

constexpr std::size_t kPart = 237;

/// Calls `visit` with each part's bricks and their neighbors.
void for_each_part(GridBricks& kept, BrickBits GridBrick::*mask, const std::vector<Brick>& steps,
                   const std::function<void(const std::vector<std::pair<Brick, BrickBits>>&, std::size_t own)>& visit) {
  const std::size_t count = kept.all().size();
  for (std::size_t begin = 0; begin < count; begin += kPart) {
    const std::size_t end = std::min(begin + kPart, count);
    visit(kept.with_around(begin, end, mask, steps), end - begin);
  }
}

TEST(GridBricks, KeepTheirOrder) {
  const TemporaryFolder folder;
  const std::vector<GridBrick> bricks = sheet();
  GridBricks kept = on_disk(folder, bricks);
  ASSERT_EQ(kept.all().size(), bricks.size());
  for (std::size_t i = 0; i < bricks.size(); ++i) {
    ASSERT_EQ(kept.all()[i].brick, bricks[i].brick);
    ASSERT_EQ(kept.all()[i].behind, bricks[i].behind);
  }
}

TEST(GridBricks, HaveTheSameObservedCellsInParts) {
  const TemporaryFolder folder;
  const std::vector<GridBrick> bricks = sheet();
  GridBricks kept = on_disk(folder, bricks);
  std::vector<BrickBits> cells;
  for_each_part(kept, &GridBrick::known, upper_corners(), [&](const auto& part, std::size_t own) {
    EXPECT_LT(part.size(), 2 * own + kPart);  // no more than its surroundings
    const auto of_part = fully_observed_cells(part, own);
    cells.insert(cells.end(), of_part.begin(), of_part.end());
  });
  EXPECT_EQ(cells, fully_observed_cells(masks(bricks, &GridBrick::known), bricks.size()));
}

TEST(GridBricks, HaveTheSameInsideNeighborsInParts) {
  const TemporaryFolder folder;
  const std::vector<GridBrick> bricks = sheet();
  GridBricks kept = on_disk(folder, bricks);
  const auto before_it = [](const Brick& a, const Brick& b) { return before(a, b); };
  std::set<Brick, decltype(before_it)> beside(before_it);
  for_each_part(kept, &GridBrick::behind, two_steps(), [&](const auto& part, std::size_t own) {
    const auto of_part = inside_neighbors(part, own);
    beside.insert(of_part.begin(), of_part.end());
  });
  const auto complete = inside_neighbors(masks(bricks, &GridBrick::behind), bricks.size());
  EXPECT_GT(complete.size(), 100u);
  EXPECT_EQ(std::vector<Brick>(beside.begin(), beside.end()), complete);
}

}  // namespace
}  // namespace cairn
