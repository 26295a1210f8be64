// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string>

namespace cairn::apps {

/// "cairn 0.2.0 (commit)".
std::string version_line();
/// Information for fault reports: compiler, build options, devices and drivers, libraries, and session formats.
std::string version_in_full(int columns);

}  // namespace cairn::apps
