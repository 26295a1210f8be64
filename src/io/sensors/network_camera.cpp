// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/sensors/network_camera.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "base/image_file.hpp"
#include "base/json_text.hpp"
#include "base/words.hpp"
#include "io/sensors/frame_message.hpp"
#include "io/sensors/network_page.hpp"
#include "io/sensors/sensor_source.hpp"
#include "net/addresses.hpp"
#include "net/inbox.hpp"
#include "net/server.hpp"
#include "net/token.hpp"

namespace cairn {
namespace {

using Json = nlohmann::json;
using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr std::string_view kTcp = "tcp:", kWs = "ws:";
constexpr int kMaxPort = 65535;
constexpr int kThumbnailWidth = 320;  // pixels, at most
constexpr auto kEndTimeout = 1s;
constexpr auto kReconnectTimeout = 50ms;  // per attempt of a source without a client

constexpr SensorWords kWords{.lost = "no client is connected; waiting for the next",
                             .back = "a client is connected again",
                             .absent = "no client is connected",
                             .silent = "the client sent no frame for two seconds"};

/// Address in `tcp:HOST:PORT` or `ws:PORT`.
ViewerAddress address_in(const std::string& name) {
  const std::string_view text = std::string_view(name).substr(name.find(':') + 1);
  const std::size_t colon = text.rfind(':');
  std::string host(colon == text.npos ? "" : text.substr(0, colon));
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  const auto port = number_in<int>(colon == text.npos ? text : text.substr(colon + 1));
  if (!port || *port < 0 || *port > kMaxPort || (colon != text.npos && host.empty()))
    throw std::runtime_error(fmt::format("use {0}PORT or {0}HOST:PORT, with a port from 0 (any free port) to {1}",
                                         name.substr(0, name.find(':') + 1), kMaxPort));
  return {.port = *port, .host = host, .certificates = {}};
}

std::string camera_text(const Rig& rig) {
  const auto of = [](const Camera& c) { return fmt::format("{}x{}, fx {:g}", c.width, c.height, c.fx); };
  return rig.color ? fmt::format("{}; color {}", of(rig.depth), of(rig.color->camera)) : of(rig.depth);
}

/// Pixels of a color image for the page, at a fraction of its size.
struct Thumbnail {
  int width = 0, height = 0;
  std::vector<std::uint32_t> pixels;  // as Frame::color
};

Thumbnail thumbnail_of(const std::vector<std::uint32_t>& color, const Camera& camera) {
  if (color.empty()) return {};
  const int step = (camera.width + kThumbnailWidth - 1) / kThumbnailWidth;
  Thumbnail small{.width = camera.width / step, .height = camera.height / step, .pixels = {}};
  for (int y = 0; y < small.height; ++y)
    for (int x = 0; x < small.width; ++x)
      small.pixels.push_back(color[static_cast<std::size_t>(y * step) * static_cast<std::size_t>(camera.width) +
                                   static_cast<std::size_t>(x * step)]);
  return small;
}

/// Server, and the state of its client. Outlives the connections. Thread-safe.
class Receiver {
 public:
  Receiver(const std::string& name, std::shared_ptr<const TrackingState> tracking)
      : name_(name),
        is_tcp_(name.starts_with(kTcp)),
        token_(is_loopback(address_in(name).host) ? "" : random_token()),
        tracking_(std::move(tracking)),
        inbox_([this](const Inbox::Bytes& first) { return check_first(first); }),
        server_(address_in(name), files(), nullptr, {},
                {.inbox = &inbox_, .is_tcp = is_tcp_, .name = name, .token = token_}) {}

  Inbox& inbox() { return inbox_; }
  [[nodiscard]] const std::string& name() const { return name_; }

  /// Line with the addresses for clients.
  [[nodiscard]] std::string invitation() const {
    std::vector<std::string> addresses;
    for (const ViewerSite::Url& url : server_.site().urls)
      addresses.push_back(is_tcp_ ? url.url : "ws" + url.url.substr(std::string_view("http").size()) + "frames");
    std::string line = fmt::format("{}: waiting for a client at {}", name_, fmt::join(addresses, ", "));
    if (is_tcp_ && !token_.empty()) line += fmt::format(", token {}, unencrypted", token_);
    if (!is_tcp_) line += fmt::format("; state at {}", server_.url());
    if (const auto& print = server_.site().fingerprint; !print.empty()) line += "; certificate " + print;
    return line;
  }

