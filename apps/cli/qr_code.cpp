// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/qr_code.hpp"

#include <qrencode.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <string_view>

namespace cairn::apps {
namespace {

constexpr int kMargin = 2;  // modules of the light quiet zone

/// Checks the first locale variable that is set, in the order of the C library.
bool is_utf8() {
  for (const char* variable : {"LC_ALL", "LC_CTYPE", "LANG"})
    if (const char* value = std::getenv(variable); value != nullptr && value[0] != '\0') {
      const std::string_view name(value);
      return name.find("UTF-8") != name.npos || name.find("utf8") != name.npos;
    }
  return false;
}

bool is_set(const char* variable) {
  const char* value = std::getenv(variable);
  return value != nullptr && value[0] != '\0';
}

}  // namespace

std::string qr_code(const std::string& text, bool is_colored) {
  const std::unique_ptr<QRcode, void (*)(QRcode*)> code(QRcode_encodeString8bit(text.c_str(), 0, QR_ECLEVEL_L),
                                                        QRcode_free);
  if (!code) throw std::runtime_error("the address does not fit into a QR code");
  const auto is_light = [&](int x, int y) {
    const bool is_in = x >= 0 && y >= 0 && x < code->width && y < code->width;
    return !is_in || (code->data[y * code->width + x] & 1) == 0;
  };
  std::string lines;
  for (int y = -kMargin; y < code->width + kMargin; y += 2) {
    if (is_colored) lines += "\x1b[97;40m";  // light modules are drawn in white
    for (int x = -kMargin; x < code->width + kMargin; ++x) {
      const bool upper = is_light(x, y), lower = is_light(x, y + 1) && y + 1 < code->width + kMargin;
      lines += upper && lower ? "█" : upper ? "▀" : lower ? "▄" : " ";
    }
    if (is_colored) lines += "\x1b[0m";
    lines += '\n';
  }
  return lines;
}

std::optional<std::string> qr_code_for_terminal(const std::string& text) {
  winsize size{};
  if (isatty(STDERR_FILENO) == 0 || ioctl(STDERR_FILENO, TIOCGWINSZ, &size) != 0 || !is_utf8()) return std::nullopt;
  if (const char* term = std::getenv("TERM"); term == nullptr || std::string_view(term) == "dumb") return std::nullopt;
  const std::string plain = qr_code(text, false);
  const std::size_t columns = plain.find('\n') / 3;  // light first line: blocks of three bytes each
  if (size.ws_col < columns) return std::nullopt;
  return is_set("NO_COLOR") ? plain : qr_code(text, true);
}

}  // namespace cairn::apps
