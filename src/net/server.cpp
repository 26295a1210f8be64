// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "net/server.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

// clang-format off: Boost 1.74's awaitable.hpp needs this and forgets it
#include <utility>
// clang-format on
#include <algorithm>
#include <atomic>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/thread_pool.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/core/detect_ssl.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/ssl.hpp>
#include <boost/beast/websocket.hpp>
#include <boost/beast/websocket/ssl.hpp>
#include <charconv>
#include <chrono>
#include <optional>
#include <set>
#include <stdexcept>
#include <thread>

#include "base/json_text.hpp"
#include "net/addresses.hpp"
#include "net/certificate.hpp"
#include "net/file_below.hpp"
#include "net/sent_messages.hpp"
#include "net/token.hpp"

namespace cairn {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using namespace std::chrono_literals;
using asio::ip::tcp;
using Plain = beast::tcp_stream;
using Secure = beast::ssl_stream<beast::tcp_stream>;

constexpr auto kPollInterval = 15ms;                        // polling interval of the feed
constexpr auto kAnswerInterval = 2ms;                       // polling interval of the answers to a sender
constexpr std::size_t kMaxMessage = 4096;                   // maximum bytes of a viewer's message
constexpr std::size_t kMaxHeader = 16384;                   // bytes
constexpr std::size_t kChunkSize = std::size_t{256} << 10;  // bytes of a file per write
constexpr std::size_t kMinCompressedSize = 1024;            // bytes

/// A connection. The server may close it for a newer connection: before it has sent the token at any time, later only
/// between requests.
struct Peer {
  std::string network;      // address; for IPv6 the first 64 bits, shared by a household or machine
  Plain* stream = nullptr;  // closed by the server; null before the first read and after an upgrade to WebSocket
  bool is_known = false;    // has sent the token
  bool is_idle = true;      // between two requests
  bool is_closed = false;   // its coroutine is about to end
  [[nodiscard]] bool is_stranger() const { return !is_known && !is_closed; }
};

/// All connections, oldest first; connections with the token by their last request.
class Peers {
 public:
  explicit Peers(const ServerLimits& limits) : limits_(limits) {}

  /// Admits a connection, closing another if necessary; null if all connections have the token and are busy.
  std::shared_ptr<Peer> admit(const std::string& network) {
    const auto is_neighbor = [&](const Peer& p) { return p.is_stranger() && p.network == network; };
    if (count(is_neighbor) >= limits_.strangers) close_first(is_neighbor);
    if (count([](const Peer& p) { return !p.is_closed; }) >= limits_.connections && !make_room()) return nullptr;
    return peers_.emplace_back(std::make_shared<Peer>(Peer{.network = network}));
  }
  /// Closes the oldest connection without the token, or else the longest idle connection.
  bool make_room() {
    return close_first([](const Peer& p) { return p.is_stranger(); }) ||
           close_first([](const Peer& p) { return p.is_idle && !p.is_closed; });
  }
  void greet(const std::shared_ptr<Peer>& peer) {
    peer->is_known = true;
    const auto at = std::find(peers_.begin(), peers_.end(), peer);
    if (at != peers_.end()) std::rotate(at, at + 1, peers_.end());
  }
  void leave(const std::shared_ptr<Peer>& peer) { std::erase(peers_, peer); }

 private:
  template <class Is>
  [[nodiscard]] int count(const Is& is) const {
    return static_cast<int>(std::count_if(peers_.begin(), peers_.end(), [&](const auto& p) { return is(*p); }));
  }
  template <class Is>
  bool close_first(const Is& is) {
    const auto found = std::find_if(peers_.begin(), peers_.end(), [&](const auto& p) { return is(*p); });
    if (found == peers_.end()) return false;
    (*found)->is_closed = true;
    if ((*found)->stream != nullptr) (*found)->stream->close();
    return true;
  }

  ServerLimits limits_;
  std::vector<std::shared_ptr<Peer>> peers_;
};

/// Removes a connection when its scope ends.
class Present {
 public:
  Present(Peers& peers, std::shared_ptr<Peer> peer) : peers_(peers), peer_(std::move(peer)) {}
  ~Present() { peers_.leave(peer_); }
  Present(const Present&) = delete;
  Present& operator=(const Present&) = delete;

