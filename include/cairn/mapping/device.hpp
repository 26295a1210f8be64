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
  int index = 0;  ///< device argument of Mapper
  std::string name, type, driver;
  std::uint64_t memory = 0;  ///< bytes of the largest device-local heap
  std::uint32_t subgroup_size = 0;
  std::optional<std::string> missing;  ///< first feature required by Cairn and missing on this device
};

/// Returns all Vulkan devices, usable or not. Empty without a driver.
[[nodiscard]] std::vector<DeviceInfo> list_devices();

}  // namespace cairn
