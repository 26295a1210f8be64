// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "net/feed.hpp"

#include <algorithm>
#include <utility>

namespace cairn {
namespace {

constexpr std::size_t kMaxRequests = 100;  // limit on waiting requests; further requests are dropped

}  // namespace

void Feed::set(const std::string& name, std::string bytes, bool is_text) {
  auto shared = std::make_shared<const std::string>(std::move(bytes));
  const std::lock_guard lock(mutex_);
  items_[name] = {++version_, is_text, std::move(shared)};
}

void Feed::clear() {
  const std::lock_guard lock(mutex_);
  items_.clear();
}

std::vector<Feed::Item> Feed::since(std::uint64_t version) const {
  std::vector<Item> items;
  const std::lock_guard lock(mutex_);
  if (version == version_) return items;
  for (const auto& [name, item] : items_)
    if (item.version > version) items.push_back(item);
  std::sort(items.begin(), items.end(), [](const Item& a, const Item& b) { return a.version < b.version; });
  return items;
}

Feed::Size Feed::size() const {
  const std::lock_guard lock(mutex_);
  Size size{.items = items_.size(), .bytes = 0, .requests = requests_.size()};
  for (const auto& [name, item] : items_) size.bytes += name.size() + item.bytes->size();
  return size;
}

void Feed::ask(std::string request) {
  const std::lock_guard lock(mutex_);
  if (requests_.size() < kMaxRequests) requests_.push_back(std::move(request));
}

std::vector<std::string> Feed::take_requests() {
  const std::lock_guard lock(mutex_);
  return std::exchange(requests_, {});
}

int Feed::viewers() const {
  const std::lock_guard lock(mutex_);
  return viewers_;
}

void Feed::count(int by) {
  const std::lock_guard lock(mutex_);
  viewers_ += by;
}

}  // namespace cairn
