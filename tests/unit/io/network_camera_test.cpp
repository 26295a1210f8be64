// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/sensors/network_camera.hpp"

#include <gtest/gtest.h>

#include <boost/beast/http.hpp>
#include <cstring>
#include <future>
#include <iostream>

#include "support/files.hpp"
#include "support/network_client.hpp"

namespace cairn {
namespace {

using Json = nlohmann::json;
namespace http = boost::beast::http;

class NetworkCamera : public testing::TestWithParam<const char*> {
 protected:
  NetworkCamera() { testing::internal::CaptureStdout(); }
  ~NetworkCamera() override {
    log += testing::internal::GetCapturedStdout();
    if (HasFailure()) std::cout << log;
  }

  /// Messages so far; the log is on the standard output.
  const std::string& logged() {
    log += testing::internal::GetCapturedStdout();
    testing::internal::CaptureStdout();
    return log;
  }
  /// Opens the source; the client sends its hello meanwhile.
  void start(const Json& hello = small_hello()) {
    auto opening = std::async(std::launch::async, [&] { return open_source(input, {.tracking = tracking}); });
    client.emplace(input);
    EXPECT_EQ(client->ask(message_of(hello)), (Json{{"cairn", 1}, {"state", "ready"}}));
    source = opening.get();
  }
  /// Next frame with images, and its answer.
  Frame next(Json& answer) {
    std::optional<Frame> frame;
    do frame = source->next();
    while (frame && frame->problem);
    if (sending.valid()) sending.get();
    answer = client->answer();
    return frame ? *frame : Frame();
  }
  void send_frame(int number) { client->send(message_of(small_frame(number), small_depth())); }
  /// Expects that a message is refused, and that the next client continues.
  void expect_refused(const std::string& bytes, const std::string& what, bool is_raw = false) {
    SCOPED_TRACE(what);
    is_raw ? client->send_bytes(bytes) : client->send(bytes);
    expect_dropped(what);
  }
  void expect_dropped(const std::string& what) {
    auto frame = source->next();
    ASSERT_TRUE(frame);
    EXPECT_TRUE(frame->problem);
    EXPECT_TRUE(frame->depth.empty());
    const Json answer = client->answer();
    ASSERT_TRUE(answer.contains("error")) << answer;
    EXPECT_NE(answer["error"].get<std::string>().find(what), std::string::npos) << answer;
    EXPECT_NE(logged().find(what), std::string::npos) << log;
    EXPECT_TRUE(client->answer().is_null());
    connect_again();
  }
  void connect_again() {
    client.emplace(input);
    client->send(message_of(small_hello()));
    send_frame_later(0);
    Json answer;
    EXPECT_EQ(next(answer).depth.size(), 256u);
  }
  /// Sends a frame after the answer to the hello.
  void send_frame_later(int number) {
    sending = std::async(std::launch::async, [this, number] {
      EXPECT_TRUE(client->answer().contains("cairn"));
      send_frame(number);
    });
  }

