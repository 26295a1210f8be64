// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/camera.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

namespace cairn {
namespace {

constexpr int kLeastSide = 16, kMostSide = 4096;  // pixels: three levels of the pyramid, 128 MiB of fusion image
constexpr double kWidest = 1.0 / 20,
                 kNarrowest = 20;         // focal length / larger side: fields of view of 169 and 2.9 degrees
constexpr double kMostDistortion = 1000;  // of a coefficient: twenty times those of fisheye-like calibrations

void within(const char* name, double value, double least, double most) {
  if (!(value >= least && value <= most))  // NaN, too
    throw std::runtime_error(
        fmt::format("the camera's {} is {}, allowed is {} to {}: check the intrinsics", name, value, least, most));
}

}  // namespace

void check(const Camera& c) {
  within("width", c.width, kLeastSide, kMostSide);
  within("height", c.height, kLeastSide, kMostSide);
  const double side = std::max(c.width, c.height);
  within("fx", c.fx, kWidest * side, kNarrowest * side);
  within("fy", c.fy, kWidest * side, kNarrowest * side);
  within("cx", c.cx, -c.width, 2.0 * c.width);
  within("cy", c.cy, -c.height, 2.0 * c.height);
  for (const double d : c.distortion) within("distortion", d, -kMostDistortion, kMostDistortion);
}

}  // namespace cairn