 private:
  Peers& peers_;
  std::shared_ptr<Peer> peer_;
};

std::string address_text(const tcp::socket& socket) {
  boost::system::error_code ignored;
  return socket.remote_endpoint(ignored).address().to_string();
}

std::string network_of(const tcp::socket& socket) {
  boost::system::error_code ignored;
  const asio::ip::address address = socket.remote_endpoint(ignored).address();
  if (address.is_v4()) return address.to_string();
  const auto v6 = address.to_v6();
  if (v6.is_v4_mapped()) return asio::ip::make_address_v4(asio::ip::v4_mapped, v6).to_string();
  constexpr std::ptrdiff_t kNetwork = 8;  // bytes
  const auto bytes = v6.to_bytes();
  return {bytes.begin(), bytes.begin() + kNetwork};
}

class Viewing {
 public:
  explicit Viewing(Feed& feed) : feed_(feed) { feed_.enter(); }
  ~Viewing() { feed_.leave(); }
  Viewing(const Viewing&) = delete;
  Viewing& operator=(const Viewing&) = delete;

 private:
  Feed& feed_;
};

class Sending {
 public:
  Sending(Inbox& inbox, int id) : inbox_(inbox), id_(id) {}
  ~Sending() { inbox_.leave(id_); }
  Sending(const Sending&) = delete;
  Sending& operator=(const Sending&) = delete;

 private:
  Inbox& inbox_;
  int id_;
};

using Request = http::request<http::empty_body>;
using Header = http::response<http::empty_body>;

/// Addresses of the server, and the check of requests against them.
struct Gate {
  std::string token, scheme;
  std::set<std::string> hosts;  // with ports

  [[nodiscard]] bool is_ours(const Request& request) const {
    const auto is = [&](beast::string_view host) { return hosts.count(std::string(host)) > 0; };
    if (!is(request[http::field::host])) return false;
    if (request.count(http::field::origin) == 0) return true;
    beast::string_view origin = request[http::field::origin];
    const std::string begin = scheme + "://";
    if (!origin.starts_with(begin)) return false;
    origin.remove_prefix(begin.size());
    return is(origin);
  }

