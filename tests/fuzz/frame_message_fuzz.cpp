// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Messages of a network camera: size of the hello as little-endian uint16, the hello, and a frame. The frame is also
// read after a hello of the corpus.
#include "fuzz.hpp"
#include "io/sensors/frame_message.hpp"

using namespace cairn;

namespace {

HelloMessage small_hello() {
  HelloMessage hello;
  hello.rig.depth = {.width = 16, .height = 16, .fx = 16, .fy = 16, .cx = 7.5, .cy = 7.5};
  hello.rig.camera_from_imu = Eigen::Quaterniond::Identity();
  hello.poses.emplace();
  return hello;
}

void expect_usable(std::span<const std::uint8_t> bytes, const HelloMessage& hello, const FrameOrder& before) {
  fuzz::expect_value_or_plain_error([&] {
    const FrameMessage read = read_frame(bytes, hello, before);
    if (read.is_end) return;
    const auto pixels = [](const Camera& c) { return static_cast<std::size_t>(c.width * c.height); };
    const SensorImages& images = read.images;
    if (images.depth.size() != pixels(hello.rig.depth) || images.number <= before.number) std::abort();
    if (!images.color.empty() && images.color.size() != pixels(hello.rig.color_view())) std::abort();
    if (!images.confidence.empty() && images.confidence.size() != images.depth.size()) std::abort();
    for (const float z : images.depth)
      if (!(z >= 0 && z <= 1e38f)) std::abort();
    if (images.guess && !images.guess->matrix().allFinite()) std::abort();
    fuzz::touch(images.color);
    fuzz::touch(images.confidence);
  });
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  const std::span<const std::uint8_t> all(data + 2, size - 2);
  const auto split = std::min<std::size_t>(all.size(), data[0] | data[1] << 8);
  const auto frame = all.subspan(split);
  fuzz::expect_value_or_plain_error([&] {
    const HelloMessage hello = read_hello(all.first(split));
    constexpr int kMaxPixels = 1 << 16;  // for speed
    if (hello.rig.depth.width * hello.rig.depth.height <= kMaxPixels) expect_usable(frame, hello, {});
  });
  expect_usable(frame, small_hello(), {.number = 3, .timestamp = 0.5});
  return 0;
}
