// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Atomic writes: a finished file is complete or absent. All output files are written by these functions.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <ostream>
#include <span>
#include <string_view>

namespace cairn {

/// Durability of a file when its writer returns: `now` has synced it to the disk, so a power failure cannot lose it.
enum class Durable { now, some_time };

/// Writes a file atomically: `write` fills a temporary file in the same folder, which is then renamed. Throws
/// std::runtime_error with the path, the system's reason and the remedy, after removing the temporary file. `write`
/// need not check its stream for errors.
void write_whole(const std::filesystem::path& file, const std::function<void(std::ostream&)>& write);
/// Writes bytes or text from memory, also atomically.
void write_whole(const std::filesystem::path& file, std::span<const std::uint8_t> bytes,
                 Durable durable = Durable::now);
void write_whole(const std::filesystem::path& file, std::string_view text, Durable durable = Durable::now);

/// Creates a folder atomically: `write` fills an empty folder of the same name inside a new temporary folder next to
/// `folder`, then the two are swapped. Until then, and after any error, the old content stays. Throws
/// std::runtime_error before calling `write` if `folder` is not empty, unless it contains a file `mark` and may be
/// replaced.
void write_folder(const std::filesystem::path& folder, const std::function<void(const std::filesystem::path&)>& write,
                  const char* mark = nullptr);

/// Removes temporary files and marked folders left in `folder` by killed programs. Files of running programs stay.
void remove_leftovers(const std::filesystem::path& folder);

/// Flushes files created, renamed and removed in a folder to the disk. Throws std::runtime_error.
void sync_folder(const std::filesystem::path& folder);

}  // namespace cairn
