// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string>

namespace cairn::apps {

/// A message of the library, which names the fields of its options, with the program's flags in their place.
[[nodiscard]] std::string in_flags(std::string message);

}  // namespace cairn::apps
