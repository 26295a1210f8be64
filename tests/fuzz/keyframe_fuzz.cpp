// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Files of a keyframe in a session: corners and images.
#include "fuzz.hpp"
#include "map/keyframe.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes = fuzz::text_of(data, size);
  for (const char* name : {"000000.corners", "000000.depth.png", "000000.colour.jpg"}) fuzz::file_of(name, bytes);
  const KeyframeStore store(Camera{.width = 16, .height = 16}, fuzz::folder());
  fuzz::expect_value_or_plain_error([&] {
    const Features features = *store.features(0);
    for (const auto& point : features.points) fuzz::touch(point);
  });
  fuzz::expect_value_or_plain_error([&] {
    const Frame frame = store.get(0);
    fuzz::touch(frame.depth);
    fuzz::touch(frame.color);
  });
  return 0;
}
