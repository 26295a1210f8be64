// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <memory>

#include "gpu/device.hpp"

namespace cairn::gpu {

/// Device-local storage. Batch::upload and Batch::download transfer its contents. Movable; must not outlive its Device.
class Buffer {
 public:
  Buffer();
  /// `bytes` may exceed the device's storage-buffer range if the buffer is only accessed by its `address`.
  /// Throws std::runtime_error if the device has too little memory.
  Buffer(Device& device, std::uint64_t bytes);
  ~Buffer();
  Buffer(Buffer&&) noexcept;
  Buffer& operator=(Buffer&&) noexcept;

  [[nodiscard]] std::uint64_t size() const;     // bytes
  [[nodiscard]] std::uint64_t address() const;  // for GL_EXT_buffer_reference; see shader::address in shaders/types.h
  [[nodiscard]] explicit operator bool() const { return state_ != nullptr; }

  struct State;
  [[nodiscard]] const State& state() const { return *state_; }

 private:
  std::unique_ptr<State> state_;
};

}  // namespace cairn::gpu
