// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "cairn/device.hpp"

// The only door to Vulkan for the stages: no Vulkan type appears in src/gpu/*.hpp.
namespace cairn::gpu {

[[nodiscard]] std::vector<DeviceInfo> find_devices();  // see list_devices

struct KernelTime {
  int calls = 0;
  double total_ms = 0.0;
};

/// Between host and device, so far.
struct Traffic {
  std::uint64_t waits = 0;                     // of the host for the device
  std::uint64_t uploaded = 0, downloaded = 0;  // bytes
};

/// A Vulkan compute device with one queue. Not thread-safe: one thread at a time uses a device and what it made.
class Device {
 public:
  /// -1 picks the first usable discrete, else integrated, else CPU device. Throws std::runtime_error naming the
  /// missing feature, or what to install when there is no device. The environment variable CAIRN_VALIDATION=1 turns
  /// the Khronos validation layer on, `sync` also its search for commands that do not wait for each other, `gpu` also
  /// its checks inside of shaders.
  explicit Device(int index = -1);
  ~Device();
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  [[nodiscard]] const DeviceInfo& info() const;
  /// Waits for everything that was submitted.
  void wait();
  /// Warnings and errors of the validation layer so far.
  [[nodiscard]] const std::vector<std::string>& validation_messages() const;
  /// Time on the device by kernel, from timestamps.
  [[nodiscard]] const std::map<std::string, KernelTime>& kernel_times() const;
  [[nodiscard]] const Traffic& traffic() const;
  /// Bytes that one buffer may have, and one that a kernel binds.
  [[nodiscard]] std::uint64_t max_allocation() const;
  [[nodiscard]] std::uint64_t max_texels() const;  // of a buffer that is read as texels
  [[nodiscard]] std::uint64_t max_binding() const;
  [[nodiscard]] std::uint32_t max_groups() const;  // workgroups along x
  /// Bytes in buffers now, and at most so far.
  [[nodiscard]] std::uint64_t memory_in_use() const;
  [[nodiscard]] std::uint64_t peak_memory() const;

  struct State;
  [[nodiscard]] State& state() const { return *state_; }

 private:
  std::unique_ptr<State> state_;
};

}  // namespace cairn::gpu
