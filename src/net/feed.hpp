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

/// Latest state for viewers, as named items. A slow or late viewer receives only the newest version of an item, so that
/// no queue builds up. Thread-safe.
class Feed {
 public:
  struct Item {
    std::uint64_t version = 0;  // version of the feed when the item was set
    bool is_text = false;
    std::shared_ptr<const std::string> bytes;
  };

  void set(const std::string& name, std::string bytes, bool is_text = false);
  /// Removes all items.
  void clear();
  /// Items set after `version`, in this order.
  [[nodiscard]] std::vector<Item> since(std::uint64_t version) const;

  /// Contents: number of items, their bytes, and waiting requests.
  struct Size {
    std::size_t items = 0, bytes = 0, requests = 0;
  };
  [[nodiscard]] Size size() const;

  /// Adds a viewer's request, unchecked; the receiver validates it.
  void ask(std::string request);
  /// Removes and returns the requests since the last call.
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
