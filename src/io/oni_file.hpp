// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>

namespace cairn {

/// Walks through the records of an .oni file before OpenNI2 does, which believes every size and name in it. Throws
/// std::runtime_error with the place of what cannot be; a file that just ends early is fine.
void check_oni(const std::filesystem::path& file);

}  // namespace cairn
