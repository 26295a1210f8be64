// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/grids.hpp"

#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <map>
#include <mutex>
#include <optional>
#include <stdexcept>

#include "base/words.hpp"
#include "cairn/atomic_file.hpp"
#include "shaders/voxel.h"

namespace cairn {
namespace {

using VoxelTree = openvdb::Int64Tree;
constexpr float kFreeWeight = 1.0f;  // of bricks without voxels that were seen to be empty

void initialize_once() {
  static std::once_flag once;
  std::call_once(once, [] { openvdb::initialize(); });
}

openvdb::Coord origin_of(const Eigen::Vector3i& brick) { return {8 * brick.x(), 8 * brick.y(), 8 * brick.z()}; }
Eigen::Vector3i brick_at(const openvdb::Coord& voxel) { return {voxel.x() >> 3, voxel.y() >> 3, voxel.z() >> 3}; }

/// Calls `visit` with the first voxel of each active tile of a leaf's size.
template <class Tree, class Visit>
void for_each_tile(const Tree& tree, const Visit& visit) {
  auto tile = tree.cbeginValueOn();
  tile.setMaxDepth(decltype(tile)::LEAF_DEPTH - 1);
  for (; tile; ++tile) visit(tile.getCoord());
}

/// A grid with the tree's topology, its leaves filled by `value(voxel)`, active where the weight is not 0. Bricks that
/// are free become active tiles of value `free`.
template <class Grid, class Value>
typename Grid::Ptr make_grid(const VoxelTree& tree, const char* name, const GridInfo& info,
                             const typename Grid::ValueType& background, const Value& value,
                             const std::optional<typename Grid::ValueType>& free = {}) {
  auto grid = Grid::create(background);
  grid->setName(name);
  grid->setTransform(openvdb::math::Transform::createLinearTransform(info.voxel_size));
  std::vector<const VoxelTree::LeafNodeType*> from;
  tree.getNodes(from);
  std::vector<typename Grid::TreeType::LeafNodeType*> to;
  to.reserve(from.size());
  for (const auto* leaf : from) to.push_back(grid->tree().touchLeaf(leaf->origin()));
  tbb::parallel_for(std::size_t{0}, from.size(), [&](std::size_t i) {
    for (openvdb::Index n = 0; n < 512; ++n) {
      const auto voxel = static_cast<std::uint64_t>(from[i]->getValue(n));
      if (((voxel >> 16) & 0xffff) == 0)
        to[i]->setValueOff(n, background);
      else
        to[i]->setValueOn(n, value(voxel));
    }
  });
  if (free) for_each_tile(tree, [&](const openvdb::Coord& origin) { grid->tree().addTile(1, origin, *free, true); });
  return grid;
}

/// The background is the largest distance: what is farther or unknown is not stored.
openvdb::FloatGrid::Ptr distance_grid(const DistanceField& field) {
  auto grid = openvdb::FloatGrid::create(field.max_distance());
  grid->setName("esdf");
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  auto transform = openvdb::math::Transform::createLinearTransform(field.voxel_size());
  transform->postTranslate(openvdb::Vec3d(field.origin().x(), field.origin().y(), field.origin().z()));
  grid->setTransform(transform);
  for (const auto& [block, samples] : field.blocks())
    for (int part = 0; part < 8; ++part) {
      const openvdb::Coord corner(8 * (part >> 2), 8 * (part >> 1 & 1), 8 * (part & 1));
      const openvdb::Coord origin = openvdb::Coord(16 * block.x(), 16 * block.y(), 16 * block.z()) + corner;
      openvdb::FloatTree::LeafNodeType* leaf = nullptr;
      for (openvdb::Index n = 0; n < 512; ++n) {
        const openvdb::Coord v = corner + openvdb::FloatTree::LeafNodeType::offsetToLocalCoord(n);
        const float d = (*samples)[static_cast<std::size_t>(v.x() << 8 | v.y() << 4 | v.z())];
        if (std::isnan(d)) continue;
        if (leaf == nullptr) leaf = grid->tree().touchLeaf(origin);
        leaf->setValueOn(n, d);
      }
    }
  return grid;
}

void write_stream(const std::filesystem::path& file, const openvdb::GridPtrVec& grids) {
  write_whole(file, [&](std::ostream& out) {  // openvdb::io::File does not notice a full disk
    openvdb::io::Stream stream(out);
    stream.setCompression(openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK);
    stream.write(grids);
    // OpenVDB gives each file a random name of its own; the same map shall be the same bytes.
    constexpr std::streamoff kUuidOffset = 21;  // magic number, three versions, one flag
    out.seekp(kUuidOffset) << "00000000-0000-4000-8000-000000000000";
  });
}

}  // namespace

struct BrickTree::State {
  VoxelTree::Ptr tree = std::make_shared<VoxelTree>(0);
};

BrickTree::BrickTree() : state_(std::make_unique<State>()) { initialize_once(); }
BrickTree::~BrickTree() = default;
BrickTree::BrickTree(BrickTree&&) noexcept = default;
BrickTree& BrickTree::operator=(BrickTree&&) noexcept = default;

BrickTree BrickTree::copy() const {
  BrickTree other;
  other.state_->tree = std::make_shared<VoxelTree>(*state_->tree);
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

void BrickTree::mark_free(const Eigen::Vector3i& brick) {
  if (find(brick) == nullptr) state_->tree->addTile(1, origin_of(brick), 0, true);
}

void BrickTree::forget_free() {
  for (const Eigen::Vector3i& brick : free_bricks()) state_->tree->addTile(1, origin_of(brick), 0, false);
}

bool BrickTree::is_free(const Eigen::Vector3i& brick) const {
  return find(brick) == nullptr && state_->tree->isValueOn(origin_of(brick));
}

std::vector<Eigen::Vector3i> BrickTree::free_bricks() const {
  std::vector<Eigen::Vector3i> all;
  for_each_tile(*state_->tree, [&](const openvdb::Coord& origin) { all.push_back(brick_at(origin)); });
  std::sort(all.begin(), all.end(), before);
  return all;
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

void write_grids(const std::filesystem::path& file, const BrickTree& bricks, const GridInfo& info,
                 const DistanceField* distances) {
  // The trees are private to this file, so that OpenVDB's headers stay here.
  const VoxelTree& tree = *bricks.state_->tree;
  openvdb::GridPtrVec grids;
  auto tsdf = make_grid<openvdb::FloatGrid>(
      tree, "tsdf", info, info.truncation, [&](std::uint64_t v) { return shader::voxel_distance(v) * info.truncation; },
      info.truncation);
  tsdf->setGridClass(openvdb::GRID_LEVEL_SET);
  tsdf->insertMeta("truncation", openvdb::FloatMetadata(info.truncation));
  grids.push_back(tsdf);
  grids.push_back(make_grid<openvdb::FloatGrid>(tree, "weight", info, 0.0f, shader::voxel_weight, kFreeWeight));
  grids.push_back(make_grid<openvdb::Vec3SGrid>(tree, "colour", info, openvdb::Vec3s(0.0f), [](std::uint64_t v) {
    const auto channel = [&](int shift) { return static_cast<float>((v >> shift) & 0xff) / 255.0f; };
    return openvdb::Vec3s(channel(32), channel(40), channel(48));
  }));
  grids.push_back(make_grid<openvdb::Int32Grid>(tree, "colour_weight", info, 0,
                                                [](std::uint64_t v) { return static_cast<std::int32_t>(v >> 56); }));
  if (distances != nullptr) grids.push_back(distance_grid(*distances));
  for (const auto& grid : grids) grid->setCreator("cairn");
  write_stream(file, grids);
}

void write_distances(const std::filesystem::path& file, const DistanceField& distances) {
  initialize_once();
  const auto grid = distance_grid(distances);
  grid->setCreator("cairn");
  write_stream(file, {grid});
}

DistanceField DistanceField::read(const std::filesystem::path& vdb) {
  initialize_once();
  const auto wrong = [&](const std::string& why) {
    return std::runtime_error(vdb.string() + ": " + why + "; expected a file of `cairn esdf` or `reconstruct --esdf`");
  };
  openvdb::FloatGrid::Ptr grid;
  try {
    openvdb::io::File in(vdb.string());
    in.open(false);
    grid = openvdb::gridPtrCast<openvdb::FloatGrid>(in.readGrid("esdf"));
  } catch (const std::exception& error) {  // OpenVDB's, or no memory for a size that a broken file tells
    throw wrong(shown(error.what()));
  }
  if (!grid) throw wrong("its grid `esdf` has another type");
  std::map<std::array<int, 3>, std::shared_ptr<Block>> blocks;
  for (auto leaf = grid->tree().cbeginLeaf(); leaf; ++leaf) {
    const openvdb::Coord at = leaf->origin();
    auto& block = blocks[{at.x() >> 4, at.y() >> 4, at.z() >> 4}];
    if (!block) {
      block = std::make_shared<Block>();
      block->fill(std::numeric_limits<float>::quiet_NaN());
    }
    for (auto value = leaf->cbeginValueOn(); value; ++value) {
      const openvdb::Coord v = value.getCoord();
      (*block)[static_cast<std::size_t>((v.x() & 15) << 8 | (v.y() & 15) << 4 | (v.z() & 15))] = *value;
    }
  }
  Blocks list;
  for (const auto& [at, block] : blocks) list.emplace_back(Eigen::Vector3i(at[0], at[1], at[2]), block);
  const openvdb::Vec3d origin = grid->transform().indexToWorld(openvdb::Vec3d(0.0));
  return {static_cast<float>(grid->voxelSize().x()), Eigen::Vector3d(origin.x(), origin.y(), origin.z()).cast<float>(),
          grid->background(), std::move(list)};
}

void write_bricks(const std::filesystem::path& file, const BrickTree& bricks) {
  auto grid = openvdb::Int64Grid::create(bricks.state_->tree);
  grid->setName("bricks");
  write_stream(file, {grid});
}

BrickTree read_bricks(const std::filesystem::path& file) {
  initialize_once();
  BrickTree bricks;
  try {
    openvdb::io::File in(file.string());
    in.open(false);
    const auto grid = openvdb::gridPtrCast<openvdb::Int64Grid>(in.readGrid("bricks"));
    if (!grid) throw std::runtime_error("holds no bricks");
    bricks.state_->tree = grid->treePtr();
  } catch (const std::exception& error) {
    throw std::runtime_error(file.string() + ": " + shown(error.what()));
  }
  return bricks;
}

ReadGrids read_grids(const std::filesystem::path& file) {
  initialize_once();
  const auto wrong = [&](const std::string& why) {
    return std::runtime_error(file.string() + ": " + why + "; expected a map.vdb written by cairn");
  };
  openvdb::GridBase::Ptr base[4];
  try {
    openvdb::io::File in(file.string());
    in.open(false);
    constexpr const char* kNames[4] = {"tsdf", "weight", "colour", "colour_weight"};
    for (int i = 0; i < 4; ++i) base[i] = in.readGrid(kNames[i]);
  } catch (const std::exception& error) {  // OpenVDB's, or no memory for a size that a broken file tells
    throw wrong(shown(error.what()));
  }
  const auto tsdf = openvdb::gridPtrCast<openvdb::FloatGrid>(base[0]);
  const auto weight = openvdb::gridPtrCast<openvdb::FloatGrid>(base[1]);
  const auto colour = openvdb::gridPtrCast<openvdb::Vec3SGrid>(base[2]);
  const auto colour_weight = openvdb::gridPtrCast<openvdb::Int32Grid>(base[3]);
  if (!tsdf || !weight || !colour || !colour_weight) throw wrong("a grid has another type");
  ReadGrids result;
  result.info = {.voxel_size = static_cast<float>(tsdf->voxelSize().x()), .truncation = tsdf->background()};
  for (auto leaf = tsdf->tree().cbeginLeaf(); leaf; ++leaf) {
    const auto at = leaf->origin();
    const auto* w = weight->tree().probeConstLeaf(at);
    const auto* c = colour->tree().probeConstLeaf(at);
    const auto* n = colour_weight->tree().probeConstLeaf(at);
    if (w == nullptr || c == nullptr || n == nullptr) throw wrong("its grids do not cover the same bricks");
    BrickVoxels voxels{};
    for (openvdb::Index i = 0; i < 512; ++i) {
      if (!leaf->isValueOn(i)) continue;
      const openvdb::Vec3s& rgb = c->getValue(i);
      const auto is_in = [](float value, float low, float high) { return value >= low && value <= high; };  // no NaN
      if (!is_in(leaf->getValue(i) / result.info.truncation, -1.001f, 1.001f) ||
          !is_in(w->getValue(i) * shader::kWeightUnits, 0, 65535) || !is_in(rgb.x(), 0, 1) || !is_in(rgb.y(), 0, 1) ||
          !is_in(rgb.z(), 0, 1) || n->getValue(i) < 0 || n->getValue(i) > 255) {
        const auto where = leaf->offsetToGlobalCoord(i);
        throw wrong("voxel " + std::to_string(where.x()) + " " + std::to_string(where.y()) + " " +
                    std::to_string(where.z()) + " holds a value that is out of range or not a number");
      }
      auto colour_word = static_cast<std::uint32_t>(n->getValue(i)) << 24;
      for (int k = 0; k < 3; ++k) colour_word |= static_cast<std::uint32_t>(std::lround(rgb[k] * 255.0f)) << (8 * k);
      voxels[i] = shader::pack_voxel(leaf->getValue(i) / result.info.truncation, w->getValue(i), colour_word);
    }
    result.tree.put(brick_at(at), voxels);
  }
  for_each_tile(tsdf->tree(), [&](const openvdb::Coord& origin) { result.tree.mark_free(brick_at(origin)); });
  return result;
}

}  // namespace cairn
