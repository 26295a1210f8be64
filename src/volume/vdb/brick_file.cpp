// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/vdb/brick_file.hpp"

#include <openvdb/io/GridDescriptor.h>
#include <openvdb/openvdb.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <memory>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

#include "base/words.hpp"
#include "volume/vdb/file_writer.hpp"
#include "volume/vdb/grid_types.hpp"

namespace cairn {

using namespace vdb;

namespace {

constexpr const char *kNoBricks = "contains no bricks", *kEndsEarly = "is truncated";

std::ifstream open_binary(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error("cannot be opened");
  return in;
}

/// Reads a brick file up to its voxels; leaves the stream at their start.
class BrickHeader : private openvdb::io::Archive {
 public:
  explicit BrickHeader(std::istream& in) {
    readHeader(in);
    setFormatVersion(in);
    setLibraryVersion(in);
    setDataCompression(in);
    openvdb::MetaMap().readMeta(in);
    grids_ = readGridCount(in);
    if (grids_ != 1 && grids_ != 2) throw std::runtime_error(kNoBricks);
    grid_ = next<openvdb::Int64Grid>(in);
  }
  [[nodiscard]] const VoxelTree& tree() const { return grid_->constTree(); }
  [[nodiscard]] bool has_free() const { return grids_ == 2; }
  /// Reads the free space; the stream must be at its grid.
  [[nodiscard]] openvdb::MaskGrid::Ptr read_free(std::istream& in) const {
    auto grid = next<openvdb::MaskGrid>(in);
    grid->readBuffers(in);
    return grid;
  }

 private:
  template <class Grid>
  static typename Grid::Ptr next(std::istream& in) {
    openvdb::io::GridDescriptor descriptor;
    auto grid = openvdb::gridPtrCast<Grid>(descriptor.read(in));
    if (!grid) throw std::runtime_error(kNoBricks);
    readGridCompression(in);
    grid->readMeta(in);
    grid->readTransform(in);
    grid->readTopology(in);
    return grid;
  }

  std::int32_t grids_ = 0;
  openvdb::Int64Grid::Ptr grid_;
};

/// `write_leaves(stream)` writes the voxels of `tree` if its leaves do not contain them.
template <class... WriteLeaves>
void write_bricks(const std::filesystem::path& file, const VoxelTree::Ptr& tree, const FreeTree::Ptr& free,
                  const WriteLeaves&... write_leaves) {
  const auto grid = openvdb::Int64Grid::create(tree);
  grid->setName("bricks");
  const auto mask = openvdb::MaskGrid::create(free);
  mask->setName("free");
  write_file(file, 2, [&](FileWriter& writer) {
    writer.write(*grid, write_leaves...);
    writer.write(*mask);
  });
}

}  // namespace

void write_bricks(const std::filesystem::path& file, const BrickTree& tree) {
  write_bricks(file, tree.state_->tree, tree.state_->free);
}

void write_bricks(const std::filesystem::path& file, const BrickList& list) {
  using Leaf = VoxelTree::LeafNodeType;
  initialize_once();
  std::vector<std::size_t> order(list.bricks.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return before_in_grid(list.bricks[a], list.bricks[b]); });
  const auto tree = std::make_shared<VoxelTree>(0);
  for (const std::size_t i : order) {
    auto leaf = std::make_unique<Leaf>(openvdb::PartialCreate(), origin_of(list.bricks[i]), 0);
    leaf->setValueMask(mask_of(kAllBits));
    tree->addLeaf(leaf.release());
  }
  const auto pack = [&](std::size_t begin, std::size_t end) {
    auto out = leaf_stream(tree->background());
    Leaf leaf;
    leaf.setValueMask(mask_of(kAllBits));
    for (std::size_t i = begin; i < end; ++i) {
      std::memcpy(leaf.buffer().data(), list.voxels[order[i]].data(), sizeof(BrickVoxels));
      leaf.writeBuffers(out, false);
    }
    return std::move(out).str();
  };
  write_bricks(file, tree, list.free.state_->free, [&](std::ostream& out) {
    pack_leaves(order.size(), pack, [&](const std::string& packed) { out << packed; });
  });
}

