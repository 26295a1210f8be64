// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "cairn/frame.hpp"
#include "cairn/synthetic.hpp"

namespace cairn {

inline constexpr std::string_view kSynthetic = "synthetic:";  // before a scene's name, as a source

struct SyntheticOptions {
  std::string scene = "room";  // see synthetic_scene; with `?noise=kinect`, or another kind of add_noise, it has noise
  int first = 0;               // from the first
  std::optional<int> frames;   // to the one before this number; none: of a building its whole way, of others 300
  int step = 1;                // every step-th
  int device = -1;
};

/// A scene rendered on the fly, on a device of its own. Throws std::runtime_error for an unknown scene or noise.
[[nodiscard]] std::unique_ptr<Source> open_synthetic(const SyntheticOptions& options);

/// Throws std::runtime_error for a noise that add_noise does not know.
void check_noise(std::string_view kind);

/// Where its frames are taken; of a scene that has no end the first ten seconds.
[[nodiscard]] Trajectory synthetic_truth(const std::string& scene);

}  // namespace cairn
