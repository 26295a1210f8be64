// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/submaps.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

namespace cairn {

Submaps::Submaps(std::filesystem::path folder, std::uint64_t budget, Access access)
    : folder_(std::move(folder)),
      budget_(budget != 0 ? budget
                          : static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) *
                                static_cast<std::uint64_t>(sysconf(_SC_PAGE_SIZE)) / 4),
      writes_(!folder_.empty() && access == Access::write) {}

std::filesystem::path Submaps::file(std::size_t i) const { return folder_ / fmt::format("submap-{:04}.vdb", i); }

void Submaps::add(BrickTree voxels) {
  wait();
  const std::size_t id = bricks_.size();
  bricks_.push_back(voxels.bricks());
  free_.push_back(voxels.free_bricks());
  voxels_.push_back(std::make_shared<const BrickTree>(std::move(voxels)));
  last_use_.push_back(++use_);
  stored_.push_back(false);
  if (writes_)
    writing_ = std::async(std::launch::async, [tree = voxels_[id], to = file(id)] {
      try {
        write_bricks(to, *tree);
        return true;
      } catch (const std::runtime_error&) {
        return false;  // it stays in memory until store()
      }
    });
  keep_within_budget();
}

BrickTree Submaps::copy(std::size_t i) const {
  return bricks_[i].empty() ? BrickTree() : voxels_[i] ? voxels_[i]->copy() : read_bricks(file(i));
}

void Submaps::add_stored(bool has_file) {
  voxels_.push_back(std::make_shared<const BrickTree>(has_file ? read_bricks(file(bricks_.size())) : BrickTree()));
  bricks_.push_back(voxels_.back()->bricks());
  free_.push_back(voxels_.back()->free_bricks());
  last_use_.push_back(++use_);
  stored_.push_back(true);
  keep_within_budget();
}

void Submaps::drop(std::size_t i) {
  wait();
  bricks_[i].clear();
  free_[i].clear();
  voxels_[i] = std::make_shared<const BrickTree>();
}

void Submaps::wait() {
  if (writing_.valid()) stored_.back() = writing_.get();
}

std::optional<std::string> Submaps::store() {
  wait();
  if (!writes_) return std::nullopt;
  try {
    for (std::size_t i = 0; i < stored_.size(); ++i) {
      if (!stored_[i]) write_bricks(file(i), *voxels_[i]);
      stored_[i] = true;
    }
    return std::nullopt;
  } catch (const std::runtime_error& error) {
    return error.what();
  }
}

void Submaps::keep_within_budget() {
  const auto bytes = [&] {
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < bricks_.size(); ++i)
      if (voxels_[i]) sum += bricks_[i].size() * sizeof(BrickVoxels);
    return sum;
  };
  while (!folder_.empty() && bytes() > budget_) {
    wait();
    std::size_t oldest = bricks_.size();
    for (std::size_t i = 0; i < bricks_.size(); ++i)
      if (voxels_[i] && stored_[i] && (oldest == bricks_.size() || last_use_[i] < last_use_[oldest])) oldest = i;
    if (oldest == bricks_.size() || last_use_[oldest] == use_) break;  // one at least stays
    voxels_[oldest] = nullptr;
  }
  counts_.peak_bytes = std::max(counts_.peak_bytes, bytes());
}

std::shared_ptr<const BrickTree> Submaps::voxels(std::size_t i) {
  last_use_[i] = ++use_;
  if (!voxels_[i]) {
    voxels_[i] = std::make_shared<const BrickTree>(read_bricks(file(i)));
    ++counts_.read_back;
    auto held = voxels_[i];
    keep_within_budget();
    return held;
  }
  return voxels_[i];
}

}  // namespace cairn
