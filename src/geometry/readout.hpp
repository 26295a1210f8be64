// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <utility>

#include "cairn/mapping/rig.hpp"

namespace cairn {

[[nodiscard]] inline bool is_rolling(const Rig& rig) { return rig.depth.readout > 0 || rig.color_view().readout > 0; }
/// Rig with this readout of both cameras, seconds.
[[nodiscard]] inline Rig with_readout(Rig rig, double readout) {
  rig.depth.readout = readout;
  if (rig.color) rig.color->camera.readout = readout;
  return rig;
}
/// Rig for images after rolling shutter correction.
[[nodiscard]] inline Rig with_global_shutter(Rig rig) { return with_readout(std::move(rig), 0); }

}  // namespace cairn
