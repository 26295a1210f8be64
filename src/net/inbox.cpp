// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "net/inbox.hpp"

#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "base/json_text.hpp"

namespace cairn {

Inbox::Sender Inbox::enter(Bytes first, const std::string& address) {
  const std::size_t max_message = check_first_(first);
  const std::lock_guard lock(mutex_);
  if (id_ != 0)
    throw std::runtime_error("another client, " + address_ + ", is connected: disconnect it, or wait for its end");
  id_ = ++last_id_;
  is_new_ = true;
  address_ = address;
  message_ = std::move(first);
  answer_.reset();
  changed_.notify_all();
  return {id_, max_message};
}

void Inbox::leave(int id) {
  const std::lock_guard lock(mutex_);
  if (id_ != id) return;
  id_ = 0;
  message_.reset();
  answer_.reset();
  changed_.notify_all();
}

void Inbox::put(int id, Bytes message) {
  const std::lock_guard lock(mutex_);
  if (id_ != id) return;
  message_ = std::move(message);
  changed_.notify_all();
}

std::optional<Inbox::Answer> Inbox::take_answer(int id) {
  const std::lock_guard lock(mutex_);
  return id_ == id ? std::exchange(answer_, std::nullopt) : std::nullopt;
}

std::optional<Inbox::Arrival> Inbox::next_sender(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  if (!changed_.wait_for(lock, timeout, [&] { return id_ != 0 && is_new_; })) return std::nullopt;
  is_new_ = false;
  return Arrival{id_, *std::exchange(message_, std::nullopt), address_};
}

std::optional<Inbox::Bytes> Inbox::next(int id, std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, timeout, [&] { return id_ != id || message_; });
  return id_ == id ? std::exchange(message_, std::nullopt) : std::nullopt;
}

bool Inbox::is_connected(int id) const {
  const std::lock_guard lock(mutex_);
  return id_ == id;
}

bool Inbox::has_sender() const {
  const std::lock_guard lock(mutex_);
  return id_ != 0;
}

void Inbox::answer(int id, std::string text, bool is_last) {
  set_answer(id, {.text = std::move(text), .is_last = is_last});
}

void Inbox::refuse(int id, const std::string& reason) { set_answer(id, {.text = error_text(reason), .is_last = true}); }

void Inbox::set_answer(int id, Answer answer) {
  const std::lock_guard lock(mutex_);
  if (id_ == id && !answer_) answer_ = std::move(answer);
}

std::string error_text(const std::string& reason) { return text_of({{"error", reason}}); }

}  // namespace cairn
