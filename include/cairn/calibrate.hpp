// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <optional>

#include "cairn/frame.hpp"

namespace cairn {

/// Finds the colour camera of a sensor from what it saw, without knowing where it stood: where depth jumps, colour
/// mostly has an edge too (as Levinson & Thrun 2013 lay a laser over a camera). Turn, place and focal length are
/// searched near what source.rig() promises: 4 degrees, 12 cm and a fifth of the length to each side; the principal
/// point and the lens are taken as they are.
///
/// `frames` of the source, spread over all of it, are read; those before them are passed over. Nothing where the rig
/// promised is about as good, or where too few edges are seen. The same frames give the same rig.
[[nodiscard]] std::optional<Rig> find_colour_camera(Source& source, int frames = 40);

}  // namespace cairn
