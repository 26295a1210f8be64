// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Recordings of several cameras in one map, which knows one.
#pragma once
#include <memory>

#include "cairn/source.hpp"

namespace cairn {

/// The frames as the cameras of another rig would have taken them in their place: each of its pixels shows what the
/// images show on its ray, and has no depth beyond them. Depth is corrected as its own rig says, and what its own model
/// drops is dropped; how much the rest counts is then told by the other one's. Throws std::runtime_error with why where
/// images alone do not tell it: for other shutters, and colour cameras in other places.
[[nodiscard]] std::unique_ptr<Source> as_taken_by(std::unique_ptr<Source> source, const Rig& rig);

}  // namespace cairn
