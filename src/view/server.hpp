// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The web server of the viewer; the only door to Boost.Beast.
#pragma once
#include <chrono>
#include <map>
#include <memory>
#include <string>

#include "cairn/viewer.hpp"
#include "view/feed.hpp"
#include "view/served.hpp"

namespace cairn {

/// What one client, or all of them, may take of a server.
struct ServerLimits {
  std::chrono::milliseconds greeting{5000};   // for a client to send its first request, with TLS before it
  std::chrono::milliseconds patience{15000};  // with a client that has the token and neither asks nor reads
  int connections = 64;  // at once; for a further one that without the token is closed which came first
  int strangers = 16;    // among them those without the token from one address
  int viewers = 32;      // among them
};

/// Serves http://127.0.0.1:PORT/TOKEN/ in a thread of its own: to this machine alone, to who knows the token, and to
/// pages that it served itself: other Hosts and Origins are refused. With ViewerAddress::host the same over TLS, with a
/// certificate of its own, to whoever reaches that address. A WebSocket at `live` follows the feed.
class Server {
 public:
  using Files = std::map<std::string, Served>;
  /// `files` by their name below the token; "" is the page. `feed` may be null: no WebSocket then. Throws
  /// std::runtime_error when the port is in use or the address is not this machine's.
  Server(const ViewerAddress& at, Files files, Feed* feed, const ServerLimits& limits = {});
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// Gives these, too, from now on; those of the same name are replaced. Any thread.
  void add(Files&& files);

  [[nodiscard]] const ViewerSite& site() const;
  /// Whether a browser has loaded the page. Any thread.
  [[nodiscard]] bool is_opened() const;
  /// The first of its addresses.
  [[nodiscard]] std::string url() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn
