// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/grids.hpp"

#include <openvdb/io/GridDescriptor.h>
#include <openvdb/openvdb.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <map>
#include <mutex>
#include <numeric>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/axes.hpp"
#include "base/spool.hpp"
#include "base/words.hpp"
#include "cairn/atomic_file.hpp"
#include "shaders/voxel.h"
#include "volume/grid_bricks.hpp"
#include "volume/known_cells.hpp"

namespace cairn {
namespace {

using VoxelTree = openvdb::Int64Tree;
using FreeTree = openvdb::MaskTree;
constexpr const char* kAxes = "axes";
constexpr const char *kUpSource = "up_source", *kUpKnown = "up_known", *kUpWords = "up";  // metadata of the map's grids

void initialize_once() {
  static std::once_flag once;
  std::call_once(once, [] { openvdb::initialize(); });
}

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
  constexpr double kBent = 1e-5, kNothing = 1e-6;
  const openvdb::Vec3d zero = grid.indexToWorld(openvdb::Vec3d(0.0));
  Eigen::Matrix3d turn;
  for (int axis = 0; axis < 3; ++axis) {
    openvdb::Vec3d unit(0.0);
    unit[axis] = 1;
    const openvdb::Vec3d side = grid.indexToWorld(unit) - zero;
    turn.col(axis) = Eigen::Vector3d(side.x(), side.y(), side.z()) / grid.voxelSize().x();
  }
  if (!turn.allFinite() || !(turn.transpose() * turn).isIdentity(kBent) || turn.determinant() < 0)
    throw std::runtime_error("its grids are stretched or mirrored");
  return turn.isIdentity(kNothing) ? Eigen::Quaterniond::Identity() : Eigen::Quaterniond(turn).normalized();
}

openvdb::Coord origin_of(const Eigen::Vector3i& brick) { return {8 * brick.x(), 8 * brick.y(), 8 * brick.z()}; }
Eigen::Vector3i brick_at(const openvdb::Coord& voxel) { return {voxel.x() >> 3, voxel.y() >> 3, voxel.z() >> 3}; }

/// True if the brick is so far from the origin that sums and products of its coordinates may overflow.
bool is_far(const Eigen::Vector3i& brick) {
  constexpr int kFar = 1 << 24;  // bricks
  return (brick.array() < -kFar).any() || (brick.array() > kFar).any();
}
constexpr const char* kNowhere = "a brick lies nowhere";

/// Calls `visit` with the first voxel of each active leaf-sized tile.
template <class Tree, class Visit>
void for_each_tile(const Tree& tree, const Visit& visit) {
  auto tile = tree.cbeginValueOn();
  tile.setMaxDepth(decltype(tile)::LEAF_DEPTH - 1);
  for (; tile; ++tile) visit(tile.getCoord());
}

using Mask = VoxelTree::LeafNodeType::NodeMaskType;
static_assert(Mask::WORD_COUNT == std::tuple_size_v<BrickBits>);

BrickBits bits_of(const Mask& mask) {
  BrickBits bits;
  for (openvdb::Index w = 0; w < Mask::WORD_COUNT; ++w) bits[w] = mask.getWord<openvdb::Index64>(w);
  return bits;
}
Mask mask_of(const BrickBits& bits) {
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

constexpr std::uint32_t kCompression = openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK;
constexpr std::size_t kLeavesAtOnce = 256;      // packed per thread
constexpr std::size_t kLeavesInMemory = 16384;  // of a file read in parts: 64 MiB for two grids
constexpr std::size_t kPacksAtOnce = 8;         // queued for output

/// Packs leaves in the file format on all cores: `pack(begin, end)` packs a range on one thread, `take(packed)`
/// receives the results in order.
template <class Pack, class Take>
void pack_leaves(std::size_t count, const Pack& pack, const Take& take) {
  using Packed = std::invoke_result_t<Pack, std::size_t, std::size_t>;
  std::size_t next = 0;
  const auto begin = [&](tbb::flow_control& control) {
    if (next >= count) control.stop();
    return std::exchange(next, next + kLeavesAtOnce);
  };
  const auto pack_from = [&](std::size_t i) { return pack(i, std::min(i + kLeavesAtOnce, count)); };
  using tbb::filter_mode;
  tbb::parallel_pipeline(kPacksAtOnce, tbb::make_filter<void, std::size_t>(filter_mode::serial_in_order, begin) &
                                           tbb::make_filter<std::size_t, Packed>(filter_mode::parallel, pack_from) &
                                           tbb::make_filter<Packed, void>(filter_mode::serial_in_order, take));
}

/// In-memory stream with the leaf format of a file.
template <class Value>
std::ostringstream leaf_stream(const Value& background) {
  std::ostringstream out;
  openvdb::io::setDataCompression(out, kCompression);
  openvdb::io::setGridBackgroundValuePtr(out, &background);
  return out;
}

/// Writes grids sequentially, to keep a single grid in memory, and records their offsets for random access. OpenVDB's
/// own writers need all grids at once and pack leaves on one core.
class FileWriter : private openvdb::io::Archive {
 public:
  FileWriter(std::ostream& out, std::int32_t grids) : out_(out) {
    setCompression(kCompression);
    writeHeader(out_, true);
    openvdb::MetaMap().writeMeta(out_);
    out_.write(reinterpret_cast<const char*>(&grids), sizeof(grids));
  }

  /// Writes all of `grid` except the voxels of its leaves; `write_leaves(stream)` writes the voxels.
  template <class Grid, class WriteLeaves>
  void write(Grid& grid, const WriteLeaves& write_leaves) {
    grid.setCreator("cairn");
    grid.addStatsMetadata();
    openvdb::io::GridDescriptor descriptor(grid.getName(), grid.type());
    descriptor.writeHeader(out_);
    const auto places = out_.tellp();
    descriptor.writeStreamPos(out_);
    descriptor.setGridPos(out_.tellp());
    setGridCompression(out_, grid);
    grid.writeMeta(out_);
    grid.writeTransform(out_);
    grid.writeTopology(out_);
    descriptor.setBlockPos(out_.tellp());
    write_leaves(out_);
    descriptor.setEndPos(out_.tellp());
    out_.seekp(places);
    descriptor.writeStreamPos(out_);
    descriptor.seekToEnd(out_);
  }

  /// Writes the grid with its leaves.
  template <class Grid>
  void write(Grid& grid) {
    std::vector<const typename Grid::TreeType::LeafNodeType*> leaves;
    grid.constTree().getNodes(leaves);
    write(grid, [&](std::ostream& to) {
      const auto pack = [&, background = grid.background()](std::size_t begin, std::size_t end) {
        auto out = leaf_stream(background);
        for (std::size_t i = begin; i < end; ++i) leaves[i]->writeBuffers(out, false);
        return std::move(out).str();
      };
      pack_leaves(leaves.size(), pack, [&](const std::string& packed) { to << packed; });
    });
  }

 private:
  std::ostream& out_;
};

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
auto colour_values(const std::filesystem::path& file) {
  return map_grid<openvdb::Vec3SGrid>(file, openvdb::Vec3s(0.0f), [](std::uint64_t v) {
    const auto channel = [&](int shift) { return static_cast<float>((v >> shift) & 0xff) / 255.0f; };
    return openvdb::Vec3s(channel(32), channel(40), channel(48));
  });
}
auto colour_weights(const std::filesystem::path& file) {
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
    throw std::runtime_error("its grid `sigma` has another type or other voxels");
  std::vector<SurfaceSigma::Cell> cells;
  for (auto leaf = grid->tree().cbeginLeaf(); leaf; ++leaf)
    for (auto value = leaf->cbeginValueOn(); value; ++value) {
      const openvdb::Coord at = value.getCoord();
      const auto sigma = static_cast<double>(*value);
      if (!(sigma > 0 && std::isfinite(sigma)))
        throw std::runtime_error("its grid `sigma` holds no standard deviation");
      cells.push_back({.at = {at.x(), at.y(), at.z()}, .variance = sigma * sigma, .weight = 1});
    }
  return SurfaceSigma(cells);
}

/// Rotation from the grid frame to the world, independent of the axes of the file.
Eigen::Quaterniond world_from_grid(const openvdb::FloatGrid& grid) {
  const Eigen::Quaterniond turn = turn_of(grid);
  const auto told = grid.getMetadata<openvdb::StringMetadata>(kAxes);
  const Axes axes = told ? axes_in(told->value()).value_or(Axes::world) : Axes::world;
  return axes == Axes::world ? turn : Eigen::Quaterniond(matrix_from_world(axes)).conjugate() * turn;
}

/// Gravity direction from the metadata of a map's grid; unknown in files of other programs or of early versions.
Upright upright_of(const openvdb::FloatGrid& tsdf) {
  Upright upright{
      .world_from_tracked = world_from_grid(tsdf), .words = "not known: the file does not tell it", .off = {}};
  const auto source = tsdf.getMetadata<openvdb::StringMetadata>(kUpSource);
  const auto known = tsdf.getMetadata<openvdb::BoolMetadata>(kUpKnown);
  const auto words = tsdf.getMetadata<openvdb::StringMetadata>(kUpWords);
  if (!source || !known || !words) return upright;
  using Source = Upright::Source;
  for (const auto s : {Source::accelerometer, Source::structure, Source::option, Source::poses})
    if (source->value() == name_of(s)) upright.source = s;
  upright.known = known->value() && upright.source != Source::unknown;
  const std::string& told = words->value();  // Cairn writes printable ASCII only
  constexpr std::size_t kLongest = 300;
  const bool is_plain = told.size() < kLongest &&
                        std::all_of(told.begin(), told.end(), [](unsigned char c) { return c >= ' ' && c < 127; });
  upright.words = is_plain ? told : shown(told);
  return upright;
}

std::runtime_error no_map(const std::filesystem::path& file, const std::string& why) {
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
  if (!mask) throw no_map(file, "its grid `free` has another type");
  for_each_mask(mask->tree(),
                [&](const Eigen::Vector3i& brick, const BrickBits& bits) { tree.mark_free(brick, bits); });
}

constexpr const char *kNoBricks = "holds no bricks", *kEndsEarly = "ends early";

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

/// `write(writer)` writes the grids.
template <class Write>
void write_file(const std::filesystem::path& file, std::int32_t grids, const Write& write) {
  write_whole(file, [&](std::ostream& out) {  // openvdb::io::File does not detect a full disk
    FileWriter writer(out, grids);
    write(writer);
    // OpenVDB writes a random UUID into each file; equal maps must give equal bytes.
    constexpr std::streamoff kUuidOffset = 21;  // magic number, three versions, one flag
    out.seekp(kUuidOffset) << "00000000-0000-4000-8000-000000000000";
  });
}

}  // namespace

BrickMarks ball(const Eigen::Vector3d& centre, double radius) {
  BrickMarks marks;
  const auto brick_of = [](double voxel) { return static_cast<int>(std::floor(voxel)) >> 3; };
  const auto first = [&](int axis) { return brick_of(std::ceil(centre[axis] - radius)); };
  const auto last = [&](int axis) { return brick_of(centre[axis] + radius); };
  for (int x = first(0); x <= last(0); ++x)
    for (int y = first(1); y <= last(1); ++y)
      for (int z = first(2); z <= last(2); ++z) {
        BrickBits bits{};
        for (int i = 0; i < 64; ++i) {  // columns along z
          const double dx = 8 * x + (i >> 3) - centre.x(), dy = 8 * y + (i & 7) - centre.y();
          const double half = std::sqrt(std::max(0.0, radius * radius - dx * dx - dy * dy));
          if (dx * dx + dy * dy > radius * radius) continue;
          const auto low = std::max(0, static_cast<int>(std::ceil(centre.z() - half)) - 8 * z);
          const auto high = std::min(7, static_cast<int>(std::floor(centre.z() + half)) - 8 * z);
          for (int k = low; k <= high; ++k) bits[static_cast<std::size_t>(i >> 3)] |= 1ull << (8 * (i & 7) + k);
        }
        if (bits == kNoBits) continue;
        marks.bricks.emplace_back(x, y, z);
        marks.voxels.push_back(bits);
      }
  return marks;
}

struct BrickTree::State {
  VoxelTree::Ptr tree = std::make_shared<VoxelTree>(0);
  FreeTree::Ptr free = std::make_shared<FreeTree>(false);
};

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

BrickList list_of(const BrickTree& tree) {
  BrickList list{.bricks = tree.bricks(), .voxels = {}, .free = tree.copy_free()};
  list.voxels.resize(list.bricks.size());
  for (std::size_t i = 0; i < list.bricks.size(); ++i)
    std::memcpy(list.voxels[i].data(), tree.find(list.bricks[i]), sizeof(BrickVoxels));
  return list;
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

/// Calls `visit(begin, end)` with index ranges of bricks to process together.
template <class Visit>
void for_each_part(std::size_t count, const Visit& visit) {
  for (std::size_t begin = 0; begin < count; begin += kLeavesInMemory)
    visit(begin, std::min(begin + kLeavesInMemory, count));
}

// Defined here to keep OpenVDB's headers out of grids.hpp.
struct GridsWriter::State {
  State(std::filesystem::path f, const GridInfo& i)
      : file(std::move(f)),
        info(i),
        bricks(file),
        tsdf(distance_values(file, i.truncation)),
        weight(weight_values(file)),
        colour(colour_values(file)),
        colour_weight(colour_weights(file)) {}
  std::filesystem::path file;
  GridInfo info;
  GridBricks bricks;
  decltype(distance_values({}, 0)) tsdf;
  decltype(weight_values({})) weight;
  decltype(colour_values({})) colour;
  decltype(colour_weights({})) colour_weight;
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
    std::string tsdf, weight, colour, colour_weight;
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
                               .behind = with_unknown(bits_of(known), bits_of(behind))});
    }
    packed.tsdf = s.tsdf.pack(from, packed.bricks);
    packed.weight = s.weight.pack(from, packed.bricks);
    packed.colour = s.colour.pack(from, packed.bricks);
    packed.colour_weight = s.colour_weight.pack(from, packed.bricks);
    return packed;
  };
  pack_leaves(leaves.size(), pack, [&](const Packed& packed) {
    s.bricks.append(packed.bricks);
    s.tsdf.spool.append(packed.tsdf);
    s.weight.spool.append(packed.weight);
    s.colour.spool.append(packed.colour);
    s.colour_weight.spool.append(packed.colour_weight);
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
      tsdf->insertMeta(kUpSource, openvdb::StringMetadata(std::string(name_of(s.info.upright.source))));
      tsdf->insertMeta(kUpKnown, openvdb::BoolMetadata(s.info.upright.known));
      tsdf->insertMeta(kUpWords, openvdb::StringMetadata(s.info.upright.words));
      for_each_part(bricks.size(), [&](std::size_t begin, std::size_t end) {
        const auto behind = s.bricks.with_around(begin, end, &GridBrick::behind, two_steps());
        for (const Eigen::Vector3i& brick : behind_beside(behind, end - begin))
          tsdf->tree().addTile(1, origin_of(brick), -s.info.truncation, false);
      });
      append(*tsdf, s.tsdf.spool);
    }
    append(*s.weight.grid("weight", s.info, bricks), s.weight.spool);
    append(*s.colour.grid("colour", s.info, bricks), s.colour.spool);
    append(*s.colour_weight.grid("colour_weight", s.info, bricks), s.colour_weight.spool);
    {
      const auto grid = openvdb::BoolGrid::create(false);
      for_each_part(bricks.size(), [&](std::size_t begin, std::size_t end) {
        const auto known = s.bricks.with_around(begin, end, &GridBrick::known, upper_corners());
        const std::vector<BrickBits> cells = whole_cells(known, end - begin);
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
      if (is_far(brick_at(leaf->origin()))) throw std::runtime_error(kNowhere);
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
    throw no_map(file, shown(error.what()));
  }
  if (!s.tsdf || !s.weight) throw no_map(file, "a grid has another type");
  read_free(file, free, *s.tsdf, s.free);
  s.info = {.voxel_size = static_cast<float>(s.tsdf->voxelSize().x()), .truncation = s.tsdf->background()};
  try {
    s.info.upright = upright_of(*s.tsdf);
  } catch (const std::runtime_error& error) {
    throw no_map(file, error.what());
  }
  if (const BrickBox box = bounds(); !box.isEmpty() && (is_far(box.min()) || is_far(box.max())))
    throw no_map(file, kNowhere);
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
  const auto is_asked = [&](const Eigen::Vector3i& brick) { return !box || box->contains(brick); };
  std::vector<Leaf*> leaves;
  state_->tsdf->tree().getNodes(leaves);
  std::erase_if(leaves, [&](const Leaf* leaf) { return !is_asked(brick_at(leaf->origin())); });
  std::vector<Leaf*> weights;
  weights.reserve(leaves.size());
  for (const Leaf* leaf : leaves) weights.push_back(state_->weight->tree().probeLeaf(leaf->origin()));
  if (std::find(weights.begin(), weights.end(), nullptr) != weights.end())
    throw no_map(state_->file, "its grids do not cover the same bricks");
  for (std::size_t begin = 0; begin < leaves.size(); begin += kLeavesInMemory) {
    const std::size_t end = std::min(begin + kLeavesInMemory, leaves.size());
    try {
      tbb::parallel_for(begin, end, [&](std::size_t i) {  // loads and unpacks the leaves
        (void)std::as_const(*leaves[i]).buffer().data();
        (void)std::as_const(*weights[i]).buffer().data();
      });
    } catch (const std::exception& error) {
      throw no_map(state_->file, shown(error.what()));
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
    if (is_asked(brick) && state_->tsdf->tree().probeConstLeaf(origin_of(brick)) == nullptr)
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

ReadGrids read_grids(const std::filesystem::path& file) {
  initialize_once();
  const auto wrong = [&](const std::string& why) { return no_map(file, why); };
  openvdb::GridBase::Ptr base[4], free, sigma;
  try {
    openvdb::io::File in(file.string());
    in.open(false);
    constexpr const char* kNames[4] = {"tsdf", "weight", "colour", "colour_weight"};
    for (int i = 0; i < 4; ++i) base[i] = in.readGrid(kNames[i]);
    if (in.hasGrid("free")) free = in.readGrid("free");
    if (in.hasGrid("sigma")) sigma = in.readGrid("sigma");
  } catch (const std::exception& error) {  // from OpenVDB, or bad_alloc for a size in a corrupt file
    throw wrong(shown(error.what()));
  }
  const auto tsdf = openvdb::gridPtrCast<openvdb::FloatGrid>(base[0]);
  const auto weight = openvdb::gridPtrCast<openvdb::FloatGrid>(base[1]);
  const auto colour = openvdb::gridPtrCast<openvdb::Vec3SGrid>(base[2]);
  auto colour_weight = openvdb::gridPtrCast<openvdb::FloatGrid>(base[3]);
  if (const auto whole = openvdb::gridPtrCast<openvdb::Int32Grid>(base[3]))  // format of version 0.2
    colour_weight = std::make_shared<openvdb::FloatGrid>(*whole);
  if (!tsdf || !weight || !colour || !colour_weight) throw wrong("a grid has another type");
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
    if (is_far(brick_at(at))) throw wrong(kNowhere);
    const auto* w = weight->tree().probeConstLeaf(at);
    const auto* c = colour->tree().probeConstLeaf(at);
    const auto* n = colour_weight->tree().probeConstLeaf(at);
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
                    std::to_string(where.z()) + " holds a value that is out of range or not a number");
      }
      auto colour_word = static_cast<std::uint32_t>(std::lround(n->getValue(i))) << 24;
      for (int k = 0; k < 3; ++k) colour_word |= static_cast<std::uint32_t>(std::lround(rgb[k] * 255.0f)) << (8 * k);
      voxels[i] = shader::pack_voxel(leaf->getValue(i) / result.info.truncation, w->getValue(i), colour_word);
    }
    result.tree.put(brick_at(at), voxels);
  }
  read_free(file, free, *tsdf, result.tree);
  return result;
}

}  // namespace cairn
