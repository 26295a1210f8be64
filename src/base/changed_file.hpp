// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <string_view>

#include "base/atomic_file.hpp"

namespace cairn {

/// Writes a text file atomically, unless it already has this content: then it keeps its timestamp, for tools that
/// compare times. Returns true if it was written. Throws as write_whole does.
bool write_changed(const std::filesystem::path& file, std::string_view text, Durable durable = Durable::now);

}  // namespace cairn
