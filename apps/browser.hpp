// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <functional>
#include <string>
#include <thread>

namespace cairn::apps {

/// A page in the user's browser: $BROWSER, or what the desktop takes. All users of a machine read each other's command
/// lines: the browser's has the name of a file that leads to `url`, and which this user alone can read. Reports on
/// stderr where there is no browser; the work goes on in any case.
class BrowserPage {
 public:
  /// `is_loaded`: called from another thread, until it is true or this ends; the file is removed then.
  BrowserPage(const std::string& url, std::function<bool()> is_loaded);
  ~BrowserPage();
  BrowserPage(const BrowserPage&) = delete;
  BrowserPage& operator=(const BrowserPage&) = delete;

 private:
  void remove();
  std::filesystem::path folder_;
  std::jthread watch_;  // last: it uses the others
};

}  // namespace cairn::apps
