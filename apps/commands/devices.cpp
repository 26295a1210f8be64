// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <cstdio>
#include <memory>

#include "cairn/io/sensors.hpp"
#include "cairn/mapping/device.hpp"
#include "cli/commands.hpp"

namespace cairn::apps {
namespace {

void print_sensors() {
  for (const SensorLibrary& library : list_sensors()) {
    for (const SensorInfo& sensor : library.sensors)
      std::printf("%-24s  %s\n", sensor.input.c_str(), sensor.model.c_str());
    if (library.missing) std::printf("%-24s  none: %s\n", library.input.c_str(), library.missing->c_str());
    const char* const none = library.input == "ros2:" ? "no depth topic is published" : "none is plugged in";
    if (!library.missing && library.sensors.empty()) std::printf("%-24s  %s\n", library.input.c_str(), none);
  }
  std::printf("%-24s  frames of a phone or program that connects\n", "tcp:PORT, ws:PORT");
}

}  // namespace

void add_devices(CLI::App& program) {
  auto* command = program.add_subcommand("devices", "List the Vulkan devices and whether Cairn can use them");
  const auto sensors = std::make_shared<bool>(false);
  command->add_flag("--sensors", *sensors, "List the connected depth sensors instead, by the name for `cairn live`");
  command->callback([sensors] {
    if (*sensors) return print_sensors();
    const auto devices = list_devices();
    if (devices.empty())
      throw std::runtime_error("no Vulkan device found: install a driver, for example mesa-vulkan-drivers");
    for (const auto& d : devices)
      std::printf("%d  %-10s  %s (%s)  %s\n", d.index, d.type.c_str(), d.name.c_str(), d.driver.c_str(),
                  d.missing ? ("lacks " + *d.missing).c_str() : "usable");
  });
}

}  // namespace cairn::apps
