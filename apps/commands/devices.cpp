// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <cstdio>

#include "cairn/mapping/device.hpp"
#include "cli/commands.hpp"

namespace cairn::apps {

void add_devices(CLI::App& program) {
  auto* command = program.add_subcommand("devices", "List the Vulkan devices and whether Cairn can use them");
  command->callback([] {
    const auto devices = list_devices();
    if (devices.empty())
      throw std::runtime_error("no Vulkan device found: install a driver, for example mesa-vulkan-drivers");
    for (const auto& d : devices)
      std::printf("%d  %-10s  %s (%s)  %s\n", d.index, d.type.c_str(), d.name.c_str(), d.driver.c_str(),
                  d.missing ? ("lacks " + *d.missing).c_str() : "usable");
  });
}

}  // namespace cairn::apps
