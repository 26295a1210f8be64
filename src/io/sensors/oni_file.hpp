// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>

namespace cairn {

/// Validates the records of an .oni file before OpenNI2 reads it, because OpenNI2 trusts every size and name. Throws
/// std::runtime_error with the position of an invalid record; truncated files are accepted.
void check_oni(const std::filesystem::path& file);

}  // namespace cairn
