// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Client of a network camera, over TCP or a WebSocket.
#pragma once
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include "support/frame_messages.hpp"

namespace cairn {

/// Port that no program uses.
inline int free_port() {
  boost::asio::io_context context;
  boost::asio::ip::tcp::acceptor acceptor(context, {boost::asio::ip::address_v4::loopback(), 0});
  return acceptor.local_endpoint().port();
}

/// Connects to the input `tcp:PORT` or `ws:PORT`, repeatedly for ten seconds.
class NetworkClient {
 public:
  explicit NetworkClient(const std::string& input) : is_tcp_(input.starts_with("tcp")) {
    const auto port = static_cast<std::uint16_t>(std::stoi(input.substr(input.rfind(':') + 1)));
    boost::asio::ip::tcp::socket socket(context_);
    for (int i = 0;; ++i) {
      boost::system::error_code error;
      socket.connect({boost::asio::ip::address_v4::loopback(), port}, error);
      if (!error) break;
      if (i == 1000) throw std::runtime_error("no server");
      socket.close();
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    socket_.emplace(std::move(socket));
    if (!is_tcp_) socket_->handshake("127.0.0.1:" + std::to_string(port), "/frames");
    socket_->binary(true);
  }
  void send_bytes(const std::string& bytes) { boost::asio::write(socket_->next_layer(), boost::asio::buffer(bytes)); }
  void send(const std::string& message) {
    if (is_tcp_)
      send_bytes(little_endian(static_cast<std::uint32_t>(message.size())) + message);
    else
      socket_->write(boost::asio::buffer(message));
  }
  /// Next answer; null if the connection was closed.
  nlohmann::json answer() {
    boost::system::error_code error;
    std::string text;
    if (is_tcp_) {
      const std::size_t size =
          boost::asio::read_until(socket_->next_layer(), boost::asio::dynamic_buffer(read_), '\n', error);
      text = read_.substr(0, size);
      read_.erase(0, size);
    } else {
      boost::beast::flat_buffer buffer;
      socket_->read(buffer, error);
      text = boost::beast::buffers_to_string(buffer.data());
    }
    return error ? nlohmann::json() : nlohmann::json::parse(text);
  }
  nlohmann::json ask(const std::string& message) {
    send(message);
    return answer();
  }
  void close() { socket_->next_layer().close(); }

 private:
  bool is_tcp_;
  boost::asio::io_context context_;
  std::optional<boost::beast::websocket::stream<boost::asio::ip::tcp::socket>> socket_;
  std::string read_;
};

}  // namespace cairn