  /// Name below the token in a request, if any.
  [[nodiscard]] std::optional<std::string> to_string(const Request& request) const {
    const std::string_view target(request.target().data(), request.target().size());
    const std::string prefix = token.empty() ? "/" : "/" + token + "/";
    if (!is_same_token(target.substr(0, prefix.size()), prefix)) return std::nullopt;
    return from_uri(std::string(target.substr(prefix.size(), target.find('?') - prefix.size())));
  }
};

/// Server entry of a file; text is shared with running responses.
struct Entry {
  std::string content_type, download;
  std::filesystem::path root;
  std::variant<Content, Make> body;
  bool is_packable = false;
  bool is_page = false;
};
Entry entry_of(Served served, bool is_page) {
  Entry entry{std::move(served.content_type),
              std::move(served.download),
              std::move(served.root),
              Content(),
              served.is_packable,
              is_page};
  if (auto* text = std::get_if<std::string>(&served.body))
    entry.body = Content(std::make_shared<const Text>(std::move(*text)));
  else if (auto* file = std::get_if<std::filesystem::path>(&served.body))
    entry.body = Content(std::move(*file));
  else
    entry.body = std::get<Make>(std::move(served.body));
  return entry;
}

/// Keyed by the names of to_string().
using Entries = std::map<std::string, std::shared_ptr<const Entry>>;
Entries entries_of(Server::Files&& files) {
  Entries entries;
  for (auto& [name, file] : files)
    entries[from_uri(name)] = std::make_shared<const Entry>(entry_of(std::move(file), name.empty()));
  return entries;
}

/// Byte range of a body, from `first` to `last`.
struct Range {
  std::uint64_t first = 0, last = 0;
};
/// Parses `bytes=…` of a Range header for a body of `size` bytes (RFC 9110, 14.1.2). Returns nullopt for unsupported
/// ranges, answered with the complete body; an empty range beyond the end.
std::optional<Range> range_of(beast::string_view text, std::uint64_t size) {
  std::string_view range(text.data(), text.size());
  constexpr std::string_view kBytes = "bytes=";
  if (!range.starts_with(kBytes)) return std::nullopt;
  range.remove_prefix(kBytes.size());
  const auto dash = range.find('-');
  if (dash == range.npos || range.find(',') != range.npos) return std::nullopt;
  const auto number = [](std::string_view digits) -> std::optional<std::uint64_t> {
    std::uint64_t value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (digits.empty() || error != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
    return value;
  };
  const auto first = number(range.substr(0, dash)), last = number(range.substr(dash + 1));
  const bool is_tail = dash == 0;
  if ((!first && !is_tail) || (!last && (is_tail || dash + 1 < range.size())) || (first && last && *last < *first))
    return std::nullopt;
  constexpr Range kNone{1, 0};
  if (is_tail) return *last == 0 || size == 0 ? kNone : Range{size - std::min(*last, size), size - 1};
  return *first >= size ? kNone : Range{*first, last ? std::min(*last, size - 1) : size - 1};
}

// HTTP responses. `patience`: timeout for a client that does not read.

constexpr const char* kPagePolicy =
    "default-src 'self' 'unsafe-inline' 'wasm-unsafe-eval' data: blob:; frame-ancestors 'none'; base-uri 'none'; "
    "form-action 'none'";
/// Policy for all content except the page: opened directly, it runs no code and has no origin.
constexpr const char* kOtherPolicy = "default-src 'none'; frame-ancestors 'none'; sandbox";

Header header_of(const Request& request, http::status status, const std::string& content_type, bool is_page = false) {
  Header header(status, request.version());
  header.set(http::field::content_type, content_type);
  header.set(http::field::cache_control, "no-store");
  header.set("X-Content-Type-Options", "nosniff");
  header.set("Referrer-Policy", "no-referrer");
  header.set("Cross-Origin-Resource-Policy", "same-origin");
  header.set("Content-Security-Policy", is_page ? kPagePolicy : kOtherPolicy);
  header.keep_alive(request.keep_alive());
  return header;
}

/// A large file may take long; the timeout applies to each write.
template <class Stream>
asio::awaitable<void> write_all(Stream& stream, asio::const_buffer rest, std::chrono::milliseconds patience) {
  while (rest.size() > 0) {
    beast::get_lowest_layer(stream).expires_after(patience);
    rest += co_await stream.async_write_some(rest, asio::use_awaitable);
  }
}

template <class Stream>
asio::awaitable<void> write_header(Stream& stream, Header& header, std::chrono::milliseconds patience) {
  http::serializer<false, http::empty_body> serializer(header);
  beast::get_lowest_layer(stream).expires_after(patience);
  co_await http::async_write_header(stream, serializer, asio::use_awaitable);
}

/// Short text response, such as an error. HEAD gets the headers of GET.
template <class Stream>
asio::awaitable<void> respond(Stream& stream, const Request& request, http::status status, std::string words,
                              std::chrono::milliseconds patience) {
  words += '\n';
  Header header = header_of(request, status, "text/plain; charset=utf-8");
  header.content_length(words.size());
  co_await write_header(stream, header, patience);
  if (request.method() != http::verb::head) co_await write_all(stream, asio::buffer(words), patience);
}

template <class Stream>
asio::awaitable<void> write_file(Stream& stream, beast::file& file, Range range, std::chrono::milliseconds patience) {
  std::vector<char> chunk(kChunkSize);
  boost::system::error_code error;
  file.seek(range.first, error);
  for (std::uint64_t left = range.last - range.first + 1; left > 0 && !error;) {
    const std::size_t size =
        file.read(chunk.data(), static_cast<std::size_t>(std::min<std::uint64_t>(chunk.size(), left)), error);
    if (size == 0) break;
    co_await write_all(stream, asio::buffer(chunk.data(), size), patience);
    left -= size;
    if (left == 0) co_return;
  }
  throw boost::system::system_error(http::error::partial_message);  // the file was truncated meanwhile
}

bool accepts_gzip(const Request& request) {
  return request[http::field::accept_encoding].find("gzip") != beast::string_view::npos;
}

/// Content-Disposition for a download with this name (RFC 6266, RFC 8187).
std::string attachment(const std::string& name) {
  if (name.empty()) return "attachment";
  std::string plain;
  for (const char c : name) plain += c >= ' ' && c <= '~' && c != '"' && c != '\\' && c != '%' ? c : '_';
  const std::string disposition = "attachment; filename=\"" + plain + "\"";
  return plain == name ? disposition : disposition + "; filename*=UTF-8''" + as_uri(as_utf8(name));
}

/// Opens a file within Served::root. Returns an error text.
std::string open_file(beast::file& file, const std::filesystem::path& path, const std::filesystem::path& root) {
  try {
    FileBelow below(root.empty() ? path.parent_path() : root,
                    root.empty() ? path.filename() : path.lexically_relative(root));
    file.native_handle(below.release());
    return {};
  } catch (const std::runtime_error& error) {
    return error.what();
  }
}

/// `is_far`: the connection is slow enough for compression.
template <class Stream>
asio::awaitable<void> serve(Stream& stream, const Request& request, const Entry& entry, Content content, bool is_far,
                            std::chrono::milliseconds patience) {
  Header header = header_of(request, http::status::ok, entry.content_type, entry.is_page);
  if (!entry.is_page) header.set(http::field::content_disposition, attachment(entry.download));
  const std::string* bytes = nullptr;
  beast::file file;
  std::uint64_t size = 0;
  bool is_packed = false;
  boost::system::error_code error;
  if (const auto* text = std::get_if<std::shared_ptr<const Text>>(&content)) {
    is_packed = entry.is_packable && is_far && (*text)->bytes().size() > kMinCompressedSize && accepts_gzip(request);
    bytes = is_packed ? &(*text)->packed() : &(*text)->bytes();
    size = bytes->size();
  } else {
    const std::string problem = open_file(file, std::get<std::filesystem::path>(content), entry.root);
    if (!problem.empty()) spdlog::warn(fmt::format("view: {}", problem));
    if (problem.empty()) size = file.size(error);
    if (!problem.empty() || error)
      co_return co_await respond(stream, request, http::status::not_found,
                                 "the file no longer exists, or is not a file", patience);
  }
  if (is_packed) header.set(http::field::content_encoding, "gzip");
  if (entry.is_packable) header.set(http::field::vary, "Accept-Encoding");
  header.set(http::field::accept_ranges, is_packed ? "none" : "bytes");
  Range range{0, size - 1};
  const bool is_part = request.count(http::field::range) > 0 && request.count(http::field::if_range) == 0 && !is_packed;
  if (const auto requested = is_part ? range_of(request[http::field::range], size) : std::nullopt) {
    const bool is_satisfiable = requested->first <= requested->last;
    header.result(is_satisfiable ? http::status::partial_content : http::status::range_not_satisfiable);
    header.set(http::field::content_range, is_satisfiable
                                               ? fmt::format("bytes {}-{}/{}", requested->first, requested->last, size)
                                               : fmt::format("bytes */{}", size));
    if (is_satisfiable) range = *requested;
    size = is_satisfiable ? range.last - range.first + 1 : 0;
  }
  header.content_length(size);
  co_await write_header(stream, header, patience);
  if (request.method() == http::verb::head || size == 0) co_return;
  if (bytes != nullptr)
    co_await write_all(stream, asio::buffer(bytes->data() + range.first, static_cast<std::size_t>(size)), patience);
  else
    co_await write_file(stream, file, range, patience);
}

std::string in_url(const std::string& address) {
  return address.find(':') == std::string::npos ? address : "[" + address + "]";
}

/// Error for an unusable address, with the machine's addresses.
std::runtime_error unusable_address(const std::string& host, const std::string& why) {
  std::vector<std::string> ours;
  for (const NetworkAddress& a : network_addresses()) ours.push_back(fmt::format("{} ({})", a.address, a.interface));
  return std::runtime_error(
      fmt::format("address {} cannot be used: {}; this machine has {}; use 0.0.0.0 for all of them", host, why,
                  ours.empty() ? "no address in a network" : fmt::format("{}", fmt::join(ours, ", "))));
}

asio::ip::address address_of(const std::string& host) {
  if (host.empty() || host == "localhost") return asio::ip::address_v4::loopback();
  boost::system::error_code error;
  auto address = asio::ip::make_address(host, error);
  if (error) throw unusable_address(host, "it is not an IP address");
  return address;
}

/// Addresses for clients, most likely first, of a server listening on `listened`.
std::vector<NetworkAddress> client_addresses(const asio::ip::address& listened) {
  if (!listened.is_unspecified()) return {{listened.to_string(), ""}};
  std::vector<NetworkAddress> all = network_addresses();
  if (listened.is_v4())
    all.erase(std::remove_if(all.begin(), all.end(),
                             [](const NetworkAddress& a) { return a.address.find(':') != std::string::npos; }),
              all.end());
  all.push_back({"127.0.0.1", "this machine"});
  return all;
}

}  // namespace

struct Server::State {
  State(const ViewerAddress& at, Files&& given, Feed* feed_, const ServerLimits& l, const Inlet& i)
      : files(entries_of(std::move(given))), feed(feed_), limits(l), inlet(i) {
    const asio::ip::address host = address_of(at.host);
    listen(host, at.port);
    const auto reachable = client_addresses(host);
    gate.scheme = inlet.is_tcp ? "tcp" : host.is_loopback() ? "http" : "https";
    gate.token = inlet.inbox == nullptr ? random_token() : inlet.token;
    const std::string path = inlet.is_tcp ? "" : gate.token.empty() ? "/" : "/" + gate.token + "/";
    const auto port = acceptor.local_endpoint().port();
    for (const NetworkAddress& a : reachable) {
      const std::string found = fmt::format("{}:{}", in_url(a.address), port);
      gate.hosts.insert(found);
      site.urls.push_back({.url = fmt::format("{}://{}{}", gate.scheme, found, path), .interface = a.interface});
    }
    if (host.is_loopback() || host.is_unspecified()) gate.hosts.insert(fmt::format("localhost:{}", port));
    if (!host.is_loopback() && !inlet.is_tcp) secure(at, reachable);
    spawn(accept());
    thread = std::jthread([this] { run(); });
  }
  ~State() {
    context.stop();
    for (asio::thread_pool* pool : {&quick, &slow}) pool->stop();
  }

