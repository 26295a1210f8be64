// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Options shared by `view` and `live --view`: the address of the page, and help to open it.
#pragma once
#include <CLI/CLI.hpp>
#include <functional>
#include <memory>

#include "cairn/mapping/viewer.hpp"
#include "cli/browser.hpp"

namespace cairn::apps {

struct ViewArguments {
  ViewerAddress at;
  bool open = false;
};

/// `needs`: option required by these options, or null.
void add_view_options(CLI::App& command, ViewArguments& a, CLI::Option* needs = nullptr);

/// Prints below the address who can open the page and how, on stderr, with a QR code if the terminal has room.
/// `permission`: permissions of anyone with the address. Opens a browser if requested, else returns null. `is_opened`:
/// true after a browser has loaded the page.
[[nodiscard]] std::unique_ptr<BrowserPage> announce_page(const ViewArguments& a, const ViewerSite& site,
                                                         const char* permission, std::function<bool()> is_opened);

}  // namespace cairn::apps
