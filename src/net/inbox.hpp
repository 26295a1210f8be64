// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace cairn {

inline constexpr std::size_t kMaxFirstMessage = std::size_t{128} << 10;  // bytes

/// Messages of one sender at a time, from its connection to a reader in another thread. A connection reads its next
/// message after the answer to the last, so a slow reader slows the sender. Thread-safe.
class Inbox {
 public:
  using Bytes = std::vector<std::uint8_t>;
  /// Checks a first message, at most kMaxFirstMessage bytes, and returns the size limit of the following messages.
  /// Throws std::runtime_error for an invalid message. Called by the server's thread.
  using CheckFirst = std::function<std::size_t(const Bytes&)>;
  explicit Inbox(CheckFirst check_first) : check_first_(std::move(check_first)) {}

  /// Answer to a message; the connection is closed after the last.
  struct Answer {
    std::string text;  // JSON
    bool is_last = false;
  };
  struct Sender {
    int id = 0;                   // counts from 1
    std::size_t max_message = 0;  // bytes
  };

  // For the connection.

  /// Admits a sender with its first message. Throws std::runtime_error for an invalid message, and while another sender
  /// is connected.
  [[nodiscard]] Sender enter(Bytes first, const std::string& address);
  void leave(int id);
  /// Stores the sender's next message; requires the answer to its last.
  void put(int id, Bytes message);
  /// Answer to the sender's last message; empty: not yet given.
  [[nodiscard]] std::optional<Answer> take_answer(int id);

  // For the reader.

  /// Sender and its first message, of a new sender; waits up to `timeout`.
  struct Arrival {
    int id = 0;
    Bytes first;
    std::string address;
  };
  [[nodiscard]] std::optional<Arrival> next_sender(std::chrono::milliseconds timeout);
  /// Next message of this sender; empty after the timeout, and if the sender is gone.
  [[nodiscard]] std::optional<Bytes> next(int id, std::chrono::milliseconds timeout);
  [[nodiscard]] bool is_connected(int id) const;
  [[nodiscard]] bool has_sender() const;
  /// Sets the answer to the sender's last message, unless it has one.
  void answer(int id, std::string text, bool is_last = false);
  /// Answers {"error": `reason`} and closes the connection, as soon as its current message has arrived.
  void refuse(int id, const std::string& reason);

 private:
  void set_answer(int id, Answer answer);

  CheckFirst check_first_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  int id_ = 0, last_id_ = 0;  // connected sender, 0: none; last admitted sender
  bool is_new_ = false;       // not yet returned by next_sender()
  std::string address_;
  std::optional<Bytes> message_;
  std::optional<Answer> answer_;
};

/// JSON text {"error": `reason`}.
[[nodiscard]] std::string error_text(const std::string& reason);

}  // namespace cairn
