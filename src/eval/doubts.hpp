// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Measurements of a finished map, with their limits and words.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "cairn/verdict.hpp"
#include "eval/map_agreement.hpp"
#include "eval/pose_agreement.hpp"
#include "eval/speeds.hpp"
#include "eval/still_view.hpp"

namespace cairn {

/// Without frames, pairs, windows or steps: not measured.
struct Measured {
  DepthAgreement fused, held_out;  // frames of the map, and frames that it has never seen
  StillView still;
  Speeds speeds;
  PoseAgreement device;
  std::optional<double> with_color;  // share of the frames
  std::string upright_unknown;       // see Outcome
};

/// Share of the frames in the map, by the levels' own limits.
[[nodiscard]] Verdict::Item frames_item(double in_map, const Outcome& outcome);
/// What was measured: what explains most comes first.
[[nodiscard]] std::vector<Verdict::Item> items_of(const Measured& measured);

}  // namespace cairn
