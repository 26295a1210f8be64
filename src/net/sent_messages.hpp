// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Messages from a client to the server, with answers: over TCP with a length prefix, and over WebSocket.
#pragma once
#include <fmt/format.h>

// clang-format off: Boost 1.74's awaitable.hpp needs this and forgets it
#include <utility>
// clang-format on
#include <algorithm>
#include <array>
#include <boost/asio/awaitable.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <stdexcept>
#include <string>

#include "base/little_endian.hpp"
#include "net/inbox.hpp"

namespace cairn {

inline constexpr std::size_t kMessageChunk = std::size_t{1} << 20;  // bytes per read
inline constexpr std::chrono::milliseconds kCloseTimeout{1000};     // for a client to read the last answer

inline void check_message_size(std::uint64_t size, std::size_t max_size) {
  if (size == 0)
    throw std::runtime_error("the message is empty: send the size of its header, the header, and its data");
  if (size > max_size)
    throw std::runtime_error(
        fmt::format("the message has {} bytes or more, allowed: {}: check its length, and the camera's size in the "
                    "first message",
                    size, max_size));
}

/// Messages over TCP: size in bytes as little-endian uint32, then the bytes. Answers are lines of JSON. Each read and
/// write throws boost::system::system_error for a closed connection and after a timeout of `patience`, and read throws
/// std::runtime_error for a message beyond `max_size`.
class TcpMessages {
 public:
  explicit TcpMessages(boost::beast::tcp_stream& stream) : stream_(stream) {}

  boost::asio::awaitable<Inbox::Bytes> read(std::size_t max_size, std::chrono::milliseconds patience) {
    std::array<std::uint8_t, 4> prefix{};
    stream_.expires_after(patience);
    co_await boost::asio::async_read(stream_, boost::asio::buffer(prefix), boost::asio::use_awaitable);
    const std::uint32_t size = little_endian_uint32(prefix);
    check_message_size(size, max_size);
    Inbox::Bytes bytes;
    while (bytes.size() < size) {
      const std::size_t begin = bytes.size();
      bytes.resize(std::min<std::size_t>(size, begin + kMessageChunk));
      stream_.expires_after(patience);
      co_await boost::asio::async_read(stream_, boost::asio::buffer(bytes.data() + begin, bytes.size() - begin),
                                       boost::asio::use_awaitable);
    }
    co_return bytes;
  }

  boost::asio::awaitable<void> write(std::string text, std::chrono::milliseconds patience) {
    text += '\n';
    stream_.expires_after(patience);
    co_await boost::asio::async_write(stream_, boost::asio::buffer(text), boost::asio::use_awaitable);
  }

  /// Discards further data for a moment: a connection closed with unread data loses the last answer.
  boost::asio::awaitable<void> close() {
    boost::system::error_code error;
    stream_.socket().shutdown(boost::asio::ip::tcp::socket::shutdown_send, error);
    std::array<char, 4096> rest{};
    stream_.expires_after(kCloseTimeout);
    while (!error)
      co_await stream_.async_read_some(boost::asio::buffer(rest),
                                       boost::asio::redirect_error(boost::asio::use_awaitable, error));
  }

 private:
  boost::beast::tcp_stream& stream_;
};

/// Messages as binary WebSocket messages, answers as text messages. Errors as for TcpMessages.
template <class Stream>
class WebSocketMessages {
 public:
  using Socket = boost::beast::websocket::stream<Stream>;
  explicit WebSocketMessages(Socket& socket) : socket_(socket) {
    using Options = boost::beast::websocket::stream_base;
    socket_.set_option(Options::timeout{Options::none(), Options::none(), false});  // TCP's instead, per read and write
    socket_.read_message_max(0);                                                    // read() has its own limit
    socket_.auto_fragment(false);
  }

  boost::asio::awaitable<Inbox::Bytes> read(std::size_t max_size, std::chrono::milliseconds patience) {
    boost::beast::flat_buffer buffer;
    do {
      boost::beast::get_lowest_layer(socket_).expires_after(patience);
      co_await socket_.async_read_some(buffer, kMessageChunk, boost::asio::use_awaitable);
      if (buffer.size() > max_size) check_message_size(buffer.size(), max_size);
    } while (!socket_.is_message_done());
    if (!socket_.got_binary()) throw std::runtime_error("a text message arrived: send binary messages");
    check_message_size(buffer.size(), max_size);
    const auto* bytes = static_cast<const std::uint8_t*>(buffer.data().data());
    co_return Inbox::Bytes(bytes, bytes + buffer.size());
  }

  boost::asio::awaitable<void> write(std::string text, std::chrono::milliseconds patience) {
    socket_.text(true);
    boost::beast::get_lowest_layer(socket_).expires_after(patience);
    co_await socket_.async_write(boost::asio::buffer(text), boost::asio::use_awaitable);
  }

  boost::asio::awaitable<void> close() {
    boost::system::error_code ignored;
    boost::beast::get_lowest_layer(socket_).expires_after(kCloseTimeout);
    co_await socket_.async_close(boost::beast::websocket::close_code::normal,
                                 boost::asio::redirect_error(boost::asio::use_awaitable, ignored));
  }

 private:
  Socket& socket_;
};

}  // namespace cairn
