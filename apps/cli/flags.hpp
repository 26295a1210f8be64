// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string>

namespace cairn::apps {

/// Replaces option field names in a library message with the program's flags.
[[nodiscard]] std::string with_flag_names(std::string message);

}  // namespace cairn::apps
