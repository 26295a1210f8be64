// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "gpu/buffer.hpp"

namespace cairn::gpu {

/// Commands for the device, executed in order; each sees the writes of all earlier commands.
class Batch {
 public:
  explicit Batch(Device& device);
  ~Batch();
  Batch(const Batch&) = delete;
  Batch& operator=(const Batch&) = delete;

  /// Copies the data immediately; the span may then become invalid. `offset` in bytes.
  void upload_bytes(const Buffer& to, std::span<const std::byte> data, std::uint64_t offset = 0);
  template <class T>
  void upload(const Buffer& to, std::span<const T> data, std::uint64_t offset = 0) {
    upload_bytes(to, std::as_bytes(data), offset);
  }
  template <class T>
  void upload(const Buffer& to, const std::vector<T>& data, std::uint64_t offset = 0) {
    upload_bytes(to, std::as_bytes(std::span(data)), offset);
  }
  /// `data` is filled when `run` returns and must live until then.
  void download_bytes(const Buffer& from, std::span<std::byte> data, std::uint64_t offset = 0);
  template <class T>
  void download(const Buffer& from, std::span<T> data, std::uint64_t offset = 0) {
    download_bytes(from, std::as_writable_bytes(data), offset);
  }
  template <class T>
  void download(const Buffer& from, std::vector<T>& data, std::uint64_t offset = 0) {
    download_bytes(from, std::as_writable_bytes(std::span(data)), offset);
  }
  /// Copies a complete buffer into a buffer of at least its size.
  void copy(const Buffer& from, const Buffer& to);
  /// Fills with a repeated 32-bit word. `offset` and `bytes` are multiples of 4; bytes 0: to the end.
  void fill(const Buffer& buffer, std::uint32_t word, std::uint64_t offset = 0, std::uint64_t bytes = 0);

  /// Submits and waits for completion. The batch is empty afterwards and can be reused.
  void run();
  /// Submits without waiting: later batches see the writes of this batch, and downloads are complete after run() of a
  /// later batch. The batch is empty afterwards and can be reused.
  void submit();

  struct State;
  [[nodiscard]] State& state() const { return *state_; }

 private:
  std::unique_ptr<State> state_;
};

}  // namespace cairn::gpu
