// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Random tokens for access to a server.
#pragma once
#include <string>
#include <string_view>

namespace cairn {

/// 128 random bits in 32 hexadecimal digits.
[[nodiscard]] std::string random_token();

/// Constant-time comparison, so that a token cannot be guessed letter by letter.
[[nodiscard]] bool is_same_token(std::string_view a, std::string_view b);

}  // namespace cairn
