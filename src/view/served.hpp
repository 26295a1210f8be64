// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What a server gives to who asks: text, files, and what is only made then.
#pragma once
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <variant>

namespace cairn {

/// Bytes that never change, and the same packed for a slow way. Any thread.
class Text {
 public:
  explicit Text(std::string bytes) : bytes_(std::move(bytes)) {}
  [[nodiscard]] const std::string& bytes() const { return bytes_; }
  /// gzip-ed; the first call takes a while.
  [[nodiscard]] const std::string& packed() const;

 private:
  std::string bytes_;
  mutable std::once_flag once_;
  mutable std::string packed_;
};

using Content = std::variant<std::shared_ptr<const Text>, std::filesystem::path>;

/// Makes what is asked for, in a thread beside the server: one thing after the other, those that take `long` in a row
/// of their own. What it throws is the answer.
struct Make {
  std::function<Content()> make;
  bool takes_long = false;
};

/// What a path gives. A file is read when it is asked for, and a link in place of it is not followed.
struct Served {
  std::string content_type;
  std::variant<std::string, std::filesystem::path, Make> body;
  std::string download;      // the name of the file that a browser keeps; empty: it is shown
  bool is_packable = false;  // much smaller when it is packed
  /// Folder of the file, or above it, below which no part of its path may be a link; empty: the file's own.
  std::filesystem::path root = {};
};

/// What is made at most once: calls after the first give the same.
[[nodiscard]] Make once(std::function<Content()> make, bool takes_long = false);

/// What is made from now on, in a thread of its own: who asks waits for what is left of it.
[[nodiscard]] Make beforehand(std::function<Content()> make);

}  // namespace cairn
