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
#include <mutex>
#include <stdexcept>

#include "io/atomic_file.hpp"

namespace cairn {
namespace {

using VoxelTree = openvdb::Int64Tree;
constexpr float kDistanceUnits = 32767.0f, kWeightUnits = 256.0f;  // as in shaders/volume.h

void initialize_once() {
  static std::once_flag once;
  std::call_once(once, [] { openvdb::initialize(); });
}

openvdb::Coord origin_of(const Eigen::Vector3i& brick) { return {8 * brick.x(), 8 * brick.y(), 8 * brick.z()}; }

float distance_of(std::uint64_t v, float truncation) {
  return static_cast<float>(static_cast<std::int16_t>(v & 0xffff)) / kDistanceUnits * truncation;
}
float weight_of(std::uint64_t v) { return static_cast<float>((v >> 16) & 0xffff) / kWeightUnits; }

/// A grid with the tree's topology, its leaves filled by `value(voxel)`, active where the weight is not 0.
template <class Grid, class Value>
typename Grid::Ptr make_grid(const VoxelTree& tree, const char* name, const GridInfo& info,
                             const typename Grid::ValueType& background, const Value& value) {
  auto grid = Grid::create(background);
  grid->setName(name);
  grid->setTransform(openvdb::math::Transform::createLinearTransform(info.voxel_size));
  std::vector<const VoxelTree::LeafNodeType*> from;
  tree.getNodes(from);
  std::vector<typename Grid::TreeType::LeafNodeType*> to;
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
  return grid;
}

void write_stream(const std::filesystem::path& file, const openvdb::GridPtrVec& grids) {
  write_whole(file, [&](const std::filesystem::path& temporary) {
    // Through a stream of ours: openvdb::io::File does not notice a full disk.
    std::ofstream out(temporary, std::ios::binary);
    openvdb::io::Stream stream(out);
    stream.setCompression(openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK);
    stream.write(grids);
    // OpenVDB gives each file a random name of its own; the same map shall be the same bytes.
    constexpr std::streamoff kUuidOffset = 21;  // magic number, three versions, one flag
    out.seekp(kUuidOffset) << "00000000-0000-4000-8000-000000000000";
    if (!out.flush()) throw std::runtime_error("the disk is full");
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

const std::uint64_t* BrickTree::find(const Eigen::Vector3i& brick) const {
  const auto* leaf = std::as_const(*state_->tree).probeConstLeaf(origin_of(brick));
  return leaf == nullptr ? nullptr : reinterpret_cast<const std::uint64_t*>(leaf->buffer().data());
}

std::size_t BrickTree::size() const { return state_->tree->leafCount(); }

std::vector<Eigen::Vector3i> BrickTree::bricks() const {
  std::vector<Eigen::Vector3i> all;
  for (auto leaf = state_->tree->cbeginLeaf(); leaf; ++leaf)
    all.emplace_back(leaf->origin().x() >> 3, leaf->origin().y() >> 3, leaf->origin().z() >> 3);
  std::sort(all.begin(), all.end(), [](const Eigen::Vector3i& a, const Eigen::Vector3i& b) {
    return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
  });
  return all;
}

void write_grids(const std::filesystem::path& file, const BrickTree& bricks, const GridInfo& info) {
  // The trees are private to this file, so that OpenVDB's headers stay here.
  const VoxelTree& tree = *bricks.state_->tree;
  openvdb::GridPtrVec grids;
  auto tsdf = make_grid<openvdb::FloatGrid>(tree, "tsdf", info, info.truncation,
                                            [&](std::uint64_t v) { return distance_of(v, info.truncation); });
  tsdf->setGridClass(openvdb::GRID_LEVEL_SET);
  tsdf->insertMeta("truncation", openvdb::FloatMetadata(info.truncation));
  grids.push_back(tsdf);
  grids.push_back(make_grid<openvdb::FloatGrid>(tree, "weight", info, 0.0f, weight_of));
  grids.push_back(make_grid<openvdb::Vec3SGrid>(tree, "colour", info, openvdb::Vec3s(0.0f), [](std::uint64_t v) {
    const auto channel = [&](int shift) { return static_cast<float>((v >> shift) & 0xff) / 255.0f; };
    return openvdb::Vec3s(channel(32), channel(40), channel(48));
  }));
  grids.push_back(make_grid<openvdb::Int32Grid>(tree, "colour_weight", info, 0,
                                                [](std::uint64_t v) { return static_cast<std::int32_t>(v >> 56); }));
  for (const auto& grid : grids) grid->setCreator("cairn");
  write_stream(file, grids);
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
    if (!grid) throw std::runtime_error(file.string() + ": holds no bricks");
    bricks.state_->tree = grid->treePtr();
  } catch (const openvdb::Exception& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
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
  } catch (const openvdb::Exception& error) {
    throw wrong(error.what());
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
      const auto d =
          static_cast<std::int16_t>(std::lround(leaf->getValue(i) / result.info.truncation * kDistanceUnits));
      std::uint64_t v = static_cast<std::uint16_t>(d);
      v |= static_cast<std::uint64_t>(std::lround(w->getValue(i) * kWeightUnits)) << 16;
      for (int k = 0; k < 3; ++k)
        v |= static_cast<std::uint64_t>(std::lround(c->getValue(i)[k] * 255.0f)) << (32 + 8 * k);
      v |= static_cast<std::uint64_t>(n->getValue(i)) << 56;
      voxels[i] = v;
    }
    result.tree.put({at.x() >> 3, at.y() >> 3, at.z() >> 3}, voxels);
  }
  return result;
}

}  // namespace cairn
