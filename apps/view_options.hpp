// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What `view` and `live --view` share: where the page is served, and how people get there.
#pragma once
#include <CLI/CLI.hpp>
#include <functional>
#include <memory>

#include "browser.hpp"
#include "cairn/viewer.hpp"

namespace cairn::apps {

struct ViewArguments {
  ViewerAddress at;
  bool open = false;
};

/// `needs`: an option without which these have no meaning, or null.
void add_view_options(CLI::App& command, ViewArguments& a, CLI::Option* needs = nullptr);

/// Tells on stderr, below the address, who can open it and how; as a QR code, too, where the terminal has room for one.
/// `they_can`: what anyone with the address can do. Opens a browser, if that is asked for; else it returns null.
/// `is_opened`: whether one has loaded the page.
[[nodiscard]] std::unique_ptr<BrowserPage> tell_how_to_open(const ViewArguments& a, const ViewerSite& site,
                                                            const char* they_can, std::function<bool()> is_opened);

}  // namespace cairn::apps
