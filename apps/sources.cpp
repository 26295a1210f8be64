// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "sources.hpp"

#include <fmt/format.h>

#include <array>
#include <boost/crc.hpp>
#include <span>

namespace cairn::apps {
std::filesystem::path tidy(const std::filesystem::path& path) {
  const auto whole = std::filesystem::weakly_canonical(std::filesystem::absolute(path));
  return whole.has_filename() ? whole : whole.parent_path();
}

std::string identity(const std::string& sequence, const std::filesystem::path& camera) {
  if (is_sensor(sequence) || is_synthetic(sequence)) return sequence;
  constexpr int kFrames = 3, kTries = 30;  // frames; readable ones among the first
  const auto source = open_source(sequence, {.range = {}, .camera = camera, .copy_to = {}});
  boost::crc_optimal<64, 0x42f0e1eba9ea3693u, ~0ull, ~0ull, true, true> sum;  // ECMA-182
  const auto take = [&](const auto& values) {
    sum.process_bytes(std::data(values), std::size(values) * sizeof(*std::data(values)));
  };
  const auto take_camera = [&](const Camera& c) {
    take(std::array{c.width, c.height, static_cast<int>(c.lens)});
    take(std::array{c.fx, c.fy, c.cx, c.cy});
    take(c.distortion);
  };
  take_camera(source->rig().depth);
  if (const auto& colour = source->rig().colour) {
    take_camera(colour->camera);
    const Eigen::Matrix4d pose = colour->colour_from_depth.matrix();
    take(std::span(pose.data(), 16));
  }
  for (int tried = 0, taken = 0; tried < kTries && taken < kFrames; ++tried) {
    const auto frame = source->next();
    if (!frame) break;
    if (frame->problem) continue;
    take(std::array{frame->timestamp});
    take(frame->depth);
    ++taken;
  }
  return fmt::format("recording {:016x}", sum.checksum());
}

}  // namespace cairn::apps
