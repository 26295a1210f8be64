// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "cairn/frame.hpp"
#include "cairn/synthetic.hpp"

namespace cairn {

struct SyntheticOptions {
  std::string scene = "room";
  int first = 0, frames = 300;  // from the first to the one before frame number `frames`,
  int step = 1;                 // every step-th
  bool kinect_noise = false;
  std::uint64_t seed = 1;
  bool with_poses = false;  // frames carry their true pose
  int device = -1;
};

/// A scene rendered on the fly, on a device of its own. Throws std::runtime_error for an unknown scene.
[[nodiscard]] std::unique_ptr<Source> open_synthetic(const SyntheticOptions& options);

}  // namespace cairn
