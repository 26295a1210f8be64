// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string>
#include <string_view>

namespace cairn {

/// A gzip file (RFC 1952) of these bytes, always the same.
[[nodiscard]] std::string gzip(std::string_view bytes);

}  // namespace cairn
