// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string>

namespace cairn::apps {

/// Replaces option field names in a library message with the program's flags.
[[nodiscard]] std::string in_flags(std::string message);

}  // namespace cairn::apps
