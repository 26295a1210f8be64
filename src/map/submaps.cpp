// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/submaps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace cairn {
namespace {

// Bytes. Reading the required bricks takes no longer than their processing.
constexpr std::uint64_t kDefaultBudget = std::uint64_t{16} << 20;
constexpr std::size_t kMaxOpenFiles = 32;  // an open file indexes all of its bricks, half a megabyte

}  // namespace

Submaps::Submaps(NumberedFiles files, std::uint64_t budget, Access access)
    : files_(std::move(files)),
      budget_(budget != 0 ? budget : kDefaultBudget),
      is_writable_(!files_.folder().empty() && access == Access::write) {}

std::filesystem::path submap_file(const NumberedFiles& files, std::size_t submap) {
  const NumberedFiles::Place place = files[submap];
  return place.folder / fmt::format("submap-{:04}.vdb", place.number);
}

std::filesystem::path Submaps::file(std::size_t i) const { return submap_file(files_, i); }

const std::shared_ptr<const BrickSet>& Submaps::bricks(std::size_t i) const {
  if (bricks_[i] == nullptr) bricks_[i] = std::make_shared<const BrickSet>(BrickFile(file(i)).bricks());
  return bricks_[i];
}

void Submaps::add(BrickList voxels) {
  wait();
  const std::size_t id = bricks_.size();
  const std::uint64_t bytes = voxels.bricks.size() * sizeof(BrickVoxels);
  bricks_.push_back(std::make_shared<const BrickSet>(voxels.bricks));
  voxels_.push_back(is_writable_ ? nullptr : std::make_shared<const BrickTree>(tree_of(voxels)));
  last_use_.push_back(++use_);
  stored_.push_back(false);
  keep_within_budget(is_writable_ ? bytes : 0);
  if (!is_writable_) return;
  writing_ = std::async(std::launch::async, [list = std::make_unique<const BrickList>(std::move(voxels)), to = file(id),
                                             keep = bytes <= budget_]() mutable {
    Written written;
    try {
      write_bricks(to, *list);
      written.stored = true;
    } catch (const std::runtime_error&) {  // stays in memory until store()
    }
    if (keep || !written.stored) written.voxels = std::make_shared<const BrickTree>(tree_of(*list));
    list.reset();  // the future that holds this function lives until the next submap
    return written;
  });
}

void Submaps::add_stored(bool has_file) {
  const std::size_t i = bricks_.size();
  if (has_file && files_.is_elsewhere(i)) {
    bricks_.push_back(nullptr);
  } else {
    std::optional<BrickFile> from;
    if (has_file) from.emplace(file(i)).check();
    bricks_.push_back(std::make_shared<const BrickSet>(from ? from->bricks() : std::vector<Brick>()));
  }
  voxels_.push_back(has_file ? nullptr : std::make_shared<const BrickTree>());
  last_use_.push_back(++use_);
  stored_.push_back(true);
}

void Submaps::release_memory() {
  wait();
  if (files_.folder().empty()) return;
  for (std::size_t i = 0; i < bricks_.size(); ++i)
    if (stored_[i] && has_voxels(i)) voxels_[i] = nullptr;
}

void Submaps::drop(std::size_t i) {
  wait();
  bricks_[i] = std::make_shared<const BrickSet>();
  voxels_[i] = std::make_shared<const BrickTree>();
}

void Submaps::wait() {
  if (!writing_.valid()) return;
  Written written = writing_.get();
  stored_.back() = written.stored;
  voxels_.back() = std::move(written.voxels);
}

std::optional<std::string> Submaps::store() {
  wait();
  if (!is_writable_) return std::nullopt;
  try {
    for (std::size_t i = 0; i < stored_.size(); ++i) {
      if (!stored_[i]) write_bricks(file(i), *voxels_[i]);
      stored_[i] = true;
    }
    keep_within_budget();
    return std::nullopt;
  } catch (const std::runtime_error& error) {
    return error.what();
  }
}

void Submaps::keep_within_budget(std::uint64_t being_written) {
  const auto bytes = [&] {
    std::uint64_t sum = being_written;
    for (std::size_t i = 0; i < bricks_.size(); ++i)
      if (voxels_[i]) sum += bricks_[i]->size() * sizeof(BrickVoxels);
    return sum;
  };
  while (!files_.folder().empty() && bytes() > budget_) {
    std::size_t oldest = bricks_.size();
    for (std::size_t i = 0; i < bricks_.size(); ++i)
      if (voxels_[i] && stored_[i] && (oldest == bricks_.size() || last_use_[i] < last_use_[oldest])) oldest = i;
    if (oldest == bricks_.size()) break;
    voxels_[oldest] = nullptr;
  }
  counts_.peak_bytes = std::max(counts_.peak_bytes, bytes());
}

std::shared_ptr<const BrickTree> Submaps::voxels(std::size_t i, const BrickBox& box) {
  if (i + 1 == bricks_.size()) wait();
  last_use_[i] = ++use_;
  if (voxels_[i]) return voxels_[i];
  ++counts_.read_back;
  return std::make_shared<const BrickTree>(open_file(i).read(box));
}

std::shared_ptr<const BrickTree> Submaps::free_space(std::size_t i) {
  if (i + 1 == bricks_.size()) wait();
  last_use_[i] = ++use_;
  return voxels_[i] ? voxels_[i] : std::make_shared<const BrickTree>(open_file(i).read_free());
}

const BrickFile& Submaps::open_file(std::size_t i) {
  if (const auto open = open_.find(i); open != open_.end()) return open->second;
  while (open_.size() >= kMaxOpenFiles)
    open_.erase(std::min_element(open_.begin(), open_.end(), [&](const auto& a, const auto& b) {
      return last_use_[a.first] < last_use_[b.first];
    }));
  return open_.try_emplace(i, file(i)).first->second;
}

}  // namespace cairn
