// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What people see of the program: lines on stdout, progress and warnings on stderr.
#pragma once
#include <fmt/format.h>

#include <cstdio>
#include <string>
#include <string_view>
#include <utility>

namespace cairn::apps {

/// Where lines go that a person reads.
struct Terminal {
  bool is_live = false;      ///< a terminal whose lines can be written again: not TERM=dumb
  bool has_colours = false;  ///< such a terminal without NO_COLOR (no-color.org)
  bool has_blocks = false;   ///< characters beyond ASCII, by the locale
  int columns = 80;          ///< as the terminal says, or COLUMNS
};
/// As it is now: a window may have changed.
[[nodiscard]] Terminal terminal_of(int descriptor);

/// Characters that a text takes on a terminal; UTF-8, no wide ones.
[[nodiscard]] int width_of(std::string_view text);
/// The text in so many columns, with an ellipsis where it was longer.
[[nodiscard]] std::string cut_to(std::string text, int columns, bool has_blocks);

constexpr int kNarrow = 60;  ///< columns: below, texts stand under their names
/// The words in lines of so many columns that begin at `indent`; the first of them at `at`.
[[nodiscard]] std::string wrapped(const std::string& text, int at, int indent, int columns);

/// With --quiet: no progress and no words about what was made. Warnings, errors and what was asked for with --json
/// stay.
void be_quiet();
[[nodiscard]] bool is_quiet();

/// A line for people about what was made, on stdout; nothing with --quiet.
template <class... Values>
void say(fmt::format_string<Values...> format, Values&&... values) {
  if (!is_quiet()) fmt::print(format, std::forward<Values>(values)...);
}

/// Sends warnings to stderr, coloured where it is a terminal, each on a line of its own.
void set_up_warnings();

/// The line that progress shows now and that others must not be written into.
void show_line(const std::string& line);
void clear_line();

/// "812 bytes", "3.4 kB", "12.3 MB": decimal, as file managers tell it.
[[nodiscard]] std::string size_in_words(std::uint64_t bytes);
/// "84,210".
[[nodiscard]] std::string count_in_words(std::uint64_t count);

}  // namespace cairn::apps
