// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view_options.hpp"

#include <fmt/format.h>

#include <utility>

#include "qr_code.hpp"
#include "quantity.hpp"

namespace cairn::apps {

void add_view_options(CLI::App& command, ViewArguments& a, CLI::Option* needs) {
  auto* port =
      add_number(command, "--port", a.at.port, {0, 65535}, "Of the page; 0: any free one")->capture_default_str();
  auto* host =
      command.add_option("--host", a.at.host,
                         "Serve other devices, too, such as a phone: an IP address of this machine, or 0.0.0.0 "
                         "for all of them; encrypted [this machine alone]");
  auto* open = command.add_flag("--open", a.open, "Open the page in a browser");
  if (needs != nullptr)
    for (CLI::Option* option : {port, host, open}) option->needs(needs);
}

std::unique_ptr<BrowserPage> tell_how_to_open(const ViewArguments& a, const ViewerSite& site, const char* they_can,
                                              std::function<bool()> is_opened) {
  const bool is_shared = !site.fingerprint.empty();
  for (std::size_t i = 1; i < site.urls.size(); ++i)
    fmt::print(stderr, "also        {} ({})\n", site.urls[i].url, site.urls[i].interface);
  if (is_shared) {
    fmt::print(stderr,
               "anyone in this network who has this address can {}\n"
               "browsers warn once, since the certificate is Cairn's own: go on if its SHA-256 fingerprint is\n  {}\n",
               they_can, site.fingerprint);
    if (const auto code = qr_code_for_terminal(site.urls.front().url)) fmt::print(stderr, "{}", *code);
  }
  std::fflush(stderr);
  // All addresses work on this machine; the last is independent of the network.
  if (!a.open) return nullptr;
  return std::make_unique<BrowserPage>(site.urls.back().url, std::move(is_opened));
}

}  // namespace cairn::apps
