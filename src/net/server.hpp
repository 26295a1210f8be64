// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Web server of the viewer, and receiver of messages from cameras; the only user of Boost.Beast.
#pragma once
#include <chrono>
#include <map>
#include <memory>
#include <string>

#include "cairn/mapping/viewer_address.hpp"
#include "net/feed.hpp"
#include "net/inbox.hpp"
#include "net/served.hpp"

namespace cairn {

/// Resource limits per client and in total.
struct ServerLimits {
  std::chrono::milliseconds greeting{5000};   // time for a client's first request, including the TLS handshake
  std::chrono::milliseconds patience{15000};  // timeout of an idle client with the token
  int connections = 64;  // simultaneous; a further connection replaces the oldest without the token
  int strangers = 16;    // connections without the token per address
  int viewers = 32;      // connections that follow the feed
};

/// Receives messages of a sender, a camera in place of a browser.
struct Inlet {
  Inbox* inbox = nullptr;  // null: none
  /// Messages with a length prefix over plain TCP, and no HTTP. False: a WebSocket at `frames` below the token.
  bool is_tcp = false;
  std::string name;   // begin of warnings
  std::string token;  // in the addresses, in place of a random token; empty: addresses without a token
};

/// Serves http://127.0.0.1:PORT/TOKEN/ in its own thread, only to this machine, to clients with the token, and to pages
/// served by it: other Hosts and Origins are refused. With ViewerAddress::host, serves over TLS with its own
/// certificate to all clients that reach the address. A WebSocket at `live` follows the feed. With an inlet for TCP,
/// receives its messages at tcp://HOST:PORT instead, without TLS.
class Server {
 public:
  using Files = std::map<std::string, Served>;
  /// `files` are keyed by the name below the token; "" is the page. Without `feed` (null) there is no WebSocket. Throws
  /// std::runtime_error if the port is in use or the address does not belong to this machine.
  Server(const ViewerAddress& at, Files files, Feed* feed, const ServerLimits& limits = {}, const Inlet& inlet = {});
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// Adds files, replacing files of the same name. Thread-safe.
  void add(Files&& files);

  [[nodiscard]] const ViewerSite& site() const;
  /// Returns true if a browser has loaded the page. Thread-safe.
  [[nodiscard]] bool is_opened() const;
  /// The first address.
  [[nodiscard]] std::string url() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn
