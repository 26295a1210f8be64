// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <string>

namespace cairn::apps {

/// Opens a page in the user's browser: $BROWSER, or what the desktop takes. Says on stderr where there is none; the
/// work goes on in any case.
void open_browser(const std::string& url);

}  // namespace cairn::apps
