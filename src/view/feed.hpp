// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace cairn {

/// What viewers should see, each thing by its name in its newest version. A viewer that is slow or comes late takes
/// what is newest then: nothing queues up for it. Any thread.
class Feed {
 public:
  struct Item {
    std::uint64_t version = 0;  // of the whole feed when it was set
    bool is_text = false;
    std::shared_ptr<const std::string> bytes;
  };

  void set(const std::string& name, std::string bytes, bool is_text = false);
  /// Forgets all that was set.
  void clear();
  /// What was set after `version`, in that order.
  [[nodiscard]] std::vector<Item> since(std::uint64_t version) const;

  /// What it holds: things that were set, their bytes, and requests that wait.
  struct Size {
    std::size_t things = 0, bytes = 0, requests = 0;
  };
  [[nodiscard]] Size size() const;

  /// Something a viewer asks for; rubbish is told apart by whoever takes it.
  void ask(std::string request);
  /// What was asked for since the last call.
  [[nodiscard]] std::vector<std::string> take_requests();

  void enter() { count(1); }
  void leave() { count(-1); }
  [[nodiscard]] int viewers() const;

 private:
  void count(int by);

  mutable std::mutex mutex_;
  std::map<std::string, Item> items_;
  std::vector<std::string> requests_;
  std::uint64_t version_ = 0;
  int viewers_ = 0;
};

}  // namespace cairn
