// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/vdb/map_vdb.hpp"

#include <openvdb/openvdb.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "base/spool.hpp"
#include "base/words.hpp"
#include "geometry/axes.hpp"
#include "shaders/voxel.h"
#include "volume/grid_bricks.hpp"
#include "volume/sign_fill.hpp"
#include "volume/vdb/file_writer.hpp"
#include "volume/vdb/grid_types.hpp"

namespace cairn {

using namespace vdb;

namespace {

constexpr const char* kAxes = "axes";
constexpr const char *kUpSource = "up_source", *kUpKnown = "up_known",
                     *kUpDescription = "up";    // metadata of the map's grids
constexpr std::size_t kLeavesInMemory = 16384;  // of a file read in parts: 64 MiB for two grids

/// Maps index (i, j, k) to the point turn * (origin + voxel_size * (i, j, k)).
openvdb::math::Transform::Ptr transform_of(float voxel_size, const Eigen::Vector3d& origin,
                                           const Eigen::Quaterniond& turn) {
  const openvdb::Vec3d at(origin.x(), origin.y(), origin.z());
  if (turn.matrix().isIdentity(0)) {
    auto plain = openvdb::math::Transform::createLinearTransform(voxel_size);
    plain->postTranslate(at);
    return plain;
  }
  const Eigen::Matrix3d m = static_cast<double>(voxel_size) * turn.matrix();
  const Eigen::Vector3d t = turn * origin;
  return openvdb::math::Transform::createLinearTransform(  // OpenVDB uses row vectors
      openvdb::Mat4d(m(0, 0), m(1, 0), m(2, 0), 0.0, m(0, 1), m(1, 1), m(2, 1), 0.0, m(0, 2), m(1, 2), m(2, 2), 0.0,
                     t.x(), t.y(), t.z(), 1.0));
}

/// Rotation from the voxel frame to the file frame.
Eigen::Quaterniond file_from_voxels(const GridInfo& info) {
  return Eigen::Quaterniond(matrix_from_world(info.axes)) * info.upright.world_from_tracked;
}

/// Rotation of a grid. Throws std::runtime_error for a transform beyond rotation, uniform scale and translation.
Eigen::Quaterniond turn_of(const openvdb::GridBase& grid) {
  constexpr double kMaxSkew = 1e-5, kIdentityTolerance = 1e-6;
  const openvdb::Vec3d zero = grid.indexToWorld(openvdb::Vec3d(0.0));
  Eigen::Matrix3d turn;
  for (int axis = 0; axis < 3; ++axis) {
    openvdb::Vec3d unit(0.0);
    unit[axis] = 1;
    const openvdb::Vec3d side = grid.indexToWorld(unit) - zero;
    turn.col(axis) = Eigen::Vector3d(side.x(), side.y(), side.z()) / grid.voxelSize().x();
  }
  if (!turn.allFinite() || !(turn.transpose() * turn).isIdentity(kMaxSkew) || turn.determinant() < 0)
    throw std::runtime_error("its grids are stretched or mirrored");
  return turn.isIdentity(kIdentityTolerance) ? Eigen::Quaterniond::Identity() : Eigen::Quaterniond(turn).normalized();
}

/// Converts voxels to the values of a grid and stores its packed leaves.
/// `is_signed`: the sign of an inactive voxel marks its side of the surface, as in level sets.
template <class GridType, class Value, bool is_signed>
class MapGrid {
 public:
  using Grid = GridType;
  using Leaf = typename Grid::TreeType::LeafNodeType;
  MapGrid(const std::filesystem::path& file, typename Grid::ValueType background, Value value)
      : spool(file), background_(background), value_(std::move(value)) {}

  [[nodiscard]] std::string pack(std::span<const VoxelTree::LeafNodeType* const> from,
                                 std::span<const GridBrick> bricks) const {
    auto out = leaf_stream(background_);
    for (std::size_t i = 0; i < from.size(); ++i) {
      const Mask known = mask_of(bricks[i].known), behind = mask_of(bricks[i].behind);
      Leaf leaf(from[i]->origin(), background_);
      for (auto n = known.beginOn(); n; ++n)
        leaf.setValueOn(n.pos(), value_(static_cast<std::uint64_t>(from[i]->getValue(n.pos()))));
      if constexpr (is_signed)
        for (auto n = behind.beginOn(); n; ++n)
          if (!known.isOn(n.pos())) leaf.setValueOnly(n.pos(), -background_);
      leaf.writeBuffers(out, false);
    }
    return std::move(out).str();
  }

