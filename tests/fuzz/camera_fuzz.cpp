// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "fuzz.hpp"
#include "io/camera_file.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file = fuzz::file_of("camera.yaml", fuzz::text_of(data, size));
  fuzz::expect_value_or_plain_error([&] {
    const CameraFile read = read_camera_file(file);
    if (!read.rig.depth.ray(0, 0).allFinite() || (read.depth_scale && !(*read.depth_scale > 0))) std::abort();
    if (read.rig.color && !read.rig.color->color_from_depth.matrix().allFinite()) std::abort();
  });
  return 0;
}
