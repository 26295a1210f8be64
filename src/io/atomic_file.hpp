// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <functional>

namespace cairn {

/// Writes a file whole or not at all: `write` fills a temporary one beside it, which is then renamed. Throws
/// std::runtime_error with the path and what to do; the temporary file is gone then.
void write_whole(const std::filesystem::path& file,
                 const std::function<void(const std::filesystem::path& temporary)>& write);

}  // namespace cairn