  /// Sets the cameras of all clients, and the page's state.
  void connected(const HelloMessage& hello, const std::string& address) {
    const std::lock_guard lock(mutex_);
    if (!rig_) rig_ = hello.rig;
    client_ = hello.name.empty() ? address : fmt::format("{} at {}", hello.name, address);
    spdlog::info("{}: client {} is connected: {}{}", name_, client_, camera_text(hello.rig),
                 hello.poses ? ", with poses" : "");
  }

  /// Answer to a frame.
  [[nodiscard]] std::string received(std::int64_t number, const std::vector<std::uint32_t>& color,
                                     const Camera& camera) {
    Thumbnail thumbnail = is_tcp_ ? Thumbnail() : thumbnail_of(color, camera);  // TCP has no page
    const std::lock_guard lock(mutex_);
    ++frames_;
    thumbnail_ = std::move(thumbnail);
    return text_of({{"frame", number}, {"state", state()}, {"dropped", dropped()}});
  }

  void refuse(int id, const std::string& address, const std::string& reason) {
    spdlog::warn("{}: client {}: {}; the client is dropped", name_, address, reason);
    inbox_.refuse(id, reason);
    const std::lock_guard lock(mutex_);
    error_ = reason;
  }

 private:
  std::size_t check_first(const Inbox::Bytes& first) {
    const HelloMessage hello = read_hello(first);
    if (is_tcp_ && !token_.empty() && !is_same_token(hello.token, token_))
      throw std::runtime_error("the token is wrong or missing: send the token printed by cairn in the hello");
    const std::lock_guard lock(mutex_);
    if (rig_ && !(*rig_ == hello.rig))
      throw std::runtime_error(
          fmt::format("its cameras ({}) differ from the run's ({}): send the same, or start another "
                      "run",
                      camera_text(hello.rig), camera_text(*rig_)));
    return max_message_size(hello);
  }

  [[nodiscard]] const char* state() const {
    const auto is = tracking_ ? tracking_->is.load() : TrackingState::Is::unknown;
    return is == TrackingState::Is::unknown ? "received" : is == TrackingState::Is::tracking ? "tracking" : "lost";
  }
  [[nodiscard]] int dropped() const { return tracking_ ? tracking_->dropped.load() : 0; }

  Server::Files files() {
    if (is_tcp_) return {};
    const auto json = [this]() -> Content { return std::make_shared<const Text>(state_text()); };
    const auto jpeg = [this]() -> Content { return std::make_shared<const Text>(thumbnail_jpeg()); };
    Server::Files files;
    files[""] = {.content_type = "text/html; charset=utf-8", .body = std::string(kNetworkPage)};
    files["state.json"] = {.content_type = "application/json", .body = Make{.make = json}};
    files["color.jpg"] = {.content_type = "image/jpeg", .body = Make{.make = jpeg}};
    return files;
  }

  [[nodiscard]] std::string state_text() const {
    const bool is_connected = inbox_.has_sender();
    const std::lock_guard lock(mutex_);
    return text_of({{"state", is_connected ? state() : "waiting"},
                    {"client", is_connected ? client_ : ""},
                    {"camera", rig_ ? camera_text(*rig_) : ""},
                    {"frames", frames_},
                    {"dropped", dropped()},
                    {"error", error_},
                    {"has_color", !thumbnail_.pixels.empty()}});
  }

  [[nodiscard]] std::string thumbnail_jpeg() const {
    std::unique_lock lock(mutex_);
    Thumbnail image = thumbnail_;
    lock.unlock();
    if (image.pixels.empty()) throw std::runtime_error("there is no color image");
    const auto bytes = encode_jpeg(cv::Mat(image.height, image.width, CV_8UC4, image.pixels.data()), {.quality = 80});
    return {bytes.begin(), bytes.end()};
  }

