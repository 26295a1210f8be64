// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>

#include "map/atlas.hpp"

namespace cairn {

/// An SVG of the main piece from above: the way as tracked and as corrected, and the loops. Whole or not at all.
void write_graph_picture(const std::filesystem::path& file, const Atlas& atlas);

}  // namespace cairn
