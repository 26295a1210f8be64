// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string>
#include <string_view>

namespace cairn {

/// Compresses bytes as a gzip file (RFC 1952), deterministically.
[[nodiscard]] std::string gzip(std::string_view bytes);

}  // namespace cairn
