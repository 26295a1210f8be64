// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What the kernel tells of a machine, as far as Cairn can use it. `root` is / but for tests.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cairn/device.hpp"

namespace cairn::apps {

/// A graphics card on the PCI bus, whether or not anybody drives it.
struct Gpu {
  std::uint32_t vendor = 0, device = 0;  // PCI numbers
  std::string kernel_driver;             // i915, amdgpu, nvidia, nouveau, ...; empty: none
  [[nodiscard]] std::string name() const;
};
[[nodiscard]] std::vector<Gpu> gpus_of(const std::filesystem::path& root = "/");

/// What to do so that the card becomes a Vulkan device; nothing where it is one of `devices`, or of a vendor that is
/// not known.
[[nodiscard]] std::optional<std::string> why_idle(const Gpu& gpu, const std::vector<DeviceInfo>& devices,
                                                  const std::filesystem::path& root = "/");

/// A depth sensor on USB.
struct UsbSensor {
  std::string name;
  std::string advice;          // how Cairn gets its images
  bool by_openni = false;      // `cairn live openni:` uses it
  std::filesystem::path node;  // /dev/bus/usb/001/004
};
[[nodiscard]] std::vector<UsbSensor> usb_sensors_of(const std::filesystem::path& root = "/");

/// Whether udev lets people other than root use OpenNI2's sensors.
[[nodiscard]] bool has_openni_rules(const std::filesystem::path& root = "/");

struct Memory {
  std::uint64_t total = 0, available = 0;  // bytes
};
[[nodiscard]] Memory memory_of(const std::filesystem::path& root = "/");

}  // namespace cairn::apps
