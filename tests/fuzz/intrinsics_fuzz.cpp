// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Camera file beside images, with the extension chosen by the first byte.
#include "fuzz.hpp"
#include "io/intrinsics.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr const char* kNames[] = {"intrinsics.json", "intrinsics.txt", "intrinsics.yaml"};
  if (size == 0) return 0;
  const auto file = fuzz::file_of(kNames[data[0] % 3], fuzz::text_of(data + 1, size - 1));
  fuzz::expect_value_or_plain_error([&] {
    const CameraFile read = read_intrinsics(file).camera;
    if (read.has_size && !read.rig.depth.ray(0, 0).allFinite()) std::abort();
    if (read.depth_scale && !(*read.depth_scale > 0)) std::abort();
  });
  return 0;
}
