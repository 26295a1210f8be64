// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "apps/cli/machine.hpp"

#include <gtest/gtest.h>

#include "support/files.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

/// Machine as presented by the kernel.
class Machine : public testing::Test {
 protected:
  void write(const std::string& file, const std::string& text) const {
    fs::create_directories((root / file).parent_path());
    write_text(root / file, text + "\n");
  }
  void plug_in_card(const std::string& slot, const char* type, const char* vendor, const char* driver) const {
    const std::string folder = "sys/bus/pci/devices/" + slot;
    write(folder + "/class", type);
    write(folder + "/vendor", vendor);
    write(folder + "/device", "0x46a6");
    if (*driver != '\0') fs::create_symlink(fs::path("../../drivers") / driver, root / folder / "driver");
  }
  [[nodiscard]] std::optional<std::string> idle(const std::vector<DeviceInfo>& devices = {}) const {
    const auto gpus = gpus_of(root.path());
    EXPECT_EQ(gpus.size(), 1u);
    return gpus.empty() ? std::nullopt : why_idle(gpus[0], devices, root.path());
  }
  TemporaryFolder root;
};

TEST_F(Machine, ListsOnlyDisplayCardsOfThePciBus) {
  EXPECT_TRUE(gpus_of(root.path()).empty());
  plug_in_card("0000:00:02.0", "0x030000", "0x8086", "i915");
  plug_in_card("0000:01:00.0", "0x030200", "0x10de", "");         // 3D controller of a laptop
  plug_in_card("0000:00:1f.0", "0x060100", "0x8086", "lpc_ich");  // no display
  const auto gpus = gpus_of(root.path());
  ASSERT_EQ(gpus.size(), 2u);
  EXPECT_EQ(gpus[0].name(), "Intel graphics (8086:46a6)");
  EXPECT_EQ(gpus[0].kernel_driver, "i915");
  EXPECT_EQ(gpus[1].vendor, 0x10deu);
  EXPECT_EQ(gpus[1].kernel_driver, "");
}

TEST_F(Machine, IntelCardWithoutDriverIsIdle) {
  plug_in_card("0000:00:02.0", "0x030000", "0x8086", "i915");
  EXPECT_EQ(idle({{.name = "llvmpipe (LLVM 15.0.6, 256 bits)", .driver = "llvmpipe Mesa 22.3.6"}}),
            "install mesa-vulkan-drivers");
  EXPECT_EQ(idle({{.name = "Intel(R) Iris(R) Xe Graphics", .driver = "Intel open-source Mesa driver"}}), std::nullopt);
}

TEST_F(Machine, InstalledDriverWithoutRightsIsReported) {
  plug_in_card("0000:03:00.0", "0x030000", "0x1002", "amdgpu");
  write("usr/share/vulkan/icd.d/radeon_icd.x86_64.json", "{}");
  EXPECT_NE(idle()->find("render node"), std::string::npos);
  write("dev/dri/renderD128", "");
  EXPECT_NE(idle()->find("group render"), std::string::npos);
}

TEST_F(Machine, CardWithoutKernelDriverNeedsFirmware) {
  plug_in_card("0000:03:00.0", "0x030000", "0x1002", "");
  write("usr/share/vulkan/icd.d/radeon_icd.x86_64.json", "{}");
  EXPECT_NE(idle()->find("firmware-amd-graphics"), std::string::npos);
}

TEST_F(Machine, NvidiaNeedsItsOwnDriver) {
  plug_in_card("0000:01:00.0", "0x030000", "0x10de", "nouveau");
  EXPECT_NE(idle()->find("install nvidia-driver"), std::string::npos);
}

TEST_F(Machine, NvidiaKernelDriverNeedsTheVulkanDriver) {
  plug_in_card("0000:01:00.0", "0x030000", "0x10de", "nvidia");
  EXPECT_EQ(idle(), "install nvidia-vulkan-icd");
}

TEST_F(Machine, IgnoresCardsOfVirtualMachines) {
  plug_in_card("0000:00:01.0", "0x030000", "0x1af4", "virtio-pci");
  EXPECT_EQ(idle(), std::nullopt);
}

TEST_F(Machine, FindsDepthSensorsOnUsb) {
  const auto plug_in = [&](const char* port, const char* vendor, const char* product, const char* number) {
    const std::string folder = std::string("sys/bus/usb/devices/") + port;
    write(folder + "/idVendor", vendor);
    write(folder + "/idProduct", product);
    write(folder + "/busnum", "1");
    write(folder + "/devnum", number);
  };
  plug_in("1-1", "045e", "02ae", "4");
  plug_in("1-2", "8086", "0b07", "5");
  plug_in("1-3", "046d", "c52b", "6");  // a mouse
  plug_in("1-4", "2bc5", "066b", "7");
  const auto sensors = usb_sensors_of(root.path());
  ASSERT_EQ(sensors.size(), 3u);
  EXPECT_EQ(sensors[0].name, "Kinect for Xbox 360");
  EXPECT_EQ(sensors[0].input, "openni:");
  EXPECT_EQ(sensors[0].node, root / "dev/bus/usb/001/004");
  EXPECT_EQ(sensors[1].name, "RealSense");
  EXPECT_EQ(sensors[1].input, "realsense:");
  EXPECT_EQ(sensors[1].advice, "cairn live realsense: -o OUT --view");
  EXPECT_EQ(sensors[2].name, "Orbbec Femto Bolt");
  EXPECT_EQ(sensors[2].input, "k4a:");
}

TEST_F(Machine, ReadsMemoryAndUdevRules) {
  write("proc/meminfo", "MemTotal:       24683620 kB\nMemFree:        20793316 kB\nMemAvailable:   22844580 kB");
  EXPECT_EQ(memory_of(root.path()).total, 24683620ull << 10);
  EXPECT_EQ(memory_of(root.path()).available, 22844580ull << 10);
  EXPECT_FALSE(has_openni_rules(root.path()));
  write("lib/udev/rules.d/60-libopenni2-0.rules", "");
  EXPECT_TRUE(has_openni_rules(root.path()));
}

}  // namespace
}  // namespace cairn::apps
