// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string>

namespace cairn::apps {

/// "cairn 0.2.0 (commit)".
std::string version_line();
/// What a report of a fault should tell as well: the compiler, what was built in, devices and their drivers, libraries,
/// and the formats of sessions.
std::string version_in_full(int columns);

}  // namespace cairn::apps