  void listen(const asio::ip::address& host, int port) try {
    acceptor = tcp::acceptor(context, {host, static_cast<std::uint16_t>(port)});
  } catch (const boost::system::system_error& error) {
    if (error.code() == boost::system::errc::address_not_available)
      throw unusable_address(host.to_string(), error.code().message());
    throw std::runtime_error(fmt::format("port {} cannot be used: {}; choose another port, or 0 for any free port",
                                         port, error.code().message()));
  }

  /// Enables TLS.
  void secure(const ViewerAddress& at, const std::vector<NetworkAddress>& reachable) {
    std::vector<std::string> addresses;
    addresses.reserve(reachable.size());
    for (const NetworkAddress& a : reachable) addresses.push_back(a.address);
    std::filesystem::path folder = at.certificates.empty() ? state_folder() : at.certificates;
    const Certificate certificate =
        certificate_for(addresses, folder.empty() ? folder : folder / ("view-" + at.host + ".pem"));
    site.fingerprint = certificate.fingerprint;
    tls.emplace(asio::ssl::context::tls_server);
    tls->set_options(asio::ssl::context::default_workarounds | asio::ssl::context::no_tlsv1 |
                     asio::ssl::context::no_tlsv1_1);
    tls->use_certificate(asio::buffer(certificate.pem), asio::ssl::context::pem);
    tls->use_private_key(asio::buffer(certificate.pem), asio::ssl::context::pem);
  }

