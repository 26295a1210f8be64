// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/machine.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fstream>

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kIntel = 0x8086, kAmd = 0x1002, kNvidia = 0x10de;
constexpr std::uint32_t kDisplay = 0x03;  // PCI class

struct KnownSensor {
  std::uint16_t vendor, first_product, last_product;  // USB numbers
  const char* name;
  const char* input;  // name for `cairn live`; empty if not supported
};
// From the udev rules of OpenNI2, libfreenect2, librealsense, the Azure Kinect SDK and OrbbecSDK.
constexpr std::array kSensors{
    KnownSensor{0x1d27, 0x0600, 0x0609, "PrimeSense sensor or Xtion", "openni:"},
    KnownSensor{0x2bc5, 0x0401, 0x04ff, "Orbbec Astra", "openni:"},
    KnownSensor{0x2bc5, 0x0669, 0x0669, "Orbbec Femto Mega", "k4a:"},
    KnownSensor{0x2bc5, 0x066b, 0x066b, "Orbbec Femto Bolt", "k4a:"},
    KnownSensor{0x045e, 0x02ae, 0x02ae, "Kinect for Xbox 360", "openni:"},
    KnownSensor{0x045e, 0x02bf, 0x02bf, "Kinect for Windows", "openni:"},
    KnownSensor{0x045e, 0x02c4, 0x02c4, "Kinect 2", ""},
    KnownSensor{0x045e, 0x02d8, 0x02d9, "Kinect 2", ""},
    KnownSensor{0x045e, 0x097c, 0x097c, "Azure Kinect", "k4a:"},
    KnownSensor{0x8086, 0x0a66, 0x0b6f, "RealSense", "realsense:"},
};

std::string first_line(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  return line;
}

/// Reads a hexadecimal number; 0 if there is none.
std::uint32_t hexadecimal(const fs::path& file) {
  return static_cast<std::uint32_t>(std::strtoul(first_line(file).c_str(), nullptr, 16));
}

std::vector<fs::path> sorted_entries(const fs::path& folder) {
  std::error_code error;
  std::vector<fs::path> entries;
  for (const auto& entry : fs::directory_iterator(folder, error)) entries.push_back(entry.path());
  std::sort(entries.begin(), entries.end());
  return entries;
}

bool any_named(const fs::path& folder, const std::string& text) {
  const auto entries = sorted_entries(folder);
  return std::any_of(entries.begin(), entries.end(),
                     [&](const fs::path& file) { return file.filename().string().find(text) != std::string::npos; });
}

bool has_driver_file(const fs::path& root, const char* name) {
  return any_named(root / "usr/share/vulkan/icd.d", name) || any_named(root / "etc/vulkan/icd.d", name);
}

/// Matches a vendor by the names of the device and its driver.
bool is_by_vendor(const DeviceInfo& device, std::uint32_t vendor) {
  const std::string names = device.name + " " + device.driver;
  const auto has = [&](const char* name) { return names.find(name) != names.npos; };
  if (vendor == kIntel) return has("Intel");
  if (vendor == kAmd) return has("AMD") || has("Radeon") || has("radv");
  return vendor == kNvidia && (has("NVIDIA") || has("GeForce"));
}

std::string advice_for(const KnownSensor& sensor) {
  if (*sensor.input != '\0') return fmt::format("cairn live {} -o OUT --view", sensor.input);
  return "record it with ROS (kinect2_bridge) as .bag, and pass it to cairn reconstruct";
}

}  // namespace

std::string Gpu::name() const {
  const char* maker = vendor == kIntel ? "Intel" : vendor == kAmd ? "AMD" : vendor == kNvidia ? "NVIDIA" : "other";
  return fmt::format("{} graphics ({:04x}:{:04x})", maker, vendor, device);
}

std::vector<Gpu> gpus_of(const fs::path& root) {
  std::vector<Gpu> gpus;
  for (const fs::path& entry : sorted_entries(root / "sys/bus/pci/devices")) {
    if (hexadecimal(entry / "class") >> 16 != kDisplay) continue;
    Gpu& gpu = gpus.emplace_back(
        Gpu{.vendor = hexadecimal(entry / "vendor"), .device = hexadecimal(entry / "device"), .kernel_driver = {}});
    std::error_code error;
    if (const fs::path driver = fs::read_symlink(entry / "driver", error); !error)
      gpu.kernel_driver = driver.filename().string();
  }
  return gpus;
}

std::optional<std::string> why_idle(const Gpu& gpu, const std::vector<DeviceInfo>& devices, const fs::path& root) {
  if (std::any_of(devices.begin(), devices.end(), [&](const DeviceInfo& d) { return is_by_vendor(d, gpu.vendor); }))
    return std::nullopt;
  if (gpu.vendor == kNvidia)
    return gpu.kernel_driver == "nvidia" ? "install nvidia-vulkan-icd"
                                         : "install nvidia-driver, from Debian's component non-free, which brings "
                                           "nvidia-vulkan-icd; then restart";
  if (gpu.vendor != kIntel && gpu.vendor != kAmd) return std::nullopt;
  if (!has_driver_file(root, gpu.vendor == kIntel ? "intel_icd" : "radeon_icd")) return "install mesa-vulkan-drivers";
  if (gpu.kernel_driver.empty())
    return gpu.vendor == kIntel ? "its kernel driver is not loaded: install firmware-misc-nonfree and restart"
                                : "its kernel driver is not loaded: install firmware-amd-graphics and restart";
  if (any_named(root / "dev/dri", "renderD"))
    return "its driver is installed, but you have no access to it: add yourself to the group render (sudo usermod -aG "
           "render "
           "$USER) and log in again";
  return "its driver is installed, but /dev/dri has no render node: give it to this container or virtual machine";
}

std::vector<UsbSensor> usb_sensors_of(const fs::path& root) {
  std::vector<UsbSensor> sensors;
  for (const fs::path& entry : sorted_entries(root / "sys/bus/usb/devices")) {
    const std::uint32_t vendor = hexadecimal(entry / "idVendor"), product = hexadecimal(entry / "idProduct");
    const auto known = std::find_if(kSensors.begin(), kSensors.end(), [&](const KnownSensor& s) {
      return vendor == s.vendor && product >= s.first_product && product <= s.last_product;
    });
    if (known == kSensors.end()) continue;
    const auto number = [&](const char* file) { return std::atoi(first_line(entry / file).c_str()); };
    sensors.push_back({.name = known->name,
                       .advice = advice_for(*known),
                       .input = known->input,
                       .node = root / fmt::format("dev/bus/usb/{:03}/{:03}", number("busnum"), number("devnum"))});
  }
  return sensors;
}

bool has_openni_rules(const fs::path& root) {
  for (const char* folder : {"lib/udev/rules.d", "usr/lib/udev/rules.d", "etc/udev/rules.d"})
    if (any_named(root / folder, "openni2")) return true;
  return false;
}

Memory memory_of(const fs::path& root) {
  Memory memory;
  std::ifstream in(root / "proc/meminfo");
  std::string name, unit;
  for (std::uint64_t value = 0; in >> name >> value; std::getline(in, unit)) {
    if (name == "MemTotal:") memory.total = value << 10;
    if (name == "MemAvailable:") memory.available = value << 10;
  }
  return memory;
}

}  // namespace cairn::apps
