// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/console.hpp"

#include <spdlog/sinks/ansicolor_sink.h>
#include <spdlog/spdlog.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <mutex>
#include <sstream>

namespace cairn::apps {
namespace {

constexpr int kMinColumns = 20, kMaxColumns = 1000;

bool quiet = false;

std::mutex line_mutex;  // other threads print warnings, too
bool line_is_shown = false;

std::string_view environment_variable(const char* name) {
  const char* value = std::getenv(name);
  return value != nullptr ? value : "";
}

/// The first variable that is set decides, as in the C library.
bool locale_is_utf8() {
  for (const char* name : {"LC_ALL", "LC_CTYPE", "LANG"})
    if (const std::string_view value = environment_variable(name); !value.empty())
      return value.find("UTF-8") != value.npos || value.find("utf8") != value.npos || value.find("utf-8") != value.npos;
  return false;
}

int columns_of(int descriptor) {
  winsize size{};
  if (ioctl(descriptor, TIOCGWINSZ, &size) == 0 && size.ws_col > 0) return size.ws_col;
  const int columns = std::atoi(std::string(environment_variable("COLUMNS")).c_str());
  return columns > 0 ? columns : 80;
}

/// Clears the progress line before each warning.
class StderrSink final : public spdlog::sinks::ansicolor_stderr_sink_mt {
 public:
  explicit StderrSink(spdlog::color_mode colors) : ansicolor_stderr_sink(colors) {}
  void log(const spdlog::details::log_msg& message) override {
    apps::clear_line();
    ansicolor_stderr_sink::log(message);
  }
};

}  // namespace

Terminal terminal_of(int descriptor) {
  Terminal terminal;
  terminal.is_live =
      isatty(descriptor) != 0 && environment_variable("TERM") != "dumb" && !environment_variable("TERM").empty();
  terminal.has_colors = terminal.is_live && environment_variable("NO_COLOR").empty();
  terminal.has_blocks = locale_is_utf8();
  terminal.columns = std::clamp(columns_of(descriptor), kMinColumns, kMaxColumns);
  return terminal;
}

int width_of(std::string_view text) {
  return static_cast<int>(std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xc0) != 0x80; }));
}

std::string cut_to(std::string text, int columns, bool has_blocks) {
  if (width_of(text) <= columns) return text;
  const std::string ellipsis = has_blocks ? "…" : "...";
  int left = std::max(0, columns - width_of(ellipsis));
  std::size_t end = 0;
  while (end < text.size() && (left > 0 || (text[end] & 0xc0) == 0x80)) left -= (text[end++] & 0xc0) != 0x80;
  return text.substr(0, end) + ellipsis;
}

std::string wrapped(const std::string& text, int at, int indent, int columns) {
  std::istringstream words(text);
  std::string lines, word;
  bool is_first = true;
  while (words >> word) {
    if (!is_first && at + 1 + width_of(word) > columns) {
      lines += '\n' + std::string(static_cast<std::size_t>(indent), ' ');
      at = indent;
      is_first = true;
    }
    lines += (is_first ? "" : " ") + word;
    at += width_of(word) + !is_first;
    is_first = false;
  }
  return lines;
}

void set_quiet() { quiet = true; }
bool is_quiet() { return quiet; }

void set_up_warnings() {
  const auto colors = terminal_of(STDERR_FILENO).has_colors ? spdlog::color_mode::always : spdlog::color_mode::never;
  spdlog::set_default_logger(std::make_shared<spdlog::logger>("cairn", std::make_shared<StderrSink>(colors)));
  spdlog::set_pattern("%^%l%$ %v");
}

void show_line(const std::string& line) {
  const std::lock_guard lock(line_mutex);
  fmt::print(stderr, "\r{}\x1b[K", line);
  std::fflush(stderr);
  line_is_shown = true;
}

void clear_line() {
  const std::lock_guard lock(line_mutex);
  if (line_is_shown) fmt::print(stderr, "\r\x1b[K");
  line_is_shown = false;
}

std::string format_size(std::uint64_t bytes) {
  if (bytes < 1000) return fmt::format("{} bytes", bytes);
  auto size = static_cast<double>(bytes);
  const char* unit = "";
  for (const char* larger : {"kB", "MB", "GB", "TB", "PB"}) {
    if (size < 999.5) break;
    size /= 1000;
    unit = larger;
  }
  return fmt::format("{:.{}f} {}", size, size < 99.95 ? 1 : 0, unit);
}

std::string format_count(std::uint64_t count) {
  const std::string digits = std::to_string(count);
  std::string text;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    if (i > 0 && (digits.size() - i) % 3 == 0) text += ',';
    text += digits[i];
  }
  return text;
}

}  // namespace cairn::apps
