// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <sstream>
#include <thread>

#include "cairn/io/sensors.hpp"
#include "cairn/mapping/device.hpp"
#include "cairn/mapping/mapper.hpp"
#include "cairn/synthetic/scene.hpp"
#include "cairn/synthetic/synthetic.hpp"
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/json_text.hpp"
#include "cli/machine.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr std::uint64_t kMinMemory = std::uint64_t{2} << 30;  // bytes; a room takes about 1 GiB
constexpr std::uint64_t kMinDiskSpace = std::uint64_t{2} << 30;

constexpr int kFrames = 3;  // number of frames to map; the first compiles the kernels

/// Result of one check.
struct Check {
  enum class Level { good, note, bad } level = Level::good;
  std::string what, text;
  std::string remedy;  // empty if not needed
};
using Checks = std::vector<Check>;
constexpr const char* kLevels[] = {"good", "note", "bad"};

/// Milliseconds to track and fuse a frame of a synthetic room.
double fuse_frames(int device) {
  const Scene scene = synthetic_scene("room");
  SceneCamera camera(scene, synthetic_camera(), device);
  Mapper mapper(synthetic_camera(), Options{}, Poses::tracked, device);
  double ms = 0;
  for (int i = 0; i < kFrames; ++i) {
    const double time = i / 30.0;
    SceneImages images = camera.render(scene.world_from_camera(time), time);
    const Frame frame{
        .index = i, .timestamp = time, .depth = std::move(images.depth), .color = std::move(images.color)};
    const auto begin = Clock::now();
    const FrameReport report = mapper.add(frame);
    ms = std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
    if (report.state != FrameState::fused) throw std::runtime_error("a synthetic frame is not fused: " + report.reason);
  }
  return ms;
}

/// Returns true if a usable device exists.
bool check_devices(const std::vector<DeviceInfo>& devices, Checks& checks) {
  bool is_usable = false;
  for (const DeviceInfo& d : devices) {
    Check& check =
        checks.emplace_back(Check{.what = "device", .text = fmt::format("{}: {}, {}", d.index, d.name, d.type)});
    if (d.missing) {
      check.level = Check::Level::note;
      check.text += ", lacks " + *d.missing;
      continue;
    }
    try {
      check.text += fmt::format(", works: a frame in {:.0f} ms", fuse_frames(d.index));
      is_usable = true;
    } catch (const std::exception& error) {
      check.level = Check::Level::bad;
      check.text += fmt::format(", fails: {}", error.what());
      check.remedy = "update its driver, or choose another device with --device";
    }
  }
  if (!is_usable)
    checks.push_back({Check::Level::bad, "device", "no usable Vulkan device",
                      std::getenv("VK_DRIVER_FILES") != nullptr || std::getenv("VK_ICD_FILENAMES") != nullptr
                          ? "VK_DRIVER_FILES or VK_ICD_FILENAMES is set and hides drivers: unset it"
                          : "install mesa-vulkan-drivers, which also runs on the CPU"});
  return is_usable;
}

void check_gpus(const std::vector<DeviceInfo>& devices, Checks& checks) {
  for (const Gpu& gpu : gpus_of())
    if (const auto remedy = why_idle(gpu, devices))
      checks.push_back({Check::Level::note, "graphics", gpu.name() + " is not used", *remedy});
}

/// Reason and remedy if the library of a sensor is missing. OpenNI2 is checked apart.
std::optional<std::string> missing_library(const std::string& input) {
  if (input == "openni:") return std::nullopt;
  for (const SensorLibrary& library : list_sensors())
    if (library.input == input) return library.missing;
  return std::nullopt;
}

void check_sensors(Checks& checks) {
  const bool has_rules = has_openni_rules();
  if (!CAIRN_HAS_OPENNI)
    checks.push_back({Check::Level::note, "sensors",
                      "this build has no OpenNI2, for PrimeSense, Xtion and Kinect for Xbox 360",
                      "install libopenni2-dev and build again"});
  else if (!has_rules && geteuid() != 0)
    checks.push_back({Check::Level::note, "sensors",
                      "OpenNI2 is installed, but udev allows only root to use its sensors",
                      "install libopenni2-0, which contains the udev rules, and plug the sensor in again"});
  else
    checks.push_back(
        {.what = "sensors",
         .text = "OpenNI2 is installed, " + std::string(has_rules ? "with its udev rules" : "and you are root")});
  for (const UsbSensor& sensor : usb_sensors_of()) {
    Check& check =
        checks.emplace_back(Check{.what = "sensor", .text = sensor.name + " is plugged in", .remedy = sensor.advice});
    const auto note = [&check](const char* text) {
      check.level = Check::Level::note;
      check.text += text;
    };
    if (sensor.input.empty()) {
      note(", which Cairn does not support directly");
    } else if (const auto missing = missing_library(sensor.input)) {
      note(", but its library cannot be used");
      check.remedy = *missing;
    } else if (access(sensor.node.c_str(), R_OK | W_OK) != 0) {
      note(", but you have no access to it");
      check.remedy = sensor.input == "openni:" ? "install libopenni2-0 and plug it in again"
                                               : "install the udev rules of its library and plug it in again";
    }
  }
}

