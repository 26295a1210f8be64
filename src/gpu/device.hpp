// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "cairn/mapping/device.hpp"

// The only interface to Vulkan for the stages: no Vulkan type appears in src/gpu/*.hpp except vulkan.hpp.
namespace cairn::gpu {

[[nodiscard]] std::vector<DeviceInfo> find_devices();  // see list_devices

struct KernelTime {
  int calls = 0;
  double total_ms = 0.0;
};

/// Transfers between host and device so far.
struct Traffic {
  std::uint64_t waits = 0;                     // waits of the host for the device
  std::uint64_t uploaded = 0, downloaded = 0;  // bytes
};

/// Vulkan compute device with one queue. Not thread-safe: only one thread at a time may use a device and its objects.
class Device {
 public:
  /// -1 selects the first usable discrete, else integrated, else CPU device. Throws std::runtime_error with the missing
  /// feature, or with an installation hint if there is no device. The environment variable CAIRN_VALIDATION=1 enables
  /// the Khronos validation layer; `sync` also enables synchronization validation, `gpu` GPU-assisted validation.
  explicit Device(int index = -1);
  ~Device();
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  [[nodiscard]] const DeviceInfo& info() const;
  /// Waits for all submissions.
  void wait();
  /// Warnings and errors of the validation layer so far.
  [[nodiscard]] const std::vector<std::string>& validation_messages() const;
  /// Device time by kernel, from timestamps.
  [[nodiscard]] const std::map<std::string, KernelTime>& kernel_times() const;
  [[nodiscard]] const Traffic& traffic() const;
  /// Maximum size in bytes of a buffer, and of a buffer bound by a kernel.
  [[nodiscard]] std::uint64_t max_allocation() const;
  [[nodiscard]] std::uint64_t max_texels() const;  // of a buffer read as texels
  [[nodiscard]] std::uint64_t max_binding() const;
  [[nodiscard]] std::uint32_t max_groups() const;  // workgroups along x
  /// Bytes in buffers: current and peak.
  [[nodiscard]] std::uint64_t memory_in_use() const;
  [[nodiscard]] std::uint64_t peak_memory() const;

  struct State;
  [[nodiscard]] State& state() const { return *state_; }

 private:
  std::unique_ptr<State> state_;
};

}  // namespace cairn::gpu
