// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/run_view.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <thread>

#include "cli/interrupt.hpp"

namespace cairn::apps {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;
constexpr auto kPollInterval = 50ms;
constexpr auto kViewerTimeout = 5s;   // after this time a viewer is gone, not reloading
constexpr auto kResultTimeout = 10s;  // time for viewers to fetch the result after an interrupt

}  // namespace

void add_run_view(CLI::App& command, RunViewArguments& a) {
  auto* view = command.add_flag("--view", a.view, "Show the map in a browser while it grows; prints the address");
  add_view_options(command, a, view);
}

RunView::RunView(const RunViewArguments& a, const char* permission) : viewer_(a.at) {
  const ViewerSite& site = viewer_.site();
  fmt::print(stderr, "view        {}\n", site.urls.front().url);
  page_ = announce_page(a, site, permission, [this] { return viewer_.is_opened(); });
}

void RunView::show_result(const std::filesystem::path& output, bool is_interrupted) {
  viewer_.finished(output);
  if (viewer_.viewers() == 0) return;
  std::fflush(stdout);
  const Interrupt interrupt(Interrupt::Graceful::now, "");
  if (!is_interrupted) fmt::print(stderr, "the page shows the result; press Ctrl-C or close it to end\n");
  const auto begin = Clock::now();
  for (auto seen = begin; !interrupt.requested() && Clock::now() - seen < kViewerTimeout;) {
    std::this_thread::sleep_for(kPollInterval);
    if (viewer_.viewers() > 0) seen = Clock::now();
    if (is_interrupted && (viewer_.is_shown() || Clock::now() - begin > kResultTimeout)) break;
  }
}

}  // namespace cairn::apps
