// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace cairn {

/// A Vulkan device.
struct DeviceInfo {
  int index = 0;  ///< what a Mapper takes
  std::string name, type, driver;
  std::uint64_t memory = 0;  ///< bytes of the largest device-local heap
  std::uint32_t subgroup_size = 0;
  std::optional<std::string> missing;  ///< first feature that Cairn needs and this device lacks
};

/// All Vulkan devices, usable or not. Empty when no driver is installed.
[[nodiscard]] std::vector<DeviceInfo> list_devices();

}  // namespace cairn
