// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Responses of the server: text, files, and content made on request.
#pragma once
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <variant>

namespace cairn {

/// Immutable bytes, with a compressed version for slow connections. Thread-safe.
class Text {
 public:
  explicit Text(std::string bytes) : bytes_(std::move(bytes)) {}
  [[nodiscard]] const std::string& bytes() const { return bytes_; }
  /// gzip-compressed; the first call compresses.
  [[nodiscard]] const std::string& packed() const;

 private:
  std::string bytes_;
  mutable std::once_flag once_;
  mutable std::string packed_;
};

using Content = std::variant<std::shared_ptr<const Text>, std::filesystem::path>;

/// Content made on request in a worker thread, sequentially. Slow content (`takes_long`) has its own thread. Exceptions
/// become the response.
struct Make {
  std::function<Content()> make;
  bool takes_long = false;
};

/// Response of a path. A file is read on request; a link in its place is not followed.
struct Served {
  std::string content_type;
  std::variant<std::string, std::filesystem::path, Make> body;
  std::string download;      // file name for a browser's download; empty: shown in the browser
  bool is_packable = false;  // compressible
  /// Folder at or above the file; no path component below it may be a link. Empty: the file's own folder.
  std::filesystem::path root = {};
};

/// Content made at most once; later calls return the same content.
[[nodiscard]] Make once(std::function<Content()> make, bool takes_long = false);

/// Starts making content at once, in its own thread; requests wait for the result.
[[nodiscard]] Make beforehand(std::function<Content()> make);

}  // namespace cairn
