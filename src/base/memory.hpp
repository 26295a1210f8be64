// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <fstream>
#include <string>

namespace cairn {

/// Memory available without swapping, in bytes, as estimated by the kernel; 0: unknown.
[[nodiscard]] inline std::uint64_t available_memory() {
  std::ifstream in("/proc/meminfo");
  std::string name, rest;
  for (std::uint64_t value = 0; in >> name >> value; std::getline(in, rest))
    if (name == "MemAvailable:") return value << 10;
  return 0;
}

}  // namespace cairn
