// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <string_view>

#include "cairn/atomic_file.hpp"

namespace cairn {

/// Writes a text file, whole or not at all, unless it holds the same already: then it is not touched, so that programs
/// that go by times see that nothing is new. Returns whether it was written. Throws like write_whole.
bool write_changed(const std::filesystem::path& file, std::string_view text, Durable durable = Durable::now);

}  // namespace cairn
