// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Hardware information from the kernel, as far as Cairn can use it. `root` is / except in tests.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cairn/mapping/device.hpp"

namespace cairn::apps {

/// A graphics card on the PCI bus, with or without a driver.
struct Gpu {
  std::uint32_t vendor = 0, device = 0;  // PCI numbers
  std::string kernel_driver;             // i915, amdgpu, nvidia, nouveau, ...; empty: none
  [[nodiscard]] std::string name() const;
};
[[nodiscard]] std::vector<Gpu> gpus_of(const std::filesystem::path& root = "/");

/// Instructions to make the card a Vulkan device. Empty if the card is in `devices` or its vendor is unknown.
[[nodiscard]] std::optional<std::string> why_idle(const Gpu& gpu, const std::vector<DeviceInfo>& devices,
                                                  const std::filesystem::path& root = "/");

/// A depth sensor on USB.
struct UsbSensor {
  std::string name;
  std::string advice;          // steps to use the sensor with Cairn
  std::string input;           // name for `cairn live`: "openni:"; empty if not supported
  std::filesystem::path node;  // /dev/bus/usb/001/004
};
[[nodiscard]] std::vector<UsbSensor> usb_sensors_of(const std::filesystem::path& root = "/");

/// Returns true if udev rules let users other than root access OpenNI2 sensors.
[[nodiscard]] bool has_openni_rules(const std::filesystem::path& root = "/");

struct Memory {
  std::uint64_t total = 0, available = 0;  // bytes
};
[[nodiscard]] Memory memory_of(const std::filesystem::path& root = "/");

}  // namespace cairn::apps
