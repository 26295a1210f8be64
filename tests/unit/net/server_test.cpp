// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "net/server.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <boost/asio/connect.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/ssl.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <boost/beast/websocket/ssl.hpp>
#include <chrono>
#include <stdexcept>
#include <thread>
#include <vector>

#include "support/files.hpp"

namespace cairn {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using namespace std::chrono_literals;

bool becomes(const std::function<bool()>& condition) {
  for (int i = 0; i < 500; ++i) {
    if (condition()) return true;  // may be true only once
    std::this_thread::sleep_for(10ms);
  }
  return false;
}

class Web : public testing::Test {
 protected:
  explicit Web(const ServerLimits& limits = {})
      : server({.port = 0},
               {{"", {"text/html", std::string("the page")}}, {"a.glb", {"model/gltf-binary", folder / "a.glb"}}},
               &feed, limits) {}
  /// Path below http://HOST/TOKEN/.
  [[nodiscard]] std::string path(const std::string& name) const { return url().substr(url().find('/', 7)) + name; }
  [[nodiscard]] std::string host() const { return url().substr(7, url().find('/', 7) - 7); }
  [[nodiscard]] std::string url() const { return server.url(); }
  [[nodiscard]] tcp::socket connect() {
    tcp::socket socket(context);
    const auto port = static_cast<std::uint16_t>(std::stoi(host().substr(host().find(':') + 1)));
    socket.connect({asio::ip::address_v4::loopback(), port});
    return socket;
  }
  http::response<http::string_body> get(const std::string& target, const std::string& of,
                                        const std::string& origin = "", http::verb verb = http::verb::get) {
    http::request<http::empty_body> request(verb, target, 11);
    request.set(http::field::host, of);
    if (!origin.empty()) request.set(http::field::origin, origin);
    auto socket = connect();
    http::write(socket, request);
    beast::flat_buffer buffer;
    http::response<http::string_body> response;
    http::read(socket, buffer, response);
    return response;
  }
  /// Bytes received from a connection until its end.
  static std::string heard_from(tcp::socket& socket) {
    std::string all;
    boost::system::error_code end;
    asio::read(socket, asio::dynamic_buffer(all), end);
    return all;
  }
  /// Raw response to a request's first line.
  std::string raw(const std::string& verb, const std::string& target) {
    auto socket = connect();
    asio::write(socket,
                asio::buffer(verb + " " + target + " HTTP/1.1\r\nHost: " + host() + "\r\nConnection: close\r\n\r\n"));
    return heard_from(socket);
  }
  using Socket = beast::websocket::stream<tcp::socket>;
  Socket follow(const std::string& origin = "") {
    Socket socket(connect());
    if (!origin.empty())
      socket.set_option(beast::websocket::stream_base::decorator(
          [origin](beast::websocket::request_type& request) { request.set(http::field::origin, origin); }));
    socket.handshake(host(), path("live"));
    return socket;
  }
  static std::string read(Socket& socket) {
    beast::flat_buffer buffer;
    socket.read(buffer);
    return beast::buffers_to_string(buffer.data());
  }