void check_machine(Checks& checks) {
  const Memory memory = memory_of();
  checks.push_back({.what = "memory",
                    .text = fmt::format("{} free of {}", format_size(memory.available), format_size(memory.total))});
  if (memory.available < kMinMemory) {
    checks.back().level = Check::Level::note;
    checks.back().remedy = "close other programs, or map with --voxel-size 0.02 and --device-memory 512";
  }
  std::error_code error;
  const auto space = fs::space(".", error);
  checks.push_back({.what = "disk", .text = format_size(error ? 0 : space.available) + " free here"});
  if (error || space.available < kMinDiskSpace) {
    checks.back().level = Check::Level::note;
    checks.back().remedy =
        "a map of a room takes about 200 MB, a recording of a minute 1 GB: choose another disk with -o";
  }
  checks.push_back({.what = "cores", .text = std::to_string(std::thread::hardware_concurrency())});
}

bool is_in_path(const char* program) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path != nullptr ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');)
    if (access((fs::path(folder) / program).c_str(), X_OK) == 0) return true;
  return false;
}

void check_pages(Checks& checks) {
  const bool has_desktop = std::getenv("DISPLAY") != nullptr || std::getenv("WAYLAND_DISPLAY") != nullptr;
  if (!CAIRN_HAS_VIEWER)
    checks.push_back(
        {Check::Level::note, "pages", "this build has no viewer and no report.html", "install npm and build again"});
  else if (!has_desktop)
    checks.push_back({.what = "pages",
                      .text = "no desktop to open them",
                      .remedy = "copy report.html, or forward the port: ssh -L 4242:127.0.0.1:4242"});
  else if (!is_in_path("xdg-open"))
    checks.push_back({Check::Level::note, "pages", "no program to open a browser",
                      "install xdg-utils, or open the printed addresses yourself"});
  else
    checks.push_back({.what = "pages", .text = "the desktop's browser opens them"});
  checks.push_back({.what = "build",
                    .text = fmt::format("cairn {}, {} viewer, {} sensors, {} videos", CAIRN_VERSION,
                                        CAIRN_HAS_VIEWER ? "with" : "without", CAIRN_HAS_OPENNI ? "with" : "without",
                                        CAIRN_HAS_VIDEO ? "with" : "without")});
}

void print(const Checks& checks) {
  const int columns = terminal_of(STDOUT_FILENO).columns, indent = columns < kNarrow ? 6 : 16;
  for (const Check& check : checks) {
    fmt::print("{:<5} {:<9} {}\n", kLevels[static_cast<int>(check.level)], check.what,
               wrapped(check.text, 16, indent, columns));
    if (!check.remedy.empty()) fmt::print("{:{}}{}\n", "", indent, wrapped(check.remedy, indent, indent, columns));
  }
}

nlohmann::json to_json(const Checks& checks) {
  auto list = nlohmann::json::array();
  for (const Check& check : checks) {
    list.push_back({{"level", kLevels[static_cast<int>(check.level)]}, {"what", check.what}, {"words", check.text}});
    if (!check.remedy.empty()) list.back()["remedy"] = check.remedy;
  }
  return list;
}

std::vector<DeviceInfo> available_devices() {
  try {
    return list_devices();
  } catch (const std::runtime_error&) {
    return {};  // the Vulkan loader is missing
  }
}

void doctor(bool as_json) {
  Checks checks;
  const auto devices = available_devices();
  const bool is_usable = check_devices(devices, checks);
  check_gpus(devices, checks);
  check_machine(checks);
  check_sensors(checks);
  check_pages(checks);
  if (as_json)
    fmt::print("{}\n",
               format_json({{"usable", is_usable}, {"version", CAIRN_VERSION}, {"checks", to_json(checks)}}, 2));
  else
    print(checks);
  if (!is_usable) throw CLI::RuntimeError(1);
}

}  // namespace

void add_doctor(CLI::App& program) {
  auto* command = program.add_subcommand("doctor", "Check whether this machine can map, and what to install");
  const auto json = std::make_shared<bool>(false);
  command->add_flag("--json", *json, "Print JSON");
  command->callback([json] { doctor(*json); });
}

}  // namespace cairn::apps
