// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/server.hpp"

#include <gtest/gtest.h>

#include <boost/asio/connect.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <thread>

#include "support/files.hpp"

namespace cairn {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using namespace std::chrono_literals;

bool becomes(const std::function<bool()>& condition) {
  for (int i = 0; i < 500 && !condition(); ++i) std::this_thread::sleep_for(10ms);
  return condition();
}

class Web : public testing::Test {
 protected:
  /// Below http://HOST/TOKEN/.
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
  Server server{
      0, {{"", {"text/html", std::string("the page")}}, {"a.glb", {"model/gltf-binary", folder / "a.glb"}}}, &feed};
};

TEST_F(Web, ServesThePageAndFilesToWhoKnowsTheToken) {
  const auto page = get(path(""), host());
  EXPECT_EQ(page.result(), http::status::ok);
  EXPECT_EQ(page.body(), "the page");
  EXPECT_EQ(page[http::field::content_type], "text/html");
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

TEST_F(Web, SendsTheNewestOfEachThingToEveryViewer) {
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

TEST_F(Web, HearsRequestsAndSurvivesRubbish) {
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

TEST_F(Web, ClosesOnAMessageThatIsFarTooLong) {
  auto viewer = follow();
  EXPECT_TRUE(becomes([&] { return feed.viewers() == 1; }));
  // The head of a masked frame of a gigabyte, by hand, and its begin.
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

TEST_F(Web, ForgetsAViewerThatVanishes) {
  {
    auto viewer = follow();
    EXPECT_TRUE(becomes([&] { return feed.viewers() == 1; }));
    viewer.next_layer().set_option(asio::socket_base::linger(true, 0));  // as when a cable is pulled
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
  for (int i = 0; i < 100; ++i) {  // more than any socket's buffers hold
    feed.set("large", large);
    feed.set("number", std::to_string(i), true);
    while (read(quick) != std::to_string(i)) {
    }
  }
  // The slow one gets what was on its way, and then at once the newest.
  int messages = 0;
  for (std::string last; last != "99"; ++messages) last = read(slow);
  EXPECT_LT(messages, 60);
}

TEST(Server, TellsThatAPortIsInUse) {
  const Server first(0, {}, nullptr);
  const int port = std::stoi(first.url().substr(first.url().find(':', 7) + 1));
  EXPECT_NE(error_of([&] {
              const Server second(port, {}, nullptr);
            }).find("port " + std::to_string(port) + " cannot be used"),
            std::string::npos);
}

}  // namespace
}  // namespace cairn