  std::string input = GetParam() + std::to_string(free_port());
  std::shared_ptr<TrackingState> tracking = std::make_shared<TrackingState>();
  std::string log;
  std::optional<NetworkClient> client;
  std::unique_ptr<Source> source;
  std::future<void> sending;
};
INSTANTIATE_TEST_SUITE_P(Each, NetworkCamera, testing::Values("tcp:", "ws:"),
                         [](const auto& input) { return std::string(input.param, strlen(input.param) - 1); });

TEST_P(NetworkCamera, DeliversFramesAndAnswersTheirNumbersAndTheState) {
  start();
  EXPECT_EQ(source->rig().depth.width, 16);
  EXPECT_TRUE(is_sensor(input));
  Json answer;
  send_frame(3);
  const Frame first = next(answer);
  EXPECT_EQ(answer, (Json{{"frame", 3}, {"state", "received"}, {"dropped", 0}}));
  EXPECT_EQ(first.index, 0);
  EXPECT_EQ(first.timestamp, 0.1);
  EXPECT_EQ(first.depth, std::vector<float>(256, 1000 * 0.001f));
  tracking->is = TrackingState::Is::lost;
  tracking->dropped = 7;
  Json header = small_frame(5);
  header["pose"] = {1, 2, 3, 0, 0, 0, 1};
  header["gyro"] = Json::array({{0.15, 1, 2, 3}});
  client->send(message_of(header, small_depth()));
  const Frame second = next(answer);
  EXPECT_EQ(answer, (Json{{"frame", 5}, {"state", "lost"}, {"dropped", 7}}));
  ASSERT_TRUE(second.guess);
  EXPECT_EQ(second.guess->translation(), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(second.gyro.size(), 1u);
  EXPECT_EQ(source->dropped(), 1) << "number 4";
}

TEST_P(NetworkCamera, EndsAfterTheClientsEnd) {
  start();
  auto end = std::async(std::launch::async, [&] { return client->ask(message_of(Json{{"end", true}})); });
  EXPECT_FALSE(source->next());
  EXPECT_FALSE(source->next());
  EXPECT_EQ(end.get(), (Json{{"end", true}}));
  EXPECT_FALSE(source->ended_early());
}

TEST_P(NetworkCamera, FramesWithoutTimesHaveTheirTimeOfArrival) {
  start();
  Json answer, header = small_frame(0);
  header.erase("time");
  client->send(message_of(header, small_depth()));
  const double first = next(answer).timestamp;
  header["frame"] = 1;
  client->send(message_of(header, small_depth()));
  EXPECT_GT(next(answer).timestamp, first);
}

TEST_P(NetworkCamera, WaitsForADisconnectedClient) {
  start();
  Json answer;
  send_frame(0);
  const Frame first = next(answer);
  client->close();
  const auto waiting = source->next();
  ASSERT_TRUE(waiting && waiting->problem);
  EXPECT_EQ(*waiting->problem, input + ": no client is connected");
  client.emplace(input);
  client->send(message_of(small_hello()));
  send_frame_later(0);
  const Frame after = next(answer);
  EXPECT_EQ(after.depth.size(), 256u);
  EXPECT_GT(after.timestamp, first.timestamp + 0.5) << "seconds of the computer's clock";
}

TEST_P(NetworkCamera, RefusesASecondClient) {
  start();
  NetworkClient second(input);
  EXPECT_NE(second.ask(message_of(small_hello()))["error"].get<std::string>().find("another client, 127.0.0.1"),
            std::string::npos);
  EXPECT_TRUE(second.answer().is_null());
  Json answer;
  send_frame(0);
  EXPECT_EQ(next(answer).depth.size(), 256u);
}

TEST_P(NetworkCamera, DropsAClientThatBreaksTheProtocolAndWaitsForTheNext) {
  start();
  Json answer;
  send_frame(5);
  (void)next(answer);
  expect_refused(message_of(small_frame(5), small_depth()), "message 2: `frame` is 5 after 5");
  expect_refused(message_of(small_frame(1), small_depth().substr(1)), "message 2: depth: `bytes` is 512");
  expect_refused(std::string(100, '\x7f'), "message 2: the header's size");
  expect_refused(message_of(small_hello()), "a second hello");
  expect_refused(std::string(2 << 20, '\0'), "allowed: 1050884");
}

TEST_P(NetworkCamera, RefusesHellosBeforeTheFirstClient) {
  auto opening = std::async(std::launch::async, [&] { return open_source(input); });
  const auto refusal = [&](const std::string& message) {
    NetworkClient wrong(input);
    const Json answer = wrong.ask(message);
    EXPECT_TRUE(wrong.answer().is_null());
    return answer.value("error", "no error");
  };
  EXPECT_NE(refusal("x").find("the message has 1 bytes"), std::string::npos);
  EXPECT_NE(refusal(message_of(small_frame(0), small_depth())).find("not a hello"), std::string::npos);
  EXPECT_NE(refusal(std::string(200'000, ' ')).find("allowed: 131072"), std::string::npos);
  client.emplace(input);
  EXPECT_TRUE(client->ask(message_of(small_hello())).contains("cairn"));
  source = opening.get();
}

TEST_P(NetworkCamera, RefusesAnotherCamera) {
  start();
  client->close();
  ASSERT_TRUE(source->next()->problem);
  Json hello = small_hello();
  hello["camera"]["fx"] = 17;
  NetworkClient other(input);
  EXPECT_EQ(other.ask(message_of(hello))["error"],
            "its cameras (16x16, fx 17) differ from the run's (16x16, fx 16): send the same, or start another run");
  connect_again();
}

TEST_P(NetworkCamera, RefusesNamesWithoutAPort) {
  const std::string scheme = GetParam();
  for (const char* rest : {"", "x", "-1", "65536", ":1", "1 2", "host:"})
    EXPECT_NE(error_of([&] { (void)open_source(scheme + rest); }).find("use " + scheme + "PORT or "),
              std::string::npos);
  EXPECT_NE(error_of([&] { (void)open_source(scheme + "203.0.113.1:0"); }).find("cannot be used"), std::string::npos);
}

class TcpCamera : public NetworkCamera {};
INSTANTIATE_TEST_SUITE_P(Tcp, TcpCamera, testing::Values("tcp:0.0.0.0:"));

TEST_P(TcpCamera, NeedsTheTokenBeyondThisMachine) {
  auto opening = std::async(std::launch::async, [&] { return open_source(input); });
  Json hello = small_hello();
  {
    NetworkClient wrong(input);
    EXPECT_NE(wrong.ask(message_of(hello))["error"].get<std::string>().find("the token is wrong or missing"),
              std::string::npos);
  }
  const std::string& all = logged();
  hello["token"] = all.substr(all.find("token ") + 6, 32);
  client.emplace(input);
  EXPECT_TRUE(client->ask(message_of(hello)).contains("cairn")) << all;
  source = opening.get();
}

TEST_P(TcpCamera, RefusesAnOversizedLength) {
  auto opening = std::async(std::launch::async, [&] { return open_source(input); });
  NetworkClient wrong(input);
  wrong.send_bytes("\xff\xff\xff\xff");
  EXPECT_NE(
      wrong.answer()["error"].get<std::string>().find("the message has 4294967295 bytes or more, allowed: 131072"),
      std::string::npos);
  NetworkClient empty(input);
  empty.send_bytes(std::string(4, '\0'));
  EXPECT_NE(empty.answer()["error"].get<std::string>().find("the message is empty"), std::string::npos);
  const std::string& all = logged();
  Json hello = small_hello();
  hello["token"] = all.substr(all.find("token ") + 6, 32);
  client.emplace(input);
  client->send(message_of(hello));
  source = opening.get();
}

class WebSocketCamera : public NetworkCamera {
 protected:
  http::response<http::string_body> get(const std::string& target) {
    boost::asio::io_context context;
    boost::asio::ip::tcp::socket socket(context);
    const std::string port = input.substr(input.rfind(':') + 1);
    socket.connect({boost::asio::ip::address_v4::loopback(), static_cast<std::uint16_t>(std::stoi(port))});
    http::request<http::empty_body> request(http::verb::get, target, 11);
    request.set(http::field::host, "127.0.0.1:" + port);
    http::write(socket, request);
    boost::beast::flat_buffer buffer;
    http::response<http::string_body> response;
    http::read(socket, buffer, response);
    return response;
  }
};
INSTANTIATE_TEST_SUITE_P(WebSocket, WebSocketCamera, testing::Values("ws:"));

TEST_P(WebSocketCamera, PageShowsTheState) {
  start();
  EXPECT_NE(get("/").body().find("<title>Cairn"), std::string::npos);
  EXPECT_EQ(get("/color.jpg").result(), http::status::internal_server_error);
  Json header = small_frame(0), answer;
  header["color"] = {{"format", "rgb8"}, {"bytes", 768}};
  client->send(message_of(header, small_depth() + std::string(768, '\x40')));
  (void)next(answer);
  tracking->is = TrackingState::Is::tracking;
  Json state = Json::parse(get("/state.json").body());
  EXPECT_EQ(state["state"], "tracking");
  EXPECT_EQ(state["frames"], 1);
  EXPECT_EQ(state["client"], "127.0.0.1");
  EXPECT_EQ(get("/color.jpg").body().substr(0, 2), "\xff\xd8");
  client->close();
  ASSERT_TRUE(source->next()->problem);
  state = Json::parse(get("/state.json").body());
  EXPECT_EQ(state["state"], "waiting");
}

}  // namespace
}  // namespace cairn
