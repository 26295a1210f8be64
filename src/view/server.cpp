// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/server.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

// clang-format off: Boost 1.74's awaitable.hpp needs this and forgets it
#include <utility>
// clang-format on
#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <optional>
#include <random>
#include <stdexcept>
#include <thread>

namespace cairn {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using namespace std::chrono_literals;
using asio::ip::tcp;
using WebSocket = beast::websocket::stream<beast::tcp_stream>;

constexpr auto kLook = 15ms;               // between looks for something new
constexpr std::size_t kMaxMessage = 4096;  // bytes that a viewer may send at once
constexpr std::size_t kMaxHeader = 16384;  // bytes

std::string random_token() {
  std::random_device random;
  std::string token;
  for (int i = 0; i < 4; ++i) token += fmt::format("{:08x}", random());
  return token;
}

/// Takes as long whatever the two differ in, so that a token cannot be guessed letter by letter.
bool is_same(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  volatile unsigned char difference = 0;
  for (std::size_t i = 0; i < a.size(); ++i) difference = difference | static_cast<unsigned char>(a[i] ^ b[i]);
  return difference == 0;
}

/// One more as long as it lives, however its scope is left.
class Counted {
 public:
  explicit Counted(int& count) : count_(count) { ++count_; }
  ~Counted() { --count_; }
  Counted(const Counted&) = delete;
  Counted& operator=(const Counted&) = delete;

 private:
  int& count_;
};

class Viewing {
 public:
  explicit Viewing(Feed& feed) : feed_(feed) { feed_.enter(); }
  ~Viewing() { feed_.leave(); }
  Viewing(const Viewing&) = delete;
  Viewing& operator=(const Viewing&) = delete;

 private:
  Feed& feed_;
};

using Request = http::request<http::empty_body>;

/// Where the server is found, and whether a request is for it.
struct Address {
  std::string token, host, other_host;

  [[nodiscard]] bool is_ours(const Request& request) const {
    const auto is = [&](beast::string_view address) { return address == host || address == other_host; };
    if (!is(request[http::field::host])) return false;
    if (request.count(http::field::origin) == 0) return true;
    beast::string_view origin = request[http::field::origin];
    constexpr beast::string_view kScheme = "http://";
    if (!origin.starts_with(kScheme)) return false;
    origin.remove_prefix(kScheme.size());
    return is(origin);
  }

  /// The name below the token that a request asks for, or nothing.
  [[nodiscard]] std::optional<std::string> name_of(const Request& request) const {
    const std::string_view target(request.target().data(), request.target().size());
    const std::string prefix = "/" + token + "/";
    if (!is_same(target.substr(0, prefix.size()), prefix)) return std::nullopt;
    return std::string(target.substr(prefix.size(), target.find('?') - prefix.size()));
  }
};

// Answers over HTTP. `patience`: with a client that does not read.

template <class Response>
void prepare(Response& response, const Request& request, beast::string_view content_type) {
  response.set(http::field::content_type, content_type);
  response.set(http::field::cache_control, "no-store");
  response.set("X-Content-Type-Options", "nosniff");
  response.set("Referrer-Policy", "no-referrer");
  response.set(
      "Content-Security-Policy",
      "default-src 'self' 'unsafe-inline' 'wasm-unsafe-eval' data: blob:; frame-ancestors 'none'; base-uri 'none'");
  response.keep_alive(request.keep_alive());
  response.prepare_payload();
}

/// HEAD gets the same answer as GET without its body.
template <class Response>
asio::awaitable<void> send(beast::tcp_stream& stream, const Request& request, Response& response,
                           std::chrono::milliseconds patience) {
  http::serializer<false, typename Response::body_type> serializer(response);
  if (request.method() == http::verb::head) {
    stream.expires_after(patience);
    co_await http::async_write_header(stream, serializer, asio::use_awaitable);
    co_return;
  }
  // A large file may take long, but some of it must go through all the time.
  while (!serializer.is_done()) {
    stream.expires_after(patience);
    co_await http::async_write_some(stream, serializer, asio::use_awaitable);
  }
}

asio::awaitable<void> refuse(beast::tcp_stream& stream, const Request& request, http::status status, const char* why,
                             std::chrono::milliseconds patience) {
  http::response<http::string_body> response(status, request.version(), std::string(why) + "\n");
  prepare(response, request, "text/plain");
  co_await send(stream, request, response, patience);
}

asio::awaitable<void> serve(beast::tcp_stream& stream, const Request& request, const Served& file,
                            std::chrono::milliseconds patience) {
  if (const auto* text = std::get_if<std::string>(&file.body)) {
    http::response<http::string_body> response(http::status::ok, request.version(), *text);
    prepare(response, request, file.content_type);
    co_await send(stream, request, response, patience);
    co_return;
  }
  http::response<http::file_body> response(http::status::ok, request.version());
  boost::system::error_code error;
  const auto& path = std::get<std::filesystem::path>(file.body);
  response.body().open(path.c_str(), beast::file_mode::scan, error);
  if (error) {
    co_await refuse(stream, request, http::status::not_found, "the file is gone", patience);
    co_return;
  }
  prepare(response, request, file.content_type);
  co_await send(stream, request, response, patience);
}

}  // namespace