  void run() {
    while (!context.stopped()) try {
        context.run();
      } catch (const std::exception& error) {
        spdlog::warn(fmt::format("view: {}; the server continues", error.what()));
      }
  }

  /// Starts a coroutine. An exception ends only this coroutine.
  void spawn(asio::awaitable<void> work) {
    asio::co_spawn(context, std::move(work), [](const std::exception_ptr& problem) {
      try {
        if (problem) std::rethrow_exception(problem);
      } catch (const boost::system::system_error&) {
        // The client disconnected or sent invalid data.
      } catch (const std::exception& error) {
        spdlog::warn(fmt::format("view: {}; one connection is closed", error.what()));
      }
    });
  }

  asio::awaitable<void> accept() {
    while (true) {
      boost::system::error_code error;
      tcp::socket socket = co_await acceptor.async_accept(asio::redirect_error(asio::use_awaitable, error));
      if (error) {
        peers.make_room();  // possibly out of file descriptors
        co_await pause(100ms);
      } else if (auto peer = peers.admit(network_of(socket))) {
        spawn(greet(std::move(socket), std::move(peer)));
      }
    }
  }

  static asio::awaitable<void> pause(std::chrono::milliseconds time) {
    asio::steady_timer timer(co_await asio::this_coro::executor, time);
    co_await timer.async_wait(asio::use_awaitable);
  }

