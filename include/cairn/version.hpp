// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string_view>

namespace cairn {

/// Version of the library; CMake's PROJECT_VERSION.
inline constexpr int kVersionMajor = 0, kVersionMinor = 2, kVersionPatch = 0;
inline constexpr std::string_view kVersion = "0.2.0";

}  // namespace cairn