struct Server::State {
  State(int port, std::map<std::string, Served> f, Feed* feed_, const ServerLimits& l)
      : files(std::move(f)), feed(feed_), limits(l) {
    try {
      acceptor = tcp::acceptor(context, {asio::ip::address_v4::loopback(), static_cast<std::uint16_t>(port)});
    } catch (const boost::system::system_error& error) {
      throw std::runtime_error(fmt::format("port {} cannot be used: {}; choose another one, or 0 for any free one",
                                           port, error.code().message()));
    }
    const auto real_port = acceptor.local_endpoint().port();
    address = {random_token(), fmt::format("127.0.0.1:{}", real_port), fmt::format("localhost:{}", real_port)};
    spawn(accept());
    thread = std::jthread([this] { run(); });
  }
  ~State() { context.stop(); }

  void run() {
    while (!context.stopped()) try {
        context.run();
      } catch (const std::exception& error) {
        spdlog::warn(fmt::format("view: {}; it goes on", error.what()));
      }
  }

  /// Beside the others. An exception ends what is spawned, and nothing else.
  void spawn(asio::awaitable<void> work) {
    asio::co_spawn(context, std::move(work), [](const std::exception_ptr& problem) {
      try {
        if (problem) std::rethrow_exception(problem);
      } catch (const boost::system::system_error&) {
        // The client went away, or sent what no browser sends: nobody is left to be told.
      } catch (const std::exception& error) {
        spdlog::warn(fmt::format("view: {}; one connection is closed", error.what()));
      }
    });
  }

  asio::awaitable<void> accept() {
    while (true) {
      boost::system::error_code error;
      tcp::socket socket = co_await acceptor.async_accept(asio::redirect_error(asio::use_awaitable, error));
      if (error)
        co_await pause(100ms);  // no file descriptor is left, perhaps
      else if (connections < limits.connections)
        spawn(talk(beast::tcp_stream(std::move(socket))));
    }
  }

  static asio::awaitable<void> pause(std::chrono::milliseconds time) {
    asio::steady_timer timer(co_await asio::this_coro::executor, time);
    co_await timer.async_wait(asio::use_awaitable);
  }

  /// Whether a request that is for this server follows the feed.
  [[nodiscard]] bool asks_for_feed(const Request& request) const {
    return feed != nullptr && address.name_of(request) == "live" && beast::websocket::is_upgrade(request);
  }

