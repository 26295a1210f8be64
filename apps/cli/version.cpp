// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/version.hpp"

#include <commit.h>  // CAIRN_COMMIT, of apps/commit.cmake
#include <fmt/format.h>

#include "cairn/mapping/device.hpp"
#include "cairn/mapping/session.hpp"
#include "cli/console.hpp"

namespace cairn::apps {
namespace {

std::string entry(const char* name, const std::string& text, int columns) {
  const int indent = 11;
  return fmt::format("{:<{}}{}\n", name, indent, wrapped(text, indent, indent, columns));
}

std::string parts() {
  return fmt::format("{} viewer, {} sensors, {} videos", CAIRN_HAS_VIEWER ? "with" : "without",
                     CAIRN_HAS_OPENNI ? "with" : "without", CAIRN_HAS_VIDEO ? "with" : "without");
}

}  // namespace

std::string version_line() { return "cairn " CAIRN_VERSION " (" CAIRN_COMMIT ")"; }

std::string version_in_full(int columns) {
  std::string text = version_line() + '\n';
  text += entry("built", CAIRN_COMPILER ", " + parts(), columns);
  text += entry("libraries", CAIRN_LIBRARIES, columns);
  text += entry("sessions", fmt::format("format {}, also reads {}", Session::kFormat, Session::kOldestFormat), columns);
  try {
    for (const DeviceInfo& d : list_devices())
      text += entry("device", fmt::format("{} {}, {}", d.index, d.name, d.driver), columns);
  } catch (const std::runtime_error& error) {  // the Vulkan loader is missing
    text += entry("device", error.what(), columns);
  }
  text.pop_back();
  return text;
}

}  // namespace cairn::apps
