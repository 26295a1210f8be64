// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/gzip.hpp"
#include "cairn/mapping/splats.hpp"
#include "fuzz.hpp"

namespace {

void read(const char* name, std::string_view bytes) {
  const auto file = cairn::fuzz::file_of(name, bytes);
  cairn::fuzz::expect_value_or_plain_error([&] {
    const cairn::Splats splats = cairn::read_splats(file);
    const std::size_t count = splats.size();
    if (splats.log_scales.size() != count || splats.rotations.size() != count || splats.opacities.size() != count ||
        splats.colors.size() != count || splats.harmonics.size() != count * cairn::harmonics_per_splat(splats.degree))
      std::abort();
  });
}

}  // namespace

/// The first byte selects a .ply, a .spz, or the content of a .spz before compression.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view bytes = cairn::fuzz::text_of(data + 1, size - 1);
  if (data[0] % 3 == 0)
    read("splats.ply", bytes);
  else
    read("splats.spz", data[0] % 3 == 1 ? std::string(bytes) : cairn::gzip(bytes));
  return 0;
}
