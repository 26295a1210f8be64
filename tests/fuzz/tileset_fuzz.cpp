// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// tileset.json, as served by the viewer and as read for parent tiles.
#include <spdlog/spdlog.h>

#include "fuzz.hpp"
#include "mesh/tiles.hpp"
#include "view/served_tileset.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  spdlog::set_level(spdlog::level::off);
  const auto file = fuzz::file_of("tileset.json", fuzz::text_of(data, size));
  fuzz::expect_value_or_plain_error([&] { (void)read_tileset_file(file); });
  fuzz::expect_value_or_plain_error([&] {
    const auto files = served_tileset(file, [](const auto&) {});
    for (const auto& [name, served] : files)
      if (const auto* made = std::get_if<Make>(&served.body)) (void)made->make();
  });
  return 0;
}
