// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Items of a verdict: quality measures of a finished map, with limits and texts.
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "cairn/eval/verdict.hpp"
#include "eval/map_agreement.hpp"
#include "eval/pose_agreement.hpp"
#include "eval/speeds.hpp"
#include "eval/still_view.hpp"

namespace cairn {

/// A measure without frames, pairs, windows or steps was not computed.
struct Measured {
  DepthAgreement fused, held_out;  // frames of the map, and held-out frames
  StillView still;
  Speeds speeds;
  PoseAgreement device;
  std::optional<double> with_color;  // share of the frames
  std::string upright_unknown;       // see RunSummary
};

/// Share of the frames in the map, with the limits of the verdict's levels.
[[nodiscard]] Verdict::Item frames_item(double in_map, const RunSummary& outcome);
/// Items of the verdict, the most explanatory first.
[[nodiscard]] std::vector<Verdict::Item> items_of(const Measured& measured);

}  // namespace cairn
