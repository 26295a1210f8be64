// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Files that are whole or not there: the one door for finished files.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <ostream>
#include <span>
#include <string_view>

namespace cairn {

/// Whether a file must be on the disk when its writer returns, so that a power cut cannot take it away any more.
enum class Durable { now, some_time };

/// Writes a file whole or not at all: `write` fills a temporary one beside it, which is then renamed. Throws
/// std::runtime_error with the path, the system's reason and what to do; the temporary file is gone then. `write` need
/// not look after errors of its stream.
void write_whole(const std::filesystem::path& file, const std::function<void(std::ostream&)>& write);
/// The same for what is in memory.
void write_whole(const std::filesystem::path& file, std::span<const std::uint8_t> bytes,
                 Durable durable = Durable::now);
void write_whole(const std::filesystem::path& file, std::string_view text, Durable durable = Durable::now);

/// Makes a folder whole or not at all: `write` fills an empty one of that name in a new folder of the program's own
/// beside it, whose place it takes; until then, and where anything fails, what was there stays. Throws
/// std::runtime_error, before `write` is called where it holds something, unless it is replaceable: has a file `mark`.
void write_folder(const std::filesystem::path& folder, const std::function<void(const std::filesystem::path&)>& write,
                  const char* mark = nullptr);

/// Removes temporary files and marked folders that killed programs have left in a folder; those of living ones stay.
void remove_leftovers(const std::filesystem::path& folder);

/// Brings what was made, renamed and removed in a folder to the disk. Throws std::runtime_error.
void sync_folder(const std::filesystem::path& folder);

}  // namespace cairn