  asio::awaitable<void> talk(beast::tcp_stream stream) {
    const Counted counted(connections);
    beast::flat_buffer buffer;
    while (true) {
      stream.expires_after(limits.patience);  // for all of the request, however slowly it drips
      http::request_parser<http::empty_body> parser;
      parser.header_limit(kMaxHeader);
      parser.body_limit(std::uint64_t{0});
      co_await http::async_read(stream, buffer, parser, asio::use_awaitable);
      const Request request = parser.release();
      if (address.is_ours(request) && asks_for_feed(request) && feed->viewers() < limits.viewers) {
        stream.expires_never();  // the WebSocket has its own
        co_await follow(WebSocket(std::move(stream)), request);
        co_return;
      }
      co_await answer(stream, request);
      if (!request.keep_alive()) break;
    }
    boost::system::error_code ignored;
    stream.socket().shutdown(tcp::socket::shutdown_send, ignored);
  }

  asio::awaitable<void> answer(beast::tcp_stream& stream, const Request& request) const {
    const auto refused = [&](http::status status, const char* why) {
      return refuse(stream, request, status, why, limits.patience);
    };
    const auto name = address.name_of(request);
    if (!address.is_ours(request))
      co_await refused(http::status::forbidden, "this page is served to this machine only");
    else if (!name)
      co_await refused(http::status::not_found, "open the address that cairn printed");
    else if (asks_for_feed(request))
      co_await refused(http::status::service_unavailable, "too many viewers");
    else if (request.method() != http::verb::get && request.method() != http::verb::head)
      co_await refused(http::status::method_not_allowed, "only GET is answered");
    else if (const auto file = files.find(*name); file == files.end())
      co_await refused(http::status::not_found, "there is no such file");
    else
      co_await serve(stream, request, file->second, limits.patience);
  }

  /// Sends what is new until the viewer goes; listens at the same time.
  asio::awaitable<void> follow(WebSocket socket, const Request& request) {
    socket.set_option(beast::websocket::stream_base::timeout{limits.patience, limits.patience, true});
    socket.read_message_max(kMaxMessage);
    socket.auto_fragment(false);
    co_await socket.async_accept(request, asio::use_awaitable);
    const auto shared = std::make_shared<WebSocket>(std::move(socket));
    const Viewing viewing(*feed);
    spawn(listen(shared));
    std::uint64_t version = 0;
    while (shared->is_open()) {
      const auto items = feed->since(version);
      if (items.empty()) co_await pause(kLook);
      // One at a time: after each, newer versions of the others are what should be sent.
      if (!items.empty()) {
        const Feed::Item& item = items.front();
        version = item.version;
        shared->text(item.is_text);
        co_await shared->async_write(asio::buffer(*item.bytes), asio::use_awaitable);
      }
    }
  }

  /// Until the viewer says goodbye, or too much: Beast closes the connection then.
  asio::awaitable<void> listen(std::shared_ptr<WebSocket> socket) {
    while (true) {
      beast::flat_buffer buffer;
      co_await socket->async_read(buffer, asio::use_awaitable);
      if (socket->got_text()) feed->ask(beast::buffers_to_string(buffer.data()));
    }
  }

  std::map<std::string, Served> files;
  Feed* feed;
  ServerLimits limits;
  int connections = 0;  // at the moment; of the thread alone
  Address address;
  asio::io_context context{1};
  tcp::acceptor acceptor{context};
  std::jthread thread;  // last: it uses the others
};

Server::Server(int port, std::map<std::string, Served> files, Feed* feed, const ServerLimits& limits)
    : state_(std::make_unique<State>(port, std::move(files), feed, limits)) {}
Server::~Server() = default;

std::string Server::url() const { return "http://" + state_->address.host + "/" + state_->address.token + "/"; }

void Server::add(std::map<std::string, Served> files) {
  // In the thread that reads them, before what it sends later.
  asio::post(state_->context, [this, added = std::move(files)]() mutable { state_->files.merge(added); });
}

}  // namespace cairn
