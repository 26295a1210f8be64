// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Page of a run, shared by `live --view` and `reconstruct --view`: the growing map, then the result.
#pragma once
#include <filesystem>
#include <memory>

#include "cairn/mapping/viewer.hpp"
#include "cli/view_options.hpp"

namespace cairn::apps {

struct RunViewArguments : ViewArguments {
  bool view = false;
};

/// Adds --view and the options of its page.
void add_run_view(CLI::App& command, RunViewArguments& a);

/// Page of a run during its lifetime.
class RunView {
 public:
  /// Serves the page and prints its address. `permission`: see announce_page.
  RunView(const RunViewArguments& a, const char* permission);
  RunView(const RunView&) = delete;
  RunView& operator=(const RunView&) = delete;
  [[nodiscard]] LiveViewer& viewer() { return viewer_; }
  /// Serves the result while a browser is connected; after Ctrl-C only until browsers have fetched it. No Interrupt may
  /// exist.
  void show_result(const std::filesystem::path& output, bool is_interrupted);

 private:
  LiveViewer viewer_;
  std::unique_ptr<BrowserPage> page_;
};

}  // namespace cairn::apps
