// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Allowed ranges of options, for programs that validate user input.
#pragma once
#include <string_view>

#include "base/quantity.hpp"

namespace cairn {

/// Range of a member of Options, by its YAML name: `fuse.voxel_size`. Throws std::logic_error for an unknown name.
[[nodiscard]] AllowedRange range_of(std::string_view option);
/// Range of an export, plan or change option, by its C++ name: `CleanOptions::min_component`. Throws std::logic_error
/// for an unknown name.
[[nodiscard]] AllowedRange export_range_of(std::string_view option);

}  // namespace cairn
