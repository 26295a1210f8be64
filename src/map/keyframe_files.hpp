// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string_view>

namespace cairn {

/// True if `name` is a file name of a KeyframeStore.
[[nodiscard]] bool is_keyframe_file(std::string_view name);

}  // namespace cairn
