// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <optional>
#include <string>

namespace cairn::apps {

/// QR code (ISO/IEC 18004) of a text, in lines of half blocks. `is_colored`: black on white with terminal colors; else
/// light modules are drawn, for a dark terminal.
[[nodiscard]] std::string qr_code(const std::string& text, bool is_colored);

/// QR code for the terminal behind stderr. Empty without a suitable terminal, or if it is too narrow.
[[nodiscard]] std::optional<std::string> qr_code_for_terminal(const std::string& text);

}  // namespace cairn::apps
