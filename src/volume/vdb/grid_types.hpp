// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Grid types: OpenVDB trees and masks of bricks. Included in this folder only.
#pragma once
#include <openvdb/openvdb.h>

#include <memory>
#include <mutex>
#include <tuple>

#include "volume/vdb/brick_tree.hpp"

namespace cairn::vdb {

using VoxelTree = openvdb::Int64Tree;
using FreeTree = openvdb::MaskTree;

inline void initialize_once() {
  static std::once_flag once;
  std::call_once(once, [] { openvdb::initialize(); });
}

inline openvdb::Coord origin_of(const Eigen::Vector3i& brick) { return {8 * brick.x(), 8 * brick.y(), 8 * brick.z()}; }
inline Eigen::Vector3i brick_at(const openvdb::Coord& voxel) {
  return {voxel.x() >> 3, voxel.y() >> 3, voxel.z() >> 3};
}

/// True if the brick is so far from the origin that sums and products of its coordinates may overflow.
inline bool is_out_of_range(const Eigen::Vector3i& brick) {
  constexpr int kMaxCoordinate = 1 << 24;  // bricks
  return (brick.array() < -kMaxCoordinate).any() || (brick.array() > kMaxCoordinate).any();
}
inline constexpr const char* kOutOfRange = "the coordinates of a brick are out of range";

/// Calls `visit` with the first voxel of each active leaf-sized tile.
template <class Tree, class Visit>
void for_each_tile(const Tree& tree, const Visit& visit) {
  auto tile = tree.cbeginValueOn();
  tile.setMaxDepth(decltype(tile)::LEAF_DEPTH - 1);
  for (; tile; ++tile) visit(tile.getCoord());
}

using Mask = VoxelTree::LeafNodeType::NodeMaskType;
static_assert(Mask::WORD_COUNT == std::tuple_size_v<BrickBits>);

inline BrickBits bits_of(const Mask& mask) {
  BrickBits bits;
  for (openvdb::Index w = 0; w < Mask::WORD_COUNT; ++w) bits[w] = mask.getWord<openvdb::Index64>(w);
  return bits;
}
inline Mask mask_of(const BrickBits& bits) {
  Mask mask;
  for (openvdb::Index w = 0; w < Mask::WORD_COUNT; ++w) mask.getWord<openvdb::Index64>(w) = bits[w];
  return mask;
}

/// Calls `visit(brick, bits)` for each brick of a mask tree.
template <class Tree, class Visit>
void for_each_mask(const Tree& tree, const Visit& visit) {
  for_each_tile(tree, [&](const openvdb::Coord& origin) { visit(brick_at(origin), kAllBits); });
  for (auto leaf = tree.cbeginLeaf(); leaf; ++leaf) visit(brick_at(leaf->origin()), bits_of(leaf->getValueMask()));
}

}  // namespace cairn::vdb

namespace cairn {

struct BrickTree::State {
  vdb::VoxelTree::Ptr tree = std::make_shared<vdb::VoxelTree>(0);
  vdb::FreeTree::Ptr free = std::make_shared<vdb::FreeTree>(false);
};

}  // namespace cairn
