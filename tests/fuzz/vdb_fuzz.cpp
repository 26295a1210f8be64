// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// OpenVDB files: submaps of sessions, map.vdb, distances.
#include "cairn/mapping/esdf.hpp"
#include "fuzz.hpp"
#include "volume/vdb/brick_file.hpp"
#include "volume/vdb/map_vdb.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file = fuzz::file_of("a.vdb", fuzz::text_of(data, size));
  const auto touch = [](const BrickTree& tree) {
    for (const auto& brick : tree.bricks()) fuzz::touch(std::span(tree.find(brick), 512));
    (void)tree.free_bricks();
  };
  fuzz::expect_value_or_plain_error([&] { touch(BrickFile(file).read()); });
  fuzz::expect_value_or_plain_error([&] { touch(read_grids(file).tree); });
  fuzz::expect_value_or_plain_error(
      [&] { MapFile(file).visit([](const auto&, const MapFile::Voxels& voxels) { fuzz::touch(voxels.distances); }); });
  fuzz::expect_value_or_plain_error([&] {
    const DistanceField field = DistanceField::read(file);
    for (const auto& [at, samples] : field.blocks()) fuzz::touch(*samples);
  });
  return 0;
}
