// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <functional>
#include <string>
#include <thread>

namespace cairn::apps {

/// Opens a page in the user's browser: $BROWSER, or the desktop's default. Command lines are visible to all users of a
/// machine, so the browser gets the name of a redirecting file that only this user can read, not `url`. Reports on
/// stderr if no browser starts; the program continues in any case.
class BrowserPage {
 public:
  /// `is_loaded` is polled from another thread until it returns true or this object is destroyed; then the file is
  /// removed.
  BrowserPage(const std::string& url, std::function<bool()> is_loaded);
  ~BrowserPage();
  BrowserPage(const BrowserPage&) = delete;
  BrowserPage& operator=(const BrowserPage&) = delete;

 private:
  void remove();
  std::filesystem::path folder_;
  std::jthread watch_;  // last member: uses the members above
};

}  // namespace cairn::apps