  TemporaryFolder folder;
  asio::io_context context;
  Feed feed;
  Server server;
};

class ImpatientWeb : public Web {
 protected:
  ImpatientWeb() : Web({.greeting = 400ms, .patience = 400ms, .connections = 4}) {}
};

TEST_F(Web, ServesThePageAndFilesToClientsWithTheToken) {
  const auto page = get(path(""), host());
  EXPECT_EQ(page.result(), http::status::ok);
  EXPECT_EQ(page.body(), "the page");
  EXPECT_EQ(page[http::field::content_type], "text/html");
  EXPECT_TRUE(server.is_opened());
  const std::string bytes(3'000'000, 'x');
  write_text(folder / "a.glb", bytes);
  EXPECT_EQ(get(path("a.glb"), host()).body(), bytes);
  EXPECT_EQ(get(path("a.glb?x=1"), "localhost" + host().substr(host().find(':'))).body(), bytes);
  std::filesystem::remove(folder / "a.glb");
  EXPECT_EQ(get(path("a.glb"), host()).result(), http::status::not_found);
}

TEST_F(Web, RefusesOthers) {
  EXPECT_EQ(get("/", host()).result(), http::status::not_found);
  EXPECT_EQ(get("/0123456789abcdef0123456789abcdef/", host()).result(), http::status::not_found);
  EXPECT_EQ(get(path("../../etc/passwd"), host()).result(), http::status::not_found);
  EXPECT_EQ(get(path(""), "evil.example").result(), http::status::forbidden);
  EXPECT_EQ(get(path(""), host(), "http://evil.example").result(), http::status::forbidden);
  EXPECT_EQ(get(path(""), host(), "null").result(), http::status::forbidden);
  EXPECT_EQ(get(path(""), host(), "", http::verb::delete_).result(), http::status::method_not_allowed);
  EXPECT_THROW(follow("http://evil.example"), boost::system::system_error);
  EXPECT_EQ(get(path(""), host()).result(), http::status::ok);
}

TEST_F(Web, SendsTheNewestVersionOfEachItem) {
  feed.set("a", "old", true);
  feed.set("a", "new", true);
  auto early = follow("http://" + host());
  EXPECT_EQ(read(early), "new");
  feed.set("b", std::string("\0\1", 2));
  EXPECT_EQ(read(early), std::string("\0\1", 2));
  EXPECT_TRUE(early.got_binary());
  auto late = follow();
  EXPECT_EQ(read(late), "new");
  EXPECT_EQ(read(late), std::string("\0\1", 2));
  EXPECT_EQ(feed.viewers(), 2);
}

TEST_F(Web, ReceivesRequestsAndSurvivesInvalidData) {
  auto viewer = follow();
  viewer.text(true);
  viewer.write(asio::buffer(std::string("{\"do\":\"pause\"}")));
  viewer.binary(true);
  viewer.write(asio::buffer(std::string("\xff\x00\x13 rubbish", 11)));
  std::vector<std::string> heard;
  EXPECT_TRUE(becomes([&] {
    for (auto& request : feed.take_requests()) heard.push_back(std::move(request));
    return !heard.empty();
  }));
  EXPECT_EQ(heard, std::vector<std::string>{"{\"do\":\"pause\"}"});
  feed.set("a", "still here", true);
  EXPECT_EQ(read(viewer), "still here");

  auto raw = connect();               // not even HTTP
  boost::system::error_code ignored;  // the connection may be closed before all is sent
  asio::write(raw, asio::buffer(std::string(100000, '\x7f')), ignored);
  EXPECT_EQ(get(path(""), host()).result(), http::status::ok);
}

TEST_F(Web, ClosesOnOversizedMessages) {
  auto viewer = follow();
  EXPECT_TRUE(becomes([&] { return feed.viewers() == 1; }));
  // The handmade head of a masked frame of a gigabyte, and its first bytes.
  std::string head = {'\x82', '\xff', 0, 0, 0, 0, 0x40, 0, 0, 0, 1, 2, 3, 4};
  boost::system::error_code ignored;
  asio::write(viewer.next_layer(), asio::buffer(head + std::string(100000, 'x')), ignored);
  EXPECT_TRUE(becomes([&] {
    feed.set("a", "something", true);
    return feed.viewers() == 0;
  }));
  EXPECT_TRUE(feed.take_requests().empty());
  EXPECT_EQ(get(path(""), host()).result(), http::status::ok);
}

TEST_F(Web, RemovesADisconnectedViewer) {
  {
    auto viewer = follow();
    EXPECT_TRUE(becomes([&] { return feed.viewers() == 1; }));
    viewer.next_layer().set_option(asio::socket_base::linger(true, 0));  // as when a cable is unplugged
  }
  EXPECT_TRUE(becomes([&] {
    feed.set("a", "something", true);
    return feed.viewers() == 0;
  }));
}

TEST_F(Web, DoesNotQueueForASlowViewer) {
  auto slow = follow();
  auto quick = follow();
  const std::string large(1'000'000, 'y');
  for (int i = 0; i < 100; ++i) {  // more than the buffers of a socket
    feed.set("large", large);
    feed.set("number", std::to_string(i), true);
    while (read(quick) != std::to_string(i)) {
    }
  }
  // The slow viewer gets the message in transit, and then directly the newest.
  int messages = 0;
  for (std::string last; last != "99"; ++messages) last = read(slow);
  EXPECT_LT(messages, 60);
}

TEST_F(Web, AnswersHeadWithTheHeaderOfGetAlone) {
  write_text(folder / "a.glb", "the bytes of a mesh");
  for (const std::string& target : {path(""), path("a.glb"), path("missing"), std::string("/")}) {
    const std::string get = raw("GET", target), head = raw("HEAD", target);
    ASSERT_NE(get.find("\r\n\r\n"), std::string::npos);
    EXPECT_EQ(head, get.substr(0, get.find("\r\n\r\n") + 4)) << target;
    EXPECT_LT(head.size(), get.size());
  }
}

TEST_F(Web, AcceptsOnlyTheExactToken) {
  std::string token = path("");
  for (std::size_t i : {std::size_t{1}, token.size() / 2, token.size() - 2}) {
    std::string wrong = token;
    wrong[i] = wrong[i] == '0' ? '1' : '0';
    EXPECT_EQ(get(wrong, host()).result(), http::status::not_found);
  }
  EXPECT_EQ(get(token.substr(0, token.size() - 1), host()).result(), http::status::not_found);
  EXPECT_EQ(get(token, host()).result(), http::status::ok);
}

TEST_F(Web, RejectsOversizedAndInvalidRequests) {
  const std::string first = "GET " + path("") + " HTTP/1.1\r\nHost: " + host() + "\r\n";
  for (const std::string& request : {
           first + "X: " + std::string(20'000, 'x') + "\r\n\r\n",
           first + "Content-Length: 10\r\n\r\n0123456789",
           first + "Content-Length: 18446744073709551615\r\n\r\n",
           first + "Transfer-Encoding: chunked\r\n\r\nffffffffffffffff\r\n",
           "GET " + std::string(20'000, '/') + " HTTP/1.1\r\n\r\n",
           std::string("GET / HTTP/9.9\r\n\r\n"),
           std::string("\r\n\r\n\r\n\r\n"),
           std::string("\0\0\0\0\r\n\r\n", 8),
       }) {
    auto socket = connect();
    boost::system::error_code ignored;  // may be closed before all is sent
    asio::write(socket, asio::buffer(request), ignored);
    socket.shutdown(tcp::socket::shutdown_send, ignored);
    EXPECT_EQ(heard_from(socket).find("200 OK"), std::string::npos) << request.substr(0, 200);
  }
  EXPECT_EQ(get(path(""), host()).result(), http::status::ok);
}

TEST_F(Web, ClosesOnWebSocketMessagesThatBreakTheProtocol) {
  const std::string mask(4, '\0');
  for (const std::string& bytes : {
           std::string("\x81\x02hi"),                                             // not masked
           "\x83\x81" + mask + "x",                                               // invalid opcode
           "\xf1\x81" + mask + "x",                                               // compressed without negotiation
           "\x80\x81" + mask + "x",                                               // continuation without a start
           "\x81\x82" + mask + "\xff\xfe",                                        // invalid UTF-8
           "\x89\xfe\x01" + std::string(1, '\0') + mask + std::string(256, 'x'),  // oversized ping
           "\x88\x81" + mask + "x",                                               // truncated close reason
       }) {
    auto viewer = follow();
    ASSERT_TRUE(becomes([&] { return feed.viewers() == 1; }));
    asio::write(viewer.next_layer(), asio::buffer(bytes));
    EXPECT_TRUE(becomes([&] { return feed.viewers() == 0; })) << bytes;
  }
  EXPECT_TRUE(feed.take_requests().empty());
  // An endless message in fragments.
  auto viewer = follow();
  ASSERT_TRUE(becomes([&] { return feed.viewers() == 1; }));
  boost::system::error_code closed;
  for (int i = 0; i < 10'000 && !closed; ++i) {
    const std::string fragment = (i == 0 ? "\x01" : std::string(1, '\0')) + "\xe4" + mask + std::string(100, 'x');
    asio::write(viewer.next_layer(), asio::buffer(fragment), closed);
  }
  EXPECT_TRUE(becomes([&] { return feed.viewers() == 0; }));
  EXPECT_EQ(get(path(""), host()).result(), http::status::ok);
}

TEST_F(ImpatientWeb, ClosesSlowRequests) {
  auto socket = connect();
  boost::system::error_code closed;
  const auto begin = std::chrono::steady_clock::now();
  const std::string request = "GET " + path("") + " HTTP/1.1\r\nHost: " + host() + "\r\n" + std::string(1000, 'x');
  for (std::size_t i = 0; i < request.size() && !closed; ++i) {
    asio::write(socket, asio::buffer(request.substr(i, 1)), closed);
    std::this_thread::sleep_for(20ms);
  }
  EXPECT_TRUE(closed);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 10s);
}

TEST_F(ImpatientWeb, LimitsConnectionsAndClosesIdleOnes) {
  std::vector<tcp::socket> idle;
  for (int i = 0; i < 4; ++i) idle.push_back(connect());
  std::this_thread::sleep_for(50ms);
  EXPECT_EQ(get(path(""), host()).result(), http::status::ok);  // the oldest of them was closed for it
  for (auto& socket : idle) EXPECT_EQ(heard_from(socket), "");
}

/// A large number of connections within a second.
constexpr int kManyConnections = 500;

TEST_F(Web, AnswersClientsWithTheTokenAmongIdleConnections) {
  for (const int count : {70, kManyConnections}) {
    std::vector<tcp::socket> idle;
    for (int i = 0; i < count; ++i) idle.push_back(connect());
    const auto begin = std::chrono::steady_clock::now();
    for (int i = 0; i < 10; ++i) EXPECT_EQ(get(path(""), host()).result(), http::status::ok) << count;
    EXPECT_LT(std::chrono::steady_clock::now() - begin, 5s);
  }
}

TEST_F(Web, AnswersClientsWithTheTokenAmongSlowRequests) {
  std::vector<tcp::socket> slow;
  const std::string request = "GET / HTTP/1.1\r\nHost: " + host() + "\r\nX: " + std::string(60, 'x');
  for (int i = 0; i < 100; ++i) slow.push_back(connect());
  std::atomic<bool> ends = false;
  std::jthread dripping([&] {
    for (std::size_t at = 0; at < request.size() && !ends; ++at) {
      boost::system::error_code closed;
      for (auto& socket : slow) asio::write(socket, asio::buffer(&request[at], 1), closed);
      std::this_thread::sleep_for(10ms);
    }
  });
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(get(path(""), host()).result(), http::status::ok);
    std::this_thread::sleep_for(10ms);
  }
  ends = true;
}

TEST_F(Web, KeepsViewersDuringNewConnections) {
  auto viewer = follow();
  ASSERT_TRUE(becomes([&] { return feed.viewers() == 1; }));
  std::vector<tcp::socket> idle;
  for (int i = 0; i < kManyConnections; ++i) idle.push_back(connect());
  EXPECT_EQ(get(path(""), host()).result(), http::status::ok);
  feed.set("a", "still here", true);
  EXPECT_EQ(read(viewer), "still here");
}

class CrowdedWeb : public Web {
 protected:
  CrowdedWeb() : Web({.greeting = 60s, .connections = 8, .strangers = 2}) {}
  [[nodiscard]] tcp::socket connect_from(const char* address) {
    tcp::socket socket(context);
    socket.open(tcp::v4());
    socket.bind({asio::ip::make_address(address), 0});
    const auto port = static_cast<std::uint16_t>(std::stoi(host().substr(host().find(':') + 1)));
    socket.connect({asio::ip::address_v4::loopback(), port});
    return socket;
  }
  static bool is_closed(tcp::socket& socket) {
    socket.non_blocking(true);
    char byte = 0;
    boost::system::error_code error;
    socket.read_some(asio::buffer(&byte, 1), error);
    return error && error != asio::error::would_block;
  }
};

TEST_F(CrowdedWeb, LimitsConnectionsPerAddress) {
  auto neighbor = connect_from("127.0.0.2");
  auto first = connect_from("127.0.0.3"), second = connect_from("127.0.0.3"), third = connect_from("127.0.0.3");
  EXPECT_TRUE(becomes([&] { return is_closed(first); }));
  for (auto* open : {&neighbor, &second, &third}) EXPECT_FALSE(is_closed(*open));
}

TEST_F(CrowdedWeb, ClosesClientsWithTheTokenOnlyBetweenRequests) {
  std::vector<tcp::socket> idle;
  const std::string request = "GET " + path("") + " HTTP/1.1\r\nHost: " + host() + "\r\n\r\n";
  for (int i = 0; i < 8; ++i) {  // the maximum number, kept alive
    idle.push_back(connect());
    asio::write(idle.back(), asio::buffer(request));
    std::string answer;
    asio::read_until(idle.back(), asio::dynamic_buffer(answer), "the page");
  }
  auto stranger = connect();
  EXPECT_TRUE(becomes([&] { return is_closed(idle[0]); }));
  for (std::size_t i = 1; i < idle.size(); ++i) EXPECT_FALSE(is_closed(idle[i])) << i;
}

TEST_F(Web, ClosesAfterARequestWithoutTheToken) {
  auto socket = connect();
  asio::write(socket, asio::buffer("GET / HTTP/1.1\r\nHost: " + host() + "\r\n\r\n"));
  EXPECT_NE(heard_from(socket).find("Connection: close"), std::string::npos);  // returns at once
}

TEST_F(Web, AllowsScriptsOnlyInThePage) {
  write_text(folder / "a.glb", "x");
  const auto page = get(path(""), host()), file = get(path("a.glb"), host()), none = get("/", host());
  EXPECT_EQ(page["Content-Security-Policy"].find("sandbox"), beast::string_view::npos);
  EXPECT_EQ(page.count(http::field::content_disposition), 0u);
  EXPECT_EQ(file[http::field::content_disposition], "attachment");
  for (const auto* other : {&file, &none})
    EXPECT_NE((*other)["Content-Security-Policy"].find("default-src 'none'; frame-ancestors 'none'; sandbox"),
              beast::string_view::npos);
  for (const auto* answer : {&page, &file, &none}) {
    EXPECT_EQ((*answer)["X-Content-Type-Options"], "nosniff");
    EXPECT_EQ((*answer)["Referrer-Policy"], "no-referrer");
    EXPECT_EQ((*answer)["Cross-Origin-Resource-Policy"], "same-origin");
  }
}

TEST_F(Web, ServesNoLinkPipeFolderOrDevice) {
  namespace fs = std::filesystem;
  write_text(folder / "secret", "secret");
  fs::create_directories(folder / "map" / "folder");
  fs::create_directories(folder / "elsewhere");
  write_text(folder / "elsewhere" / "x.bin", "secret");
  fs::create_symlink(folder / "secret", folder / "map" / "link.glb");
  fs::create_directory_symlink(folder / "elsewhere", folder / "map" / "sub");
  ASSERT_EQ(mkfifo((folder / "map" / "pipe.bin").c_str(), 0600), 0);
  Server::Files files;
  const fs::path map = folder / "map";
  for (const char* name : {"link.glb", "sub/x.bin", "pipe.bin", "folder", "../secret", "missing.bin"})
    files[name] = {.content_type = "application/octet-stream", .body = map / name, .root = map};
  files["device"] = {.content_type = "application/octet-stream", .body = fs::path("/dev/zero")};
  const std::vector<std::string> names = [&] {
    std::vector<std::string> all;
    for (const auto& [name, file] : files) all.push_back(name);
    return all;
  }();
  server.add(std::move(files));
  for (const std::string& name : names) {
    const auto answer = get(path(name), host());
    EXPECT_EQ(answer.result(), http::status::not_found) << name;
    EXPECT_EQ(answer.body().find("secret"), std::string::npos) << name;
  }
}

TEST_F(Web, NamesADownloadWithoutBreakingItsHeader) {
  const std::string name = "a\"b\r\nX-Evil: 1\r\n\xc3\xbc%.glb";
  server.add({{"files/x", {"application/octet-stream", std::string("bytes"), name}}});
  const auto answer = get(path("files/x"), host());
  EXPECT_EQ(answer.count("X-Evil"), 0u);
  EXPECT_EQ(answer[http::field::content_disposition],
            "attachment; filename=\"a_b__X-Evil: 1_____.glb\"; "
            "filename*=UTF-8''a%22b%0D%0AX-Evil%3A%201%0D%0A%C3%BC%25.glb");
}

TEST_F(Web, FindsFilesByAnyUrlEncoding) {
  server.add({{"my%20image.png", {"image/png", std::string("bytes")}}});
  for (const char* name : {"my%20image.png", "m%79%20image.png", "my%20image.png?x#y"})
    EXPECT_EQ(get(path(name), host()).body(), "bytes") << name;
  EXPECT_EQ(get(path("%2e%2e/secret"), host()).result(), http::status::not_found);
  EXPECT_EQ(get(path("my%20image.png%00"), host()).result(), http::status::not_found);
}

TEST_F(ImpatientWeb, ClosesAViewerThatDoesNotRead) {
  auto stuck = follow();
  ASSERT_TRUE(becomes([&] { return feed.viewers() == 1; }));
  const std::string large(20'000'000, 'x');  // more than the sockets' buffers
  feed.set("large", large);
  EXPECT_TRUE(becomes([&] { return feed.viewers() == 0; }));
}

TEST_F(Web, SurvivesRunningOutOfFileDescriptors) {
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &before), 0);
  tcp::socket socket(context);
  socket.open(tcp::v4());
  const int next = dup(0);
  ASSERT_GE(next, 0);
  close(next);
  const rlimit none_left{static_cast<rlim_t>(next), before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &none_left), 0);
  const auto port = static_cast<std::uint16_t>(std::stoi(host().substr(host().find(':') + 1)));
  socket.connect({asio::ip::address_v4::loopback(), port});
  std::this_thread::sleep_for(250ms);
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &before), 0);
  EXPECT_EQ(get(path(""), host()).result(), http::status::ok);
}