  asio::awaitable<void> greet(tcp::socket socket, std::shared_ptr<Peer> peer) {
    const Present present(peers, peer);
    if (peer->is_closed) co_return;
    boost::system::error_code ignored;
    socket.set_option(tcp::no_delay(true), ignored);
    const bool is_far = !socket.remote_endpoint(ignored).address().is_loopback();
    Plain plain(std::move(socket));
    peer->stream = &plain;
    plain.expires_after(limits.greeting);  // limit for everything before the token
    if (inlet.is_tcp) {
      TcpMessages messages(plain);
      co_return co_await receive(messages, peer, address_text(plain.socket()));
    }
    beast::flat_buffer buffer;
    if (!tls) {
      if (co_await talk(plain, buffer, peer, is_far)) plain.socket().shutdown(tcp::socket::shutdown_send, ignored);
      co_return;
    }
    if (!co_await beast::async_detect_ssl(plain, buffer, asio::use_awaitable)) {
      co_await refuse_plain(plain, buffer);
      plain.socket().shutdown(tcp::socket::shutdown_send, ignored);
      co_return;
    }
    Secure secure(std::move(plain), *tls);
    peer->stream = &secure.next_layer();
    buffer.consume(co_await secure.async_handshake(asio::ssl::stream_base::server, buffer.data(), asio::use_awaitable));
    if (!co_await talk(secure, buffer, peer, is_far)) co_return;
    secure.next_layer().expires_after(limits.patience);
    co_await secure.async_shutdown(asio::redirect_error(asio::use_awaitable, ignored));
  }

  /// Answers a plain HTTP request on the TLS port.
  asio::awaitable<void> refuse_plain(Plain& stream, beast::flat_buffer& buffer) const {
    const auto request = co_await read(stream, buffer);
    co_await respond(stream, request, http::status::bad_request,
                     "the address begins with https://: open the address printed by cairn", limits.patience);
  }

  template <class Stream>
  asio::awaitable<Request> read(Stream& stream, beast::flat_buffer& buffer) const {
    http::request_parser<http::empty_body> parser;
    parser.header_limit(kMaxHeader);
    parser.body_limit(std::uint64_t{0});
    co_await http::async_read(stream, buffer, parser, asio::use_awaitable);
    co_return parser.release();
  }

  /// Returns true if a valid request subscribes to the feed.
  [[nodiscard]] bool asks_for_feed(const Request& request) const {
    return feed != nullptr && gate.to_string(request) == "live" && beast::websocket::is_upgrade(request);
  }

  /// Returns true if a valid request opens a WebSocket for messages.
  [[nodiscard]] bool asks_to_send(const Request& request) const {
    return inlet.inbox != nullptr && gate.to_string(request) == "frames" && beast::websocket::is_upgrade(request);
  }

