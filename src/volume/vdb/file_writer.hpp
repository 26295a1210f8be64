// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// File writer: OpenVDB grids, packed on all cores. Included in this folder only.
#pragma once
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/openvdb.h>
#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <ostream>
#include <sstream>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/atomic_file.hpp"

namespace cairn::vdb {

inline constexpr std::uint32_t kCompression = openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK;
inline constexpr std::size_t kLeavesAtOnce = 256;  // packed per thread
inline constexpr std::size_t kPacksAtOnce = 8;     // queued for output

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

}  // namespace cairn::vdb