TEST_F(Web, ServesByteRanges) {
  std::string bytes;
  for (int i = 0; i < 300'000; ++i) bytes += static_cast<char>(i * 7 % 251);
  write_text(folder / "a.glb", bytes);
  const auto ranged = [&](const std::string& range, http::verb verb = http::verb::get) {
    http::request<http::empty_body> request(verb, path("a.glb"), 11);
    request.set(http::field::host, host());
    request.set(http::field::range, range);
    auto socket = connect();
    http::write(socket, request);
    beast::flat_buffer buffer;
    http::response_parser<http::string_body> parser;
    parser.skip(verb == http::verb::head);
    http::read(socket, buffer, parser);
    return parser.release();
  };
  const auto middle = ranged("bytes=1000-280000");
  EXPECT_EQ(middle.result(), http::status::partial_content);
  EXPECT_EQ(middle[http::field::content_range], "bytes 1000-280000/300000");
  EXPECT_EQ(middle.body() == bytes.substr(1000, 279'001), true);
  EXPECT_EQ(ranged("bytes=299990-").body(), bytes.substr(299'990));
  EXPECT_EQ(ranged("bytes=-7").body(), bytes.substr(299'993));
  EXPECT_EQ(ranged("bytes=299999-400000").body(), bytes.substr(299'999));
  EXPECT_EQ(ranged("bytes=5-5", http::verb::head)[http::field::content_length], "1");
  for (const char* behind : {"bytes=300000-", "bytes=300000-300001", "bytes=-0"}) {
    EXPECT_EQ(ranged(behind).result(), http::status::range_not_satisfiable) << behind;
    EXPECT_EQ(ranged(behind)[http::field::content_range], "bytes */300000");
  }
  for (const char* other : {"bytes=5-2", "bytes=a-b", "bytes=1-2,4-5", "lines=1-2", "bytes=", "bytes=-",
                            "bytes=99999999999999999999-", "bytes=1x-2"})
    EXPECT_EQ(ranged(other).body() == bytes, true) << other;  // the entire file, as without a range
}

TEST_F(Web, MakesContentOnceAndServesOthersMeanwhile) {
  std::atomic<int> made = 0;
  std::atomic<bool> may_go_on = false;
  server.add({{"slow.ply",
               {.content_type = "application/octet-stream",
                .body = once(
                    [&]() -> Content {
                      ++made;
                      while (!may_go_on) std::this_thread::sleep_for(5ms);
                      return std::make_shared<const Text>("made");
                    },
                    true),
                .download = "slow.ply"}},
              {"broken", {"text/plain", Make{[]() -> Content { throw std::runtime_error("the disk is full"); }}}}});
  std::vector<std::jthread> clients;
  std::vector<http::response<http::string_body>> answers(3);
  for (auto& answer : answers) clients.emplace_back([&] { answer = get(path("slow.ply"), host()); });
  EXPECT_TRUE(becomes([&] { return made == 1; }));
  EXPECT_EQ(get(path(""), host()).body(), "the page");
  const auto broken = get(path("broken"), host());
  EXPECT_EQ(broken.result(), http::status::internal_server_error);
  EXPECT_EQ(broken.body(), "the disk is full\n");
  may_go_on = true;
  clients.clear();
  EXPECT_EQ(made, 1);
  for (const auto& answer : answers) {
    EXPECT_EQ(answer.body(), "made");
    EXPECT_EQ(answer[http::field::content_disposition], "attachment; filename=\"slow.ply\"");
  }
}

/// Server over TLS, as seen by other devices.
class SecureWeb : public Web {
 protected:
  explicit SecureWeb(const ServerLimits& limits = {})
      : secure({.port = 0, .host = "0.0.0.0", .certificates = folder / "state"},
               {{"", {"text/html", std::string("the page"), "", true}},
                {"a.glb", {"model/gltf-binary", folder / "a.glb"}}},
               &feed, limits) {
    const std::string last = secure.url();  // https://HOST:PORT/TOKEN/
    const auto colon = last.rfind(':'), slash = last.find('/', colon);
    port_ = last.substr(colon + 1, slash - colon - 1), token_ = last.substr(slash);
    trust.load_verify_file(folder / "state" / "view-0.0.0.0.pem");
    trust.set_verify_mode(asio::ssl::verify_peer);
    trust.set_verify_callback(asio::ssl::host_name_verification("127.0.0.1"));
  }
  using Stream = asio::ssl::stream<tcp::socket>;
  [[nodiscard]] tcp::socket connect_plain() {
    tcp::socket socket(context);
    socket.connect({asio::ip::address_v4::loopback(), static_cast<std::uint16_t>(std::stoi(port_))});
    return socket;
  }
  Stream connect_secure() {
    Stream stream(connect_plain(), trust);
    stream.handshake(asio::ssl::stream_base::client);
    return stream;
  }
  http::response<http::string_body> get_secure(const std::string& target, const std::string& of,
                                               const std::string& origin = "") {
    http::request<http::empty_body> request(http::verb::get, target, 11);
    request.set(http::field::host, of);
    if (!origin.empty()) request.set(http::field::origin, origin);
    Stream stream = connect_secure();
    http::write(stream, request);
    beast::flat_buffer buffer;
    http::response<http::string_body> response;
    http::read(stream, buffer, response);
    return response;
  }
  [[nodiscard]] std::string here() const { return "127.0.0.1:" + port_; }

  Server secure;
  std::string port_, token_;
  asio::ssl::context trust{asio::ssl::context::tls_client};
};

class ImpatientSecureWeb : public SecureWeb {
 protected:
  ImpatientSecureWeb() : SecureWeb({.greeting = 400ms, .patience = 400ms, .connections = 8}) {}
};

TEST_F(SecureWeb, ProvesItsAddressAndServesClientsWithTheToken) {
  EXPECT_EQ(secure.url().substr(0, 8), "https://");
  EXPECT_EQ(get_secure(token_, here()).body(), "the page");
  const std::string bytes(3'000'000, 'x');
  write_text(folder / "a.glb", bytes);
  EXPECT_EQ(get_secure(token_ + "a.glb", "localhost:" + port_, "https://localhost:" + port_).body() == bytes, true);
  trust.set_verify_callback(asio::ssl::host_name_verification("192.0.2.7"));
  EXPECT_THROW(connect_secure(), boost::system::system_error);  // not an address of this machine
}

TEST_F(SecureWeb, RefusesOthers) {
  std::string wrong = token_;
  wrong[5] = wrong[5] == '0' ? '1' : '0';
  EXPECT_EQ(get_secure(wrong, here()).result(), http::status::not_found);
  EXPECT_EQ(get_secure("/", here()).result(), http::status::not_found);
  EXPECT_EQ(get_secure(token_, "evil.example").result(), http::status::forbidden);
  EXPECT_EQ(get_secure(token_, "192.0.2.7:" + port_).result(), http::status::forbidden);
  EXPECT_EQ(get_secure(token_, here(), "http://" + here()).result(), http::status::forbidden);
  EXPECT_EQ(get_secure(token_, here(), "https://evil.example").result(), http::status::forbidden);
  asio::ssl::context old(asio::ssl::context::tls_client);
  old.set_options(asio::ssl::context::no_tlsv1_2 | asio::ssl::context::no_tlsv1_3);
  Stream stream(connect_plain(), old);
  EXPECT_THROW(stream.handshake(asio::ssl::stream_base::client), boost::system::system_error);
  EXPECT_EQ(get_secure(token_, here()).result(), http::status::ok);
}

TEST_F(SecureWeb, ExplainsHttpsToPlainHttpClients) {
  auto socket = connect_plain();
  asio::write(socket, asio::buffer("GET / HTTP/1.1\r\nHost: " + here() + "\r\nConnection: close\r\n\r\n"));
  const std::string answer = heard_from(socket);
  EXPECT_NE(answer.find("400 Bad Request"), std::string::npos) << answer;
  EXPECT_NE(answer.find("begins with https://"), std::string::npos) << answer;
  EXPECT_EQ(answer.find(token_), std::string::npos);
}

TEST_F(SecureWeb, FollowsTheFeed) {
  beast::websocket::stream<Stream> socket(connect_secure());
  socket.handshake(here(), token_ + "live");
  feed.set("a", "new", true);
  beast::flat_buffer buffer;
  socket.read(buffer);
  EXPECT_EQ(beast::buffers_to_string(buffer.data()), "new");
  socket.write(asio::buffer(std::string("{}")));
  EXPECT_TRUE(becomes([&] { return !feed.take_requests().empty(); }));
}

TEST_F(SecureWeb, ServesManyAtOnce) {
  const std::string bytes(1'000'000, 'y');
  write_text(folder / "a.glb", bytes);
  std::atomic<int> right = 0;
  {
    std::vector<std::jthread> clients;
    for (int i = 0; i < 20; ++i)
      clients.emplace_back([&] { right += get_secure(token_ + "a.glb", here()).body() == bytes; });
  }
  EXPECT_EQ(right, 20);
}

TEST_F(SecureWeb, KeepsItsCertificatePrivate) {
  namespace fs = std::filesystem;
  const fs::path file = folder / "state" / "view-0.0.0.0.pem";
  EXPECT_EQ(fs::status(file).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  const ViewerAddress at{.port = 0, .host = "0.0.0.0", .certificates = folder / "state"};
  const std::string first = secure.site().fingerprint;
  EXPECT_EQ(first.size(), 32u * 3 - 1);
  EXPECT_EQ(Server(at, {}, nullptr).site().fingerprint, first);
  fs::permissions(file, fs::perms::others_read, fs::perm_options::add);
  const std::string second = Server(at, {}, nullptr).site().fingerprint;
  EXPECT_NE(second, first);  // the key may be compromised
  write_text(file, "broken");
  fs::permissions(file, fs::perms::owner_read | fs::perms::owner_write);
  EXPECT_NE(Server(at, {}, nullptr).site().fingerprint, second);
  write_text(folder / "file", "");
  const ViewerAddress nowhere{.port = 0, .host = "0.0.0.0", .certificates = folder / "file" / "x"};
  EXPECT_FALSE(Server(nowhere, {}, nullptr).site().fingerprint.empty());  // temporary
}

TEST_F(ImpatientSecureWeb, ClosesStalledHandshakes) {
  auto silent = connect_plain(), half = connect_plain();
  asio::write(half, asio::buffer("\x16\x03\x01\x02"));  // the first bytes of a handshake
  Stream idle = connect_secure();
  EXPECT_EQ(heard_from(silent), "");
  EXPECT_EQ(heard_from(half), "");
  char byte = 0;
  boost::system::error_code end;
  asio::read(idle, asio::buffer(&byte, 1), end);
  EXPECT_TRUE(end);
  EXPECT_EQ(get_secure(token_, here()).result(), http::status::ok);
}

TEST(Server, ListsTheAddressesOfThisMachine) {
  for (const char* host : {"192.0.2.7", "phone", "300.1.1.1"}) {
    const std::string message = error_of([&] { const Server server({.port = 0, .host = host}, {}, nullptr); });
    EXPECT_NE(message.find("address " + std::string(host) + " cannot be used"), std::string::npos) << message;
    EXPECT_NE(message.find("use 0.0.0.0 for all of them"), std::string::npos) << message;
  }
}

TEST(Server, SpeaksHttpOnThisMachineAlone) {
  for (const char* host : {"", "localhost", "127.0.0.1"}) {
    const Server server({.port = 0, .host = host}, {}, nullptr);
    EXPECT_EQ(server.url().substr(0, 17), "http://127.0.0.1:");
    EXPECT_TRUE(server.site().fingerprint.empty());
  }
}

TEST(Server, ReportsAPortInUse) {
  const Server first({.port = 0}, {}, nullptr);
  const int port = std::stoi(first.url().substr(first.url().find(':', 7) + 1));
  EXPECT_NE(error_of([&] {
              const Server second({.port = port}, {}, nullptr);
            }).find("port " + std::to_string(port) + " cannot be used"),
            std::string::npos);
}

}  // namespace
}  // namespace cairn
