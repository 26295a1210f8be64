// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The values that options may have, for programs that check them where they are typed.
#pragma once
#include <string_view>

#include "cairn/quantity.hpp"

namespace cairn {

/// Of Options, by the name in the YAML file: `fuse.voxel_size`. Throws std::logic_error for another name.
[[nodiscard]] AllowedRange range_of(std::string_view option);
/// Of the options of an export, a plan or a change, by their names in C++: `CleanOptions::min_piece`. Throws
/// std::logic_error for another name.
[[nodiscard]] AllowedRange export_range_of(std::string_view option);

}  // namespace cairn