  std::string name_;
  bool is_tcp_;
  std::string token_;
  std::shared_ptr<const TrackingState> tracking_;  // may be null
  mutable std::mutex mutex_;
  std::optional<Rig> rig_;  // of the first client
  std::string client_, error_;
  int frames_ = 0;
  Thumbnail thumbnail_;
  Inbox inbox_;
  Server server_;  // last member: uses the members above
};

/// Connection of a client.
class NetworkDevice final : public SensorDevice {
 public:
  NetworkDevice(std::shared_ptr<Receiver> receiver, const Inbox::Arrival& arrival)
      : receiver_(std::move(receiver)), id_(arrival.id), address_(arrival.address), hello_(read_hello(arrival.first)) {
    receiver_->connected(hello_, address_);
    receiver_->inbox().answer(id_, text_of({{"cairn", kFrameProtocol}, {"state", "ready"}}));
  }
  ~NetworkDevice() override { receiver_->inbox().refuse(id_, "cairn has ended, or reads no more frames"); }
  NetworkDevice(const NetworkDevice&) = delete;
  NetworkDevice& operator=(const NetworkDevice&) = delete;

  [[nodiscard]] const Rig& rig() const override { return hello_.rig; }
  [[nodiscard]] std::string serial() const override { return {}; }
  [[nodiscard]] State state() const override { return state_; }

  [[nodiscard]] std::optional<SensorImages> next(std::chrono::milliseconds timeout) override {
    const auto bytes = receiver_->inbox().next(id_, timeout);
    state_ = receiver_->inbox().is_connected(id_) ? State::silent : State::unplugged;
    if (!bytes) return std::nullopt;
    ++messages_;
    FrameMessage message;
    try {
      message = read_frame(*bytes, hello_, order_);
    } catch (const std::runtime_error& error) {
      receiver_->refuse(id_, address_, fmt::format("message {}: {}", messages_, error.what()));
      state_ = State::unplugged;
      return std::nullopt;
    }
    if (message.is_end) {
      receiver_->inbox().answer(id_, text_of({{"end", true}}), true);
      (void)receiver_->inbox().next(id_, kEndTimeout);  // until the answer is written
      state_ = State::ended;
      return std::nullopt;
    }
    order_ = {.number = message.images.number, .timestamp = {}};
    if (message.has_timestamp)
      order_.timestamp = message.images.timestamp;
    else
      message.images.timestamp = std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
    receiver_->inbox().answer(
        id_, receiver_->received(message.images.number, message.images.color, hello_.rig.color_view()));
    return std::move(message.images);
  }

 private:
  std::shared_ptr<Receiver> receiver_;
  int id_;
  std::string address_;
  HelloMessage hello_;
  FrameOrder order_;
  int messages_ = 0;  // after the hello
  State state_ = State::silent;
};

std::shared_ptr<Receiver> receiver_of(const std::string& name, std::shared_ptr<const TrackingState> tracking) try {
  return std::make_shared<Receiver>(name, std::move(tracking));
} catch (const std::runtime_error& error) {
  throw std::runtime_error(name + ": " + error.what());
}

}  // namespace

bool is_network_camera(std::string_view name) { return name.starts_with(kTcp) || name.starts_with(kWs); }

std::unique_ptr<Source> open_network_camera(const std::string& name, std::shared_ptr<const TrackingState> tracking) {
  const auto receiver = receiver_of(name, std::move(tracking));
  spdlog::info(receiver->invitation());
  const auto open = [receiver, is_first = true](const std::string&) mutable -> std::unique_ptr<SensorDevice> {
    auto arrival = receiver->inbox().next_sender(kReconnectTimeout);
    while (!arrival && is_first) arrival = receiver->inbox().next_sender(kReconnectTimeout);
    if (!arrival) throw std::runtime_error("no client is connected");
    is_first = false;
    return std::make_unique<NetworkDevice>(receiver, *arrival);
  };
  return sensor_source(name, name.starts_with(kTcp) ? "frames over TCP" : "frames over a WebSocket", "", open, kWords);
}

}  // namespace cairn