  /// The grid with the active masks of its leaves, without values.
  [[nodiscard]] typename Grid::Ptr grid(const char* name, const GridInfo& info,
                                        std::span<const GridBrick> bricks) const {
    auto made = Grid::create(background_);
    made->setName(name);
    made->setTransform(transform_of(info.voxel_size, Eigen::Vector3d::Zero(), file_from_voxels(info)));
    for (const GridBrick& brick : bricks) {
      auto leaf = std::make_unique<Leaf>(openvdb::PartialCreate(), origin_of(brick.at()), background_);
      leaf->setValueMask(mask_of(brick.known));
      made->tree().addLeaf(leaf.release());
    }
    return made;
  }

  Spool spool;

 private:
  typename Grid::ValueType background_;
  Value value_;
};
template <class Grid, bool is_signed = false, class Value>
MapGrid<Grid, Value, is_signed> map_grid(const std::filesystem::path& file, typename Grid::ValueType background,
                                         Value value) {
  return {file, background, std::move(value)};
}

auto distance_values(const std::filesystem::path& file, float truncation) {
  return map_grid<openvdb::FloatGrid, true>(
      file, truncation, [truncation](std::uint64_t v) { return shader::voxel_distance(v) * truncation; });
}
auto weight_values(const std::filesystem::path& file) {
  return map_grid<openvdb::FloatGrid>(file, 0.0f, [](std::uint64_t v) { return shader::voxel_weight(v); });
}
auto color_values(const std::filesystem::path& file) {
  return map_grid<openvdb::Vec3SGrid>(file, openvdb::Vec3s(0.0f), [](std::uint64_t v) {
    const auto channel = [&](int shift) { return static_cast<float>((v >> shift) & 0xff) / 255.0f; };
    return openvdb::Vec3s(channel(32), channel(40), channel(48));
  });
}
auto color_weights(const std::filesystem::path& file) {
  return map_grid<openvdb::FloatGrid>(file, 0.0f, [](std::uint64_t v) { return static_cast<float>(v >> 56); });
}

/// The background is the largest distance; unknown and farther voxels are not stored.
openvdb::FloatGrid::Ptr distance_grid(const DistanceField& field, Axes axes = Axes::world) {
  auto grid = openvdb::FloatGrid::create(field.max_distance());
  grid->setName("esdf");
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  grid->insertMeta(kAxes, openvdb::StringMetadata(described(axes)));
  grid->setTransform(
      transform_of(field.voxel_size(), field.origin().cast<double>(),
                   Eigen::Quaterniond(matrix_from_world(axes)) * field.world_from_field().cast<double>()));
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

openvdb::FloatGrid::Ptr sigma_grid(const GridInfo& info) {
  auto grid = openvdb::FloatGrid::create();
  grid->setName("sigma");
  grid->setTransform(
      transform_of(static_cast<float>(SurfaceSigma::kCell), Eigen::Vector3d::Zero(), file_from_voxels(info)));
  auto accessor = grid->getAccessor();
  for (const SurfaceSigma::Cell& cell : info.sigma.cells())
    accessor.setValueOn({cell.at.x(), cell.at.y(), cell.at.z()}, cell.sigma());
  return grid;
}

/// Throws std::runtime_error with the reason.
SurfaceSigma sigma_of(const openvdb::GridBase& base) {
  const auto* grid = dynamic_cast<const openvdb::FloatGrid*>(&base);
  if (grid == nullptr || std::abs(grid->voxelSize().x() - SurfaceSigma::kCell) > 1e-6)
    throw std::runtime_error("its grid `sigma` has an unexpected type or voxel size");
  std::vector<SurfaceSigma::Cell> cells;
  for (auto leaf = grid->tree().cbeginLeaf(); leaf; ++leaf)
    for (auto value = leaf->cbeginValueOn(); value; ++value) {
      const openvdb::Coord at = value.getCoord();
      const auto sigma = static_cast<double>(*value);
      if (!(sigma > 0 && std::isfinite(sigma)))
        throw std::runtime_error("its grid `sigma` has a value that is not a standard deviation");
      cells.push_back({.at = {at.x(), at.y(), at.z()}, .variance = sigma * sigma, .weight = 1});
    }
  return SurfaceSigma(cells);
}

/// Rotation from the grid frame to the world, independent of the axes of the file.
Eigen::Quaterniond world_from_grid(const openvdb::FloatGrid& grid) {
  const Eigen::Quaterniond turn = turn_of(grid);
  const auto stored = grid.getMetadata<openvdb::StringMetadata>(kAxes);
  const Axes axes = stored ? axes_in(stored->value()).value_or(Axes::world) : Axes::world;
  return axes == Axes::world ? turn : Eigen::Quaterniond(matrix_from_world(axes)).conjugate() * turn;
}

/// Gravity direction from the metadata of a map's grid; unknown in files of other programs or of early versions.
GravityAlignment upright_of(const openvdb::FloatGrid& tsdf) {
  GravityAlignment upright{
      .world_from_tracked = world_from_grid(tsdf), .description = "not known: the file does not store it", .off = {}};
  const auto source = tsdf.getMetadata<openvdb::StringMetadata>(kUpSource);
  const auto known = tsdf.getMetadata<openvdb::BoolMetadata>(kUpKnown);
  const auto description = tsdf.getMetadata<openvdb::StringMetadata>(kUpDescription);
  if (!source || !known || !description) return upright;
  using Source = GravityAlignment::Source;
  for (const auto s : {Source::accelerometer, Source::structure, Source::option, Source::poses})
    if (source->value() == to_string(s)) upright.source = s;
  upright.known = known->value() && upright.source != Source::unknown;
  const std::string& text = description->value();  // Cairn writes printable ASCII only
  constexpr std::size_t kMaxLength = 300;
  const bool is_plain = text.size() < kMaxLength &&
                        std::all_of(text.begin(), text.end(), [](unsigned char c) { return c >= ' ' && c < 127; });
  upright.description = is_plain ? text : shown(text);
  return upright;
}

std::runtime_error not_a_map(const std::filesystem::path& file, const std::string& why) {
  return std::runtime_error(file.string() + ": " + why + "; expected a map.vdb written by cairn");
}

/// Marks in `tree` the free space from the grid `free` of a map.vdb, or from the tiles of `tsdf` in files from before
/// 2026-11-24 without that grid.
void read_free(const std::filesystem::path& file, const openvdb::GridBase::Ptr& free, const openvdb::FloatGrid& tsdf,
               BrickTree& tree) {
  if (!free) {
    for_each_tile(tsdf.tree(), [&](const openvdb::Coord& origin) { tree.mark_free(brick_at(origin)); });
    return;
  }
  const auto mask = openvdb::gridPtrCast<openvdb::BoolGrid>(free);
  if (!mask) throw not_a_map(file, "its grid `free` has an unexpected type");
  for_each_mask(mask->tree(),
                [&](const Eigen::Vector3i& brick, const BrickBits& bits) { tree.mark_free(brick, bits); });
}

/// Calls `visit(begin, end)` with index ranges of bricks to process together.
template <class Visit>
void for_each_part(std::size_t count, const Visit& visit) {
  for (std::size_t begin = 0; begin < count; begin += kLeavesInMemory)
    visit(begin, std::min(begin + kLeavesInMemory, count));
}

}  // namespace

// Defined here to keep OpenVDB's headers out of map_vdb.hpp.
struct GridsWriter::State {
  State(std::filesystem::path f, const GridInfo& i)
      : file(std::move(f)),
        info(i),
        bricks(file),
        tsdf(distance_values(file, i.truncation)),
        weight(weight_values(file)),
        color(color_values(file)),
        color_weight(color_weights(file)) {}
  std::filesystem::path file;
  GridInfo info;
  GridBricks bricks;
  decltype(distance_values({}, 0)) tsdf;
  decltype(weight_values({})) weight;
  decltype(color_values({})) color;
  decltype(color_weights({})) color_weight;
};

GridsWriter::GridsWriter(std::filesystem::path file, const GridInfo& info)
    : state_(std::make_unique<State>(std::move(file), info)) {
  initialize_once();
}
GridsWriter::~GridsWriter() = default;

void GridsWriter::add(const BrickTree& bricks) {
  State& s = *state_;
  std::vector<const VoxelTree::LeafNodeType*> leaves;
  std::as_const(*bricks.state_->tree).getNodes(leaves);
  struct Packed {
    std::vector<GridBrick> bricks;
    std::string tsdf, weight, color, color_weight;
  };
  const auto pack = [&](std::size_t begin, std::size_t end) {
    const auto from = std::span(leaves).subspan(begin, end - begin);
    Packed packed;
    for (const auto* leaf : from) {
      Mask known, behind;  // subset of known
      for (openvdb::Index n = 0; n < 512; ++n) {
        const auto voxel = static_cast<std::uint64_t>(leaf->getValue(n));
        known.set(n, ((voxel >> 16) & 0xffff) != 0);
        behind.set(n, known.isOn(n) && shader::voxel_distance(voxel) < 0);
      }
      const Eigen::Vector3i at = brick_at(leaf->origin());
      packed.bricks.push_back({.brick = {at.x(), at.y(), at.z()},
                               .known = bits_of(known),
                               .behind = fill_unknown_signs(bits_of(known), bits_of(behind))});
    }
    packed.tsdf = s.tsdf.pack(from, packed.bricks);
    packed.weight = s.weight.pack(from, packed.bricks);
    packed.color = s.color.pack(from, packed.bricks);
    packed.color_weight = s.color_weight.pack(from, packed.bricks);
    return packed;
  };
  pack_leaves(leaves.size(), pack, [&](const Packed& packed) {
    s.bricks.append(packed.bricks);
    s.tsdf.spool.append(packed.tsdf);
    s.weight.spool.append(packed.weight);
    s.color.spool.append(packed.color);
    s.color_weight.spool.append(packed.color_weight);
  });
}

void GridsWriter::write(const BrickTree& free, const DistanceField* distances) {
  State& s = *state_;
  const std::span<const GridBrick> bricks = s.bricks.all();
  const auto transform = [&] {
    return transform_of(s.info.voxel_size, Eigen::Vector3d::Zero(), file_from_voxels(s.info));
  };
  const bool has_sigma = !s.info.sigma.empty();
  write_file(s.file, 6 + int{has_sigma} + int{distances != nullptr}, [&](FileWriter& writer) {
    const auto append = [&](auto& grid, const Spool& spool) {
      writer.write(grid, [&](std::ostream& out) { spool.copy_to(out); });
    };
    {
      const auto tsdf = s.tsdf.grid("tsdf", s.info, bricks);
      tsdf->setGridClass(openvdb::GRID_LEVEL_SET);
      tsdf->insertMeta("truncation", openvdb::FloatMetadata(s.info.truncation));
      tsdf->insertMeta(kAxes, openvdb::StringMetadata(described(s.info.axes)));
      tsdf->insertMeta(kUpSource, openvdb::StringMetadata(std::string(to_string(s.info.upright.source))));
      tsdf->insertMeta(kUpKnown, openvdb::BoolMetadata(s.info.upright.known));
      tsdf->insertMeta(kUpDescription, openvdb::StringMetadata(s.info.upright.description));
      for_each_part(bricks.size(), [&](std::size_t begin, std::size_t end) {
        const auto behind = s.bricks.with_around(begin, end, &GridBrick::behind, two_steps());
        for (const Eigen::Vector3i& brick : inside_neighbors(behind, end - begin))
          tsdf->tree().addTile(1, origin_of(brick), -s.info.truncation, false);
      });
      append(*tsdf, s.tsdf.spool);
    }
    append(*s.weight.grid("weight", s.info, bricks), s.weight.spool);
    append(*s.color.grid("color", s.info, bricks), s.color.spool);
    append(*s.color_weight.grid("color_weight", s.info, bricks), s.color_weight.spool);
    {
      const auto grid = openvdb::BoolGrid::create(false);
      for_each_part(bricks.size(), [&](std::size_t begin, std::size_t end) {
        const auto known = s.bricks.with_around(begin, end, &GridBrick::known, upper_corners());
        const std::vector<BrickBits> cells = fully_observed_cells(known, end - begin);
        for (std::size_t i = 0; i < cells.size(); ++i) {
          if (cells[i] == BrickBits{}) continue;
          auto leaf = std::make_unique<openvdb::BoolTree::LeafNodeType>(origin_of(known[i].first), false);
          leaf->setValueMask(mask_of(cells[i]));
          leaf->buffer() = openvdb::BoolTree::LeafNodeType::Buffer(mask_of(cells[i]));
          grid->tree().addLeaf(leaf.release());
        }
      });
      grid->setName("observed");
      grid->setTransform(transform());
      writer.write(*grid);
    }
    {
      const auto grid = openvdb::BoolGrid::create(
          std::make_shared<openvdb::BoolTree>(*free.state_->free, false, true, openvdb::TopologyCopy()));
      grid->setName("free");
      grid->setTransform(transform());
      writer.write(*grid);
    }
    if (has_sigma) writer.write(*sigma_grid(s.info));
    if (distances != nullptr) writer.write(*distance_grid(*distances, s.info.axes));
  });
}

void write_grids(const std::filesystem::path& file, const BrickTree& tree, const GridInfo& info,
                 const DistanceField* distances) {
  GridsWriter writer(file, info);
  writer.add(tree);
  writer.write(tree, distances);
}

void write_distances(const std::filesystem::path& file, const DistanceField& distances) {
  initialize_once();
  write_file(file, 1, [&](FileWriter& writer) { writer.write(*distance_grid(distances)); });
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
  } catch (const std::exception& error) {  // from OpenVDB, or bad_alloc for a size in a corrupt file
    throw wrong(shown(error.what()));
  }
  if (!grid) throw wrong("its grid `esdf` has an unexpected type");
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
  for (const auto& [at, block] : blocks) list.push_back({Eigen::Vector3i(at[0], at[1], at[2]), block});
  const openvdb::Vec3d zero = grid->transform().indexToWorld(openvdb::Vec3d(0.0));
  Eigen::Quaterniond file_turn = Eigen::Quaterniond::Identity(), turn = file_turn;
  try {
    file_turn = turn_of(*grid);
    turn = world_from_grid(*grid);
  } catch (const std::runtime_error& error) {
    throw wrong(error.what());
  }
  const Eigen::Vector3d origin = file_turn.conjugate() * Eigen::Vector3d(zero.x(), zero.y(), zero.z());
  return {static_cast<float>(grid->voxelSize().x()), origin.cast<float>(), grid->background(), std::move(list),
          turn.cast<float>()};
}

struct MapFile::State {
  std::filesystem::path file;
  GridInfo info;
  openvdb::FloatGrid::Ptr tsdf, weight;
  BrickTree free;  // free marks only
};

MapFile::MapFile(const std::filesystem::path& file) : state_(std::make_unique<State>()) {
  initialize_once();
  State& s = *state_;
  s.file = file;
  openvdb::GridBase::Ptr free;
  try {
    openvdb::io::File in(file.string());
    in.setCopyMaxBytes(0);  // files are replaced, never modified in place
    in.open();              // voxels are loaded on demand
    s.tsdf = openvdb::gridPtrCast<openvdb::FloatGrid>(in.readGrid("tsdf"));
    s.weight = openvdb::gridPtrCast<openvdb::FloatGrid>(in.readGrid("weight"));
    if (in.hasGrid("free")) free = in.readGrid("free");
  } catch (const std::exception& error) {  // from OpenVDB, or bad_alloc for a size in a corrupt file
    throw not_a_map(file, shown(error.what()));
  }
  if (!s.tsdf || !s.weight) throw not_a_map(file, "a grid has an unexpected type");
  read_free(file, free, *s.tsdf, s.free);
  s.info = {.voxel_size = static_cast<float>(s.tsdf->voxelSize().x()), .truncation = s.tsdf->background()};
  try {
    s.info.upright = upright_of(*s.tsdf);
  } catch (const std::runtime_error& error) {
    throw not_a_map(file, error.what());
  }
  if (const BrickBox box = bounds(); !box.isEmpty() && (is_out_of_range(box.min()) || is_out_of_range(box.max())))
    throw not_a_map(file, kOutOfRange);
}
MapFile::~MapFile() = default;

const GridInfo& MapFile::info() const { return state_->info; }

BrickBox MapFile::bounds() const {
  BrickBox box;
  for (auto leaf = state_->tsdf->tree().cbeginLeaf(); leaf; ++leaf) box.extend(brick_at(leaf->origin()));
  for (const Eigen::Vector3i& brick : state_->free.free_bricks()) box.extend(brick);
  return box;
}

void MapFile::visit(const Visit& visit, const std::optional<BrickBox>& box) const {
  using Leaf = openvdb::FloatTree::LeafNodeType;
  const auto is_requested = [&](const Eigen::Vector3i& brick) { return !box || box->contains(brick); };
  std::vector<Leaf*> leaves;
  state_->tsdf->tree().getNodes(leaves);
  std::erase_if(leaves, [&](const Leaf* leaf) { return !is_requested(brick_at(leaf->origin())); });
  std::vector<Leaf*> weights;
  weights.reserve(leaves.size());
  for (const Leaf* leaf : leaves) weights.push_back(state_->weight->tree().probeLeaf(leaf->origin()));
  if (std::find(weights.begin(), weights.end(), nullptr) != weights.end())
    throw not_a_map(state_->file, "its grids do not cover the same bricks");
  for (std::size_t begin = 0; begin < leaves.size(); begin += kLeavesInMemory) {
    const std::size_t end = std::min(begin + kLeavesInMemory, leaves.size());
    try {
      tbb::parallel_for(begin, end, [&](std::size_t i) {  // loads and unpacks the leaves
        (void)std::as_const(*leaves[i]).buffer().data();
        (void)std::as_const(*weights[i]).buffer().data();
      });
    } catch (const std::exception& error) {
      throw not_a_map(state_->file, shown(error.what()));
    }
    for (std::size_t i = begin; i < end; ++i) {
      const float *distance = std::as_const(*leaves[i]).buffer().data(),
                  *weight = std::as_const(*weights[i]).buffer().data();
      const Eigen::Vector3i brick = brick_at(leaves[i]->origin());
      Voxels voxels{.free = state_->free.free_voxels(brick)};
      for (openvdb::Index n = 0; n < 512; ++n) {
        if (!leaves[i]->isValueOn(n) || !std::isfinite(distance[n]) || !(weight[n] > 0)) continue;
        voxels.distances[n] = distance[n];
        voxels.weights[n] = weight[n];
        voxels.free[n >> 6] &= ~(1ull << (n & 63));  // an observed distance overrides the free mark
      }
      visit(brick, voxels);
      for (Leaf* leaf : {leaves[i], weights[i]}) {  // release memory
        Leaf::Buffer none(openvdb::PartialCreate(), 0.0f);
        leaf->swap(none);
      }
    }
  }
  for (const Eigen::Vector3i& brick : state_->free.free_bricks())
    if (is_requested(brick) && state_->tsdf->tree().probeConstLeaf(origin_of(brick)) == nullptr)
      visit(brick, {.free = state_->free.free_voxels(brick)});
}

void MapFile::read(const BrickBox& box, BrickTree& tree) const {
  const auto add = [&](const Eigen::Vector3i& brick, const Voxels& voxels) {
    tree.mark_free(brick, voxels.free);
    BrickVoxels packed{};
    bool is_observed = false;
    for (std::size_t i = 0; i < packed.size(); ++i) {
      if (!(voxels.weights[i] > 0)) continue;
      packed[i] = shader::pack_voxel(voxels.distances[i] / info().truncation, voxels.weights[i], 0);
      is_observed = true;
    }
    if (is_observed) tree.put(brick, packed);
  };
  visit(add, box);
}

ReadGrids read_grids(const std::filesystem::path& file) {
  initialize_once();
  const auto wrong = [&](const std::string& why) { return not_a_map(file, why); };
  openvdb::GridBase::Ptr base[4], free, sigma;
  try {
    openvdb::io::File in(file.string());
    in.open(false);
    constexpr std::array kNames{"tsdf", "weight", "color", "color_weight"};
    constexpr std::array kOldNames{"tsdf", "weight", "colour", "colour_weight"};  // before version 0.2
    const auto& names = in.hasGrid("colour") ? kOldNames : kNames;
    for (int i = 0; i < 4; ++i) base[i] = in.readGrid(names[i]);
    if (in.hasGrid("free")) free = in.readGrid("free");
    if (in.hasGrid("sigma")) sigma = in.readGrid("sigma");
  } catch (const std::exception& error) {  // from OpenVDB, or bad_alloc for a size in a corrupt file
    throw wrong(shown(error.what()));
  }
  const auto tsdf = openvdb::gridPtrCast<openvdb::FloatGrid>(base[0]);
  const auto weight = openvdb::gridPtrCast<openvdb::FloatGrid>(base[1]);
  const auto color = openvdb::gridPtrCast<openvdb::Vec3SGrid>(base[2]);
  auto color_weight = openvdb::gridPtrCast<openvdb::FloatGrid>(base[3]);
  if (const auto integer_weights = openvdb::gridPtrCast<openvdb::Int32Grid>(base[3]))  // format of version 0.2
    color_weight = std::make_shared<openvdb::FloatGrid>(*integer_weights);
  if (!tsdf || !weight || !color || !color_weight) throw wrong("a grid has an unexpected type");
  ReadGrids result;
  result.info = {.voxel_size = static_cast<float>(tsdf->voxelSize().x()), .truncation = tsdf->background()};
  try {
    result.info.upright = upright_of(*tsdf);
    if (sigma) result.info.sigma = sigma_of(*sigma);
  } catch (const std::runtime_error& error) {
    throw wrong(error.what());
  }
  for (auto leaf = tsdf->tree().cbeginLeaf(); leaf; ++leaf) {
    const auto at = leaf->origin();
    if (is_out_of_range(brick_at(at))) throw wrong(kOutOfRange);
    const auto* w = weight->tree().probeConstLeaf(at);
    const auto* c = color->tree().probeConstLeaf(at);
    const auto* n = color_weight->tree().probeConstLeaf(at);
    if (w == nullptr || c == nullptr || n == nullptr) throw wrong("its grids do not cover the same bricks");
    BrickVoxels voxels{};
    for (openvdb::Index i = 0; i < 512; ++i) {
      if (!leaf->isValueOn(i)) continue;
      const openvdb::Vec3s& rgb = c->getValue(i);
      const auto is_in = [](float value, float low, float high) { return value >= low && value <= high; };  // not NaN
      if (!is_in(leaf->getValue(i) / result.info.truncation, -1.001f, 1.001f) ||
          !is_in(w->getValue(i) * shader::kWeightUnits, 0, 65535) || !is_in(rgb.x(), 0, 1) || !is_in(rgb.y(), 0, 1) ||
          !is_in(rgb.z(), 0, 1) || !is_in(n->getValue(i), 0, 255)) {
        const auto where = leaf->offsetToGlobalCoord(i);
        throw wrong("voxel " + std::to_string(where.x()) + " " + std::to_string(where.y()) + " " +
                    std::to_string(where.z()) + " has a value that is out of range or not a number");
      }
      auto color_word = static_cast<std::uint32_t>(std::lround(n->getValue(i))) << 24;
      for (int k = 0; k < 3; ++k) color_word |= static_cast<std::uint32_t>(std::lround(rgb[k] * 255.0f)) << (8 * k);
      voxels[i] = shader::pack_voxel(leaf->getValue(i) / result.info.truncation, w->getValue(i), color_word);
    }
    result.tree.put(brick_at(at), voxels);
  }
  read_free(file, free, *tsdf, result.tree);
  return result;
}

}  // namespace cairn
