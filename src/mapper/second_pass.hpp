// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Second pass over a recording after its keyframes were adjusted: fuses the keyframes first, and tracks the frames
// between them against this map.
#pragma once
#include <functional>

#include "mapper/map_state.hpp"

namespace cairn {

/// Implements Mapper::reintegrate. Returns true if the map was replaced.
[[nodiscard]] bool reintegrate(MapState& state, Source& source, const DepthCorrection& correction,
                               const std::function<bool(int)>& progress);

}  // namespace cairn
