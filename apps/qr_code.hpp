// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <optional>
#include <string>

namespace cairn::apps {

/// A QR code (ISO/IEC 18004) of a text in lines of half blocks. `is_coloured`: black on white whatever the terminal's
/// colours are, else what is light is drawn, for a dark one.
[[nodiscard]] std::string qr_code(const std::string& text, bool is_coloured);

/// The same for the terminal behind stderr; nothing where there is none that shows it, or it is too narrow.
[[nodiscard]] std::optional<std::string> qr_code_for_terminal(const std::string& text);

}  // namespace cairn::apps
