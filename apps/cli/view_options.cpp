// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/view_options.hpp"

#include <fmt/format.h>

#include <utility>

#include "cli/qr_code.hpp"
#include "cli/quantity.hpp"

namespace cairn::apps {

void add_view_options(CLI::App& command, ViewArguments& a, CLI::Option* needs) {
  auto* port =
      add_number(command, "--port", a.at.port, {0, 65535}, "Port of the page; 0: any free port")->capture_default_str();
  auto* host = command.add_option("--host", a.at.host,
                                  "Also serve other devices, such as a phone: an IP address of this machine, or "
                                  "0.0.0.0 for all; encrypted [this machine only]");
  auto* open = command.add_flag("--open", a.open, "Open the page in a browser");
  if (needs != nullptr)
    for (CLI::Option* option : {port, host, open}) option->needs(needs);
}

std::unique_ptr<BrowserPage> announce_page(const ViewArguments& a, const ViewerSite& site, const char* permission,
                                           std::function<bool()> is_opened) {
  const bool is_shared = !site.fingerprint.empty();
  for (std::size_t i = 1; i < site.urls.size(); ++i)
    fmt::print(stderr, "also        {} ({})\n", site.urls[i].url, site.urls[i].interface);
  if (is_shared) {
    fmt::print(
        stderr,
        "anyone in this network with this address can {}\n"
        "browsers warn once, since the certificate is self-signed: continue if its SHA-256 fingerprint is\n  {}\n",
        permission, site.fingerprint);
    if (const auto code = qr_code_for_terminal(site.urls.front().url)) fmt::print(stderr, "{}", *code);
  }
  std::fflush(stderr);
  // All addresses work on this machine; the last is independent of the network.
  if (!a.open) return nullptr;
  return std::make_unique<BrowserPage>(site.urls.back().url, std::move(is_opened));
}

}  // namespace cairn::apps
