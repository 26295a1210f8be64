// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/vdb/brick_tree.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "volume/vdb/grid_types.hpp"

namespace cairn {

using namespace vdb;

BrickMarks ball(const Eigen::Vector3d& center, double radius) {
  BrickMarks marks;
  const auto brick_of = [](double voxel) { return static_cast<int>(std::floor(voxel)) >> 3; };
  const auto first = [&](int axis) { return brick_of(std::ceil(center[axis] - radius)); };
  const auto last = [&](int axis) { return brick_of(center[axis] + radius); };
  for (int x = first(0); x <= last(0); ++x)
    for (int y = first(1); y <= last(1); ++y)
      for (int z = first(2); z <= last(2); ++z) {
        BrickBits bits{};
        for (int i = 0; i < 64; ++i) {  // columns along z
          const double dx = 8 * x + (i >> 3) - center.x(), dy = 8 * y + (i & 7) - center.y();
          const double half = std::sqrt(std::max(0.0, radius * radius - dx * dx - dy * dy));
          if (dx * dx + dy * dy > radius * radius) continue;
          const auto low = std::max(0, static_cast<int>(std::ceil(center.z() - half)) - 8 * z);
          const auto high = std::min(7, static_cast<int>(std::floor(center.z() + half)) - 8 * z);
          for (int k = low; k <= high; ++k) bits[static_cast<std::size_t>(i >> 3)] |= 1ull << (8 * (i & 7) + k);
        }
        if (bits == kNoBits) continue;
        marks.bricks.emplace_back(x, y, z);
        marks.voxels.push_back(bits);
      }
  return marks;
}

BrickTree::BrickTree() : state_(std::make_unique<State>()) { initialize_once(); }
BrickTree::~BrickTree() = default;
BrickTree::BrickTree(BrickTree&&) noexcept = default;
BrickTree& BrickTree::operator=(BrickTree&&) noexcept = default;

BrickTree BrickTree::copy() const {
  BrickTree other = copy_free();
  other.state_->tree = std::make_shared<VoxelTree>(*state_->tree);
  return other;
}

BrickTree BrickTree::copy_free() const {
  BrickTree other;
  other.state_->free = std::make_shared<FreeTree>(*state_->free);
  return other;
}

void BrickTree::put(const Eigen::Vector3i& brick, std::span<const std::uint64_t, 512> voxels) {
  auto* leaf = state_->tree->touchLeaf(origin_of(brick));
  std::memcpy(leaf->buffer().data(), voxels.data(), voxels.size_bytes());
  leaf->setValuesOn();
}

void BrickTree::erase(const Eigen::Vector3i& brick) {
  delete state_->tree->stealNode<VoxelTree::LeafNodeType>(origin_of(brick), 0, false);
}

bool BrickTree::mark_free(const Eigen::Vector3i& brick, const BrickBits& voxels) {
  FreeTree& free = *state_->free;
  const openvdb::Coord origin = origin_of(brick);
  BrickBits bits = voxels;
  if (auto* leaf = free.probeLeaf(origin)) {
    const Mask before = leaf->getValueMask();
    const BrickBits known = bits_of(before);
    for (std::size_t w = 0; w < bits.size(); ++w) bits[w] |= known[w];
    if (bits == known) return false;
    if (bits != kAllBits) {
      leaf->setValueMask(mask_of(bits));
      return true;
    }
  } else if (bits == kNoBits || free.isValueOn(origin)) {
    return false;
  }
  if (bits == kAllBits)
    free.addTile(1, origin, true, true);
  else
    free.touchLeaf(origin)->setValueMask(mask_of(bits));
  return true;
}

void BrickTree::forget_free() { state_->free = std::make_shared<FreeTree>(false); }

void BrickTree::take_free(BrickTree&& other) {
  state_->free = std::exchange(other.state_->free, std::make_shared<FreeTree>(false));
}

bool BrickTree::is_free(const Eigen::Vector3i& brick) const {
  const FreeTree& free = *state_->free;
  return free.probeConstLeaf(origin_of(brick)) == nullptr && free.isValueOn(origin_of(brick)) && find(brick) == nullptr;
}

BrickBits BrickTree::free_voxels(const Eigen::Vector3i& brick) const {
  const FreeTree& free = *state_->free;
  if (const auto* leaf = free.probeConstLeaf(origin_of(brick))) return bits_of(leaf->getValueMask());
  return free.isValueOn(origin_of(brick)) ? kAllBits : kNoBits;
}

std::vector<Eigen::Vector3i> BrickTree::free_bricks() const {
  std::vector<Eigen::Vector3i> all;
  for_each_mask(*state_->free, [&](const Eigen::Vector3i& brick, const BrickBits&) { all.push_back(brick); });
  std::sort(all.begin(), all.end(), before);
  return all;
}

void BrickTree::visit_free(const std::function<void(const Eigen::Vector3i&, const BrickBits&)>& visit) const {
  for_each_mask(*state_->free, visit);
}

const std::uint64_t* BrickTree::find(const Eigen::Vector3i& brick) const {
  const auto* leaf = std::as_const(*state_->tree).probeConstLeaf(origin_of(brick));
  return leaf == nullptr ? nullptr : reinterpret_cast<const std::uint64_t*>(leaf->buffer().data());
}

std::size_t BrickTree::size() const { return state_->tree->leafCount(); }

std::vector<Eigen::Vector3i> BrickTree::bricks() const {
  std::vector<Eigen::Vector3i> all;
  for (auto leaf = state_->tree->cbeginLeaf(); leaf; ++leaf) all.push_back(brick_at(leaf->origin()));
  std::sort(all.begin(), all.end(), before);
  return all;
}

void BrickTree::visit(const std::function<void(const Eigen::Vector3i&)>& visit) const {
  for (auto leaf = state_->tree->cbeginLeaf(); leaf; ++leaf) visit(brick_at(leaf->origin()));
}

BrickTree tree_of(const BrickList& list) {
  BrickTree tree = list.free.copy_free();
  for (std::size_t i = 0; i < list.bricks.size(); ++i) tree.put(list.bricks[i], list.voxels[i]);
  return tree;
}

bool before_in_grid(const Eigen::Vector3i& a, const Eigen::Vector3i& b) {
  const auto key = [](const Eigen::Vector3i& brick) {
    std::array<int, 9> k{};
    for (int i = 0; i < 3; ++i) k[i] = brick[i] >> 9, k[i + 3] = brick[i] >> 4, k[i + 6] = brick[i];
    return k;
  };
  return key(a) < key(b);
}

}  // namespace cairn