  /// Returns true if the caller must close the stream, false if a WebSocket has taken it.
  template <class Stream>
  asio::awaitable<bool> talk(Stream& stream, beast::flat_buffer& buffer, const std::shared_ptr<Peer>& peer,
                             bool is_far) {
    while (true) {
      Request request = co_await read(stream, buffer);
      peer->is_idle = false;
      if (gate.is_ours(request) && gate.to_string(request)) peers.greet(peer);
      if (!peer->is_known) request.keep_alive(false);
      if (gate.is_ours(request) && asks_for_feed(request) && feed->viewers() < limits.viewers) {
        beast::get_lowest_layer(stream).expires_never();  // the WebSocket has its own timeout
        peer->stream = nullptr;
        co_await follow(std::move(stream), request);
        co_return false;
      }
      if (gate.is_ours(request) && asks_to_send(request)) {
        peer->stream = nullptr;
        co_await take_messages(std::move(stream), request, peer);
        co_return false;
      }
      co_await answer(stream, request, is_far);
      if (!request.keep_alive()) co_return true;
      peer->is_idle = true;
      beast::get_lowest_layer(stream).expires_after(limits.patience);
    }
  }

  template <class Stream>
  asio::awaitable<void> answer(Stream& stream, const Request& request, bool is_far) {
    const auto refuse = [&](http::status status, const char* why) {
      return respond(stream, request, status, why, limits.patience);
    };
    const auto name = gate.to_string(request);
    if (!gate.is_ours(request))
      co_await refuse(http::status::forbidden, "this page is served only at the address printed by cairn");
    else if (!name)
      co_await refuse(http::status::not_found, "open the address printed by cairn");
    else if (asks_for_feed(request))
      co_await refuse(http::status::service_unavailable, "too many viewers");
    else if (request.method() != http::verb::get && request.method() != http::verb::head)
      co_await refuse(http::status::method_not_allowed, "only GET is supported");
    else if (const auto file = files.find(*name); file == files.end())
      co_await refuse(http::status::not_found, "there is no such file");
    else
      co_await give(stream, request, file->second, is_far);
  }

  template <class Stream>
  asio::awaitable<void> give(Stream& stream, const Request& request, std::shared_ptr<const Entry> entry, bool is_far) {
    if (entry->is_page && request.method() == http::verb::get) is_opened = true;
    std::string problem;
    Content content;
    try {
      content = co_await content_of(*entry, is_far);
    } catch (const std::exception& error) {
      problem = error.what();
    }
    if (problem.empty()) co_return co_await serve(stream, request, *entry, std::move(content), is_far, limits.patience);
    spdlog::warn(fmt::format("view: {}", problem));
    co_await respond(stream, request, http::status::internal_server_error, problem, limits.patience);
  }

  /// Makes slow content in a worker thread, while the server serves other clients.
  asio::awaitable<Content> content_of(const Entry& entry, bool is_far) {
    const Make* make = std::get_if<Make>(&entry.body);
    if (make == nullptr && !(entry.is_packable && is_far)) co_return std::get<Content>(entry.body);
    asio::thread_pool& pool = make != nullptr && make->takes_long ? slow : quick;
    const auto work = [&]() -> asio::awaitable<Content> {
      Content content = make != nullptr ? make->make() : std::get<Content>(entry.body);
      if (const auto* text = std::get_if<std::shared_ptr<const Text>>(&content); text != nullptr && is_far)
        if (entry.is_packable) (void)(*text)->packed();
      co_return content;
    };
    co_return co_await asio::co_spawn(pool, work, asio::use_awaitable);
  }

  template <class Stream>
  asio::awaitable<void> take_messages(Stream&& stream, const Request& request, std::shared_ptr<Peer> peer) {
    using Layer = std::remove_reference_t<Stream>;
    beast::websocket::stream<Layer> socket(std::forward<Stream>(stream));
    WebSocketMessages<Layer> messages(socket);
    beast::get_lowest_layer(socket).expires_after(limits.greeting);
    co_await socket.async_accept(request, asio::use_awaitable);
    co_await receive(messages, peer, address_text(beast::get_lowest_layer(socket).socket()));
  }

