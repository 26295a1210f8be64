// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The web server of the viewer; the only door to Boost.Beast.
#pragma once
#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <variant>

#include "view/feed.hpp"

namespace cairn {

/// What a path gives: text in memory, or a file that is read when it is asked for.
struct Served {
  std::string content_type;
  std::variant<std::string, std::filesystem::path> body;
};

/// What one client, or all of them, may take of a server.
struct ServerLimits {
  std::chrono::milliseconds patience{15000};  // with a client that neither asks nor reads
  int connections = 64;                       // at once; more are closed as they come
  int viewers = 32;                           // among them
};

/// Serves http://127.0.0.1:PORT/TOKEN/ in a thread of its own: to this machine alone, to who knows the token, and to
/// pages that it served itself: other Hosts and Origins are refused. A WebSocket at `live` follows the feed.
class Server {
 public:
  /// `files` by their name below the token; "" is the page. `feed` may be null: no WebSocket then. Port 0: any free
  /// one. Throws std::runtime_error when the port is in use.
  Server(int port, std::map<std::string, Served> files, Feed* feed, const ServerLimits& limits = {});
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  [[nodiscard]] std::string url() const;
  /// Serves these, too; names that are served already stay as they are.
  void add(std::map<std::string, Served> files);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn
