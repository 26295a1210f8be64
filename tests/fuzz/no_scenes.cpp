// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Scenes are rendered on the device, which is not fuzzed: here no name is that of one.
#include "cairn/source.hpp"
#include "synth/source.hpp"

namespace cairn {

bool is_synthetic(std::string_view) { return false; }
Trajectory synthetic_truth(const std::string&) { return {}; }

}  // namespace cairn