  /// Passes messages to the inbox until the sender disconnects or is refused.
  template <class Messages>
  asio::awaitable<void> receive(Messages& messages, std::shared_ptr<Peer> peer, std::string address) {
    std::string problem;
    try {
      auto first = co_await messages.read(kMaxFirstMessage, limits.greeting);
      const Inbox::Sender sender = inlet.inbox->enter(std::move(first), address);
      const Sending sending(*inlet.inbox, sender.id);
      peer->is_idle = false;
      peers.greet(peer);
      co_await relay(messages, sender);
    } catch (const boost::system::system_error&) {
      throw;  // the client disconnected or sent invalid data
    } catch (const std::runtime_error& error) {
      problem = error.what();
    }
    if (!problem.empty()) {
      spdlog::warn(fmt::format("{}: client {}: {}; the client is dropped", inlet.name, address, problem));
      co_await messages.write(error_text(problem), limits.patience);
    }
    co_await messages.close();
  }

  /// Writes the answer to each message before the next is read. Returns after the last answer.
  template <class Messages>
  asio::awaitable<void> relay(Messages& messages, Inbox::Sender sender) {
    while (true) {
      std::optional<Inbox::Answer> answer;
      while (!(answer = inlet.inbox->take_answer(sender.id))) co_await pause(kAnswerInterval);
      co_await messages.write(std::move(answer->text), limits.patience);
      if (answer->is_last) co_return;
      inlet.inbox->put(sender.id, co_await messages.read(sender.max_message, limits.patience));
    }
  }

  /// Sends updates and receives requests until the viewer disconnects.
  template <class Stream>
  asio::awaitable<void> follow(Stream&& stream, const Request& request) {
    using WebSocket = beast::websocket::stream<std::remove_reference_t<Stream>>;
    const auto socket = std::make_shared<WebSocket>(std::forward<Stream>(stream));
    socket->set_option(beast::websocket::stream_base::timeout{limits.patience, limits.patience, true});
    socket->read_message_max(kMaxMessage);
    socket->auto_fragment(false);
    co_await socket->async_accept(request, asio::use_awaitable);
    const Viewing viewing(*feed);
    spawn(listen_to(socket));
    std::uint64_t version = 0;
    while (socket->is_open()) {
      const auto items = feed->since(version);
      if (items.empty()) co_await pause(kPollInterval);
      // One item at a time, since newer versions may replace the others meanwhile.
      if (!items.empty()) {
        const Feed::Item& item = items.front();
        version = item.version;
        socket->text(item.is_text);
        co_await socket->async_write(asio::buffer(*item.bytes), asio::use_awaitable);
      }
    }
  }

  /// Receives until the viewer disconnects or exceeds the message size, after which Beast closes the connection.
  template <class WebSocket>
  asio::awaitable<void> listen_to(std::shared_ptr<WebSocket> socket) {
    while (true) {
      beast::flat_buffer buffer;
      co_await socket->async_read(buffer, asio::use_awaitable);
      if (socket->got_text()) feed->ask(beast::buffers_to_string(buffer.data()));
    }
  }

  Entries files;  // accessed only by the server thread
  Feed* feed;
  ServerLimits limits;
  Inlet inlet;
  Peers peers{limits};  // accessed only by the server thread
  std::atomic<bool> is_opened = false;
  Gate gate;
  ViewerSite site;
  std::optional<asio::ssl::context> tls;
  asio::io_context context{1};
  tcp::acceptor acceptor{context};
  asio::thread_pool quick{1}, slow{1};
  std::jthread thread;  // last member: uses the members above
};

Server::Server(const ViewerAddress& at, Files files, Feed* feed, const ServerLimits& limits, const Inlet& inlet)
    : state_(std::make_unique<State>(at, std::move(files), feed, limits, inlet)) {}
Server::~Server() = default;

void Server::add(Files&& files) {
  auto entries = std::make_shared<Entries>(entries_of(std::move(files)));
  asio::post(state_->context, [state = state_.get(), entries] {
    for (auto& [name, entry] : *entries) state->files[name] = entry;
  });
}

const ViewerSite& Server::site() const { return state_->site; }
bool Server::is_opened() const { return state_->is_opened; }
std::string Server::url() const { return site().urls.front().url; }

}  // namespace cairn
