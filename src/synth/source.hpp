// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "cairn/mapping/frame.hpp"
#include "cairn/synthetic/synthetic.hpp"

namespace cairn {

inline constexpr std::string_view kSynthetic = "synthetic:";  // prefix of a scene's name, as a source

struct SyntheticOptions {
  std::string scene = "room";  // see synthetic_scene; `?noise=kinect`, or another kind of add_noise, adds noise
  int first = 0;               // index of the first frame
  std::optional<int> frames;   // index after the last frame; none: the entire path of a building, 300 frames of other
                               // scenes
  int step = 1;                // every step-th frame
  int device = -1;
};

/// Scene rendered on the fly, on its own device. Throws std::runtime_error for an unknown scene or noise.
[[nodiscard]] std::unique_ptr<Source> open_synthetic(const SyntheticOptions& options);

/// Throws std::runtime_error for a kind unknown to add_noise.
void check_noise(std::string_view kind);

/// True poses of a scene's frames; the first ten seconds of a scene without an end.
[[nodiscard]] Trajectory synthetic_truth(const std::string& scene);

}  // namespace cairn