BrickFile::BrickFile(std::filesystem::path file) : file_(std::move(file)) {
  initialize_once();
  try {
    std::ifstream in = open_binary(file_);
    const BrickHeader header(in);
    version_ = openvdb::io::getFormatVersion(in);
    compression_ = openvdb::io::getDataCompression(in);
    std::vector<const VoxelTree::LeafNodeType*> leaves;
    header.tree().getNodes(leaves);
    for (const auto* leaf : leaves) {
      if (is_out_of_range(brick_at(leaf->origin()))) throw std::runtime_error(kOutOfRange);
      places_.push_back({brick_at(leaf->origin()), in.tellg()});
      VoxelTree::LeafNodeType::NodeMaskType mask;
      mask.load(in);
      openvdb::io::readCompressedValues<std::int64_t>(in, nullptr, 512, mask, false);
    }
    if (!in) throw std::runtime_error(kEndsEarly);
    const auto note = [&](const openvdb::Coord& origin) { free_.push_back(brick_at(origin)); };
    if (header.has_free()) {
      free_grid_ = in.tellg();
      for_each_tile(header.read_free(in)->tree(), note);
      if (!in) throw std::runtime_error(kEndsEarly);
    } else {
      for_each_tile(header.tree(), note);
    }
    std::sort(free_.begin(), free_.end(), before);
  } catch (const std::exception& error) {
    throw std::runtime_error(file_.string() + ": " + shown(error.what()));
  }
}

std::vector<Eigen::Vector3i> BrickFile::bricks() const {
  std::vector<Eigen::Vector3i> all;
  for (const Place& place : places_) all.push_back(place.brick);
  std::sort(all.begin(), all.end(), before);
  return all;
}

template <class Visit>
void BrickFile::visit(const std::optional<BrickBox>& box, const Visit& visit) const {
  const VoxelTree::ValueType background = 0;
  try {
    std::ifstream in = open_binary(file_);
    openvdb::io::setVersion(in, {openvdb::OPENVDB_LIBRARY_MAJOR_VERSION, openvdb::OPENVDB_LIBRARY_MINOR_VERSION},
                            version_);
    openvdb::io::setDataCompression(in, compression_);
    openvdb::io::setGridBackgroundValuePtr(in, &background);
    for (const Place& place : places_) {
      if (box && !box->contains(place.brick)) continue;
      if (in.tellg() != place.offset) in.seekg(place.offset);  // seekg discards the read buffer
      auto leaf = std::make_unique<VoxelTree::LeafNodeType>(origin_of(place.brick), background);
      leaf->readBuffers(in);
      visit(std::move(leaf));
    }
    if (!in) throw std::runtime_error(kEndsEarly);
  } catch (const std::exception& error) {
    throw std::runtime_error(file_.string() + ": " + shown(error.what()));
  }
}

void BrickFile::check() const {
  visit({}, [](const auto&) {});
}

BrickTree BrickFile::read(const BrickBox& box) const {
  BrickTree bricks;
  visit(box, [&](auto leaf) { bricks.state_->tree->addLeaf(leaf.release()); });
  for (const Eigen::Vector3i& brick : free_)
    if (box.contains(brick)) bricks.mark_free(brick);
  return bricks;
}

BrickTree BrickFile::read() const {
  BrickTree bricks = read_free();
  visit({}, [&](auto leaf) { bricks.state_->tree->addLeaf(leaf.release()); });
  return bricks;
}

BrickTree BrickFile::read_free() const {
  BrickTree free;
  if (free_grid_ == 0) {
    for (const Eigen::Vector3i& brick : free_) free.mark_free(brick);
    return free;
  }
  try {
    std::ifstream in = open_binary(file_);
    const BrickHeader header(in);
    in.seekg(free_grid_);
    for_each_mask(header.read_free(in)->tree(),
                  [&](const Eigen::Vector3i& brick, const BrickBits& bits) { free.mark_free(brick, bits); });
    if (!in) throw std::runtime_error(kEndsEarly);
  } catch (const std::exception& error) {
    throw std::runtime_error(file_.string() + ": " + shown(error.what()));
  }
  return free;
}

}  // namespace cairn
