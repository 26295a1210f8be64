// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>

#include "map/atlas.hpp"

namespace cairn {

/// Writes an SVG of the main component from above: tracked and corrected trajectory, and loops. Atomic.
void write_graph_picture(const std::filesystem::path& file, const Atlas& atlas);

}  // namespace cairn
