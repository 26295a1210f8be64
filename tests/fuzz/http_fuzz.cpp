// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// HTTP and WebSocket, through a connection to the server: TOKEN and HOST in the input are replaced by the server's
// values.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstdio>

#include "fuzz.hpp"
#include "net/server.hpp"

using namespace cairn;

namespace {

struct Site {
  Feed feed;
  Server server{{.port = 0},
                {{"", {"text/html", std::string("<p>page</p>")}},
                 {"file", {"text/plain", fuzz::file_of("served.txt", "served")}},
                 {"gone", {"text/plain", fuzz::folder() / "gone.txt"}}},
                &feed};
  std::string token, host;
  int port = 0;
  Site() {
    feed.set("news", "hello", true);
    const std::string url = server.url();  // http://HOST/TOKEN/
    host = url.substr(7, url.find('/', 7) - 7);
    token = url.substr(7 + host.size() + 1);
    token.pop_back();
    port = std::stoi(host.substr(host.find(':') + 1));
  }
};

void replace_all(std::string& text, std::string_view name, const std::string& value) {
  for (std::size_t at = 0; (at = text.find(name, at)) != text.npos; at += value.size())
    text.replace(at, name.size(), value);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Site site;
  std::string bytes(fuzz::text_of(data, size));
  replace_all(bytes, "TOKEN", site.token);
  replace_all(bytes, "HOST", site.host);
  const int connection = socket(AF_INET, SOCK_STREAM, 0);
  // Reset on close, so that no port stays reserved.
  const linger reset{1, 0};
  setsockopt(connection, SOL_SOCKET, SO_LINGER, &reset, sizeof reset);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(site.port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  int connected = -1;
  do connected = connect(connection, reinterpret_cast<sockaddr*>(&address), sizeof address);
  while (connected != 0 && errno == EINTR);  // libFuzzer's timer
  if (connected != 0 && errno != EISCONN) {
    std::perror("the server is gone");
    std::abort();
  }
  (void)!send(connection, bytes.data(), bytes.size(), MSG_NOSIGNAL);
  shutdown(connection, SHUT_WR);
  char answer[4096];
  while (recv(connection, answer, sizeof answer, 0) > 0) {
  }
  close(connection);
  (void)site.feed.take_requests();
  return 0;
}
