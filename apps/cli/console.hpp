// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Terminal output: results on stdout, progress and warnings on stderr.
#pragma once
#include <fmt/format.h>

#include <cstdio>
#include <string>
#include <string_view>
#include <utility>

namespace cairn::apps {

/// Properties of the terminal behind a file descriptor.
struct Terminal {
  bool is_live = false;     ///< true for a terminal that can rewrite its lines, so not for TERM=dumb
  bool has_colors = false;  ///< true for a live terminal without NO_COLOR (no-color.org)
  bool has_blocks = false;  ///< true if the locale has characters beyond ASCII
  int columns = 80;         ///< width reported by the terminal, or COLUMNS
};
/// Queries the terminal on each call, since a window may be resized.
[[nodiscard]] Terminal terminal_of(int descriptor);

/// Width of a UTF-8 text in columns; wide characters are not supported.
[[nodiscard]] int width_of(std::string_view text);
/// Truncates the text to `columns`, with an ellipsis.
[[nodiscard]] std::string cut_to(std::string text, int columns, bool has_blocks);

constexpr int kNarrow = 60;  ///< columns: below this width, descriptions go under their names
/// Wraps text at `columns`. The first line starts at column `at`, the rest at `indent`.
[[nodiscard]] std::string wrapped(const std::string& text, int at, int indent, int columns);

/// Sets --quiet: no progress and no result lines. Warnings, errors and --json output remain.
void set_quiet();
[[nodiscard]] bool is_quiet();

/// Prints a result line on stdout, except with --quiet.
template <class... Values>
void print_result(fmt::format_string<Values...> format, Values&&... values) {
  if (!is_quiet()) fmt::print(format, std::forward<Values>(values)...);
}

/// Sends warnings to stderr, each on its own line, colored on a terminal.
void set_up_warnings();

/// Shows the progress line; clear_line() removes it before other output.
void show_line(const std::string& line);
void clear_line();

/// "812 bytes", "3.4 kB", "12.3 MB": decimal units, as in file managers.
[[nodiscard]] std::string format_size(std::uint64_t bytes);
/// "84,210".
[[nodiscard]] std::string format_count(std::uint64_t count);

}  // namespace cairn::apps
