// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Devices with failures, and devices with only the minimum guaranteed by Vulkan: see tests/support/faulty_device.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "cairn/mapping/mapper.hpp"
#include "cairn/mapping/session.hpp"
#include "gpu/batch.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"
#include "volume/volume.hpp"

namespace cairn {
namespace {

/// Devices made during its lifetime have these faults.
class Faults {
 public:
  explicit Faults(const std::string& words) {
    setenv("VK_LAYER_PATH", faulty_device_folder().c_str(), 1);
    setenv("VK_INSTANCE_LAYERS", kFaultyDevice, 1);
    setenv("CAIRN_FAULTS", words.c_str(), 1);
    unsetenv("CAIRN_VALIDATION");
  }
  ~Faults() {
    for (const char* name : {"VK_LAYER_PATH", "VK_INSTANCE_LAYERS", "CAIRN_FAULTS"}) unsetenv(name);
    setenv("CAIRN_VALIDATION", "1", 1);
  }
  Faults(const Faults&) = delete;
  Faults& operator=(const Faults&) = delete;
};

TEST(FaultyDevice, WritesNoDownloadsAfterAFailedSubmission) {
  const Faults faults("submit=1");
  gpu::Device device;
  const gpu::Buffer buffer(device, 16);
  std::vector<std::uint32_t> first(4, 7u), second(4, 0u);
  {
    gpu::Batch batch(device);
    batch.fill(buffer, 1);
    batch.download(buffer, first);
    EXPECT_ANY_THROW(batch.run());
  }
  gpu::Batch batch(device);
  batch.fill(buffer, 2);
  batch.download(buffer, second);
  batch.run();
  EXPECT_EQ(first, std::vector<std::uint32_t>(4, 7u));
  EXPECT_EQ(second, std::vector<std::uint32_t>(4, 2u));
}

TEST(Batch, RejectsCopiesBeyondABuffersEnd) {
  gpu::Device& device = test_device();
  const gpu::Buffer buffer(device, 16), larger(device, 32), none;
  std::vector<std::uint32_t> data(5);
  gpu::Batch batch(device);
  EXPECT_THROW(batch.upload(buffer, data), std::logic_error);
  EXPECT_THROW(batch.download(buffer, data), std::logic_error);
  EXPECT_THROW(batch.upload(buffer, std::vector<std::uint32_t>(1), 16), std::logic_error);
  EXPECT_THROW(batch.fill(buffer, 0, 8, 12), std::logic_error);
  EXPECT_THROW(batch.fill(none, 0), std::logic_error);
  EXPECT_THROW(batch.copy(larger, buffer), std::logic_error);
  data.resize(4);
  batch.upload(buffer, data);
  batch.run();
}

TEST(FaultyDevice, LimitsTheVolumeToOneAllocation) {
  const Faults faults("max_allocation=268435456");  // 256 MiB
  gpu::Device device;
  const Volume volume(device, {.voxel_size = 0.02f, .truncation = 0.08f, .device_memory = std::uint64_t{1} << 30},
                      5.0f);
  EXPECT_EQ(volume.capacity(), (256u << 20) / sizeof(BrickVoxels));
}

TEST(FaultyDevice, KeepsTheMapWhenAnAllocationFails) {
  const Camera camera{160, 120, 131.25, 131.25, 79.5, 59.5, {}};
  const Scene scene = synthetic_scene("room");
  std::vector<Frame> frames;
  for (int i = 0; i < 6; ++i) frames.push_back(scene_frame(scene, camera, 3 * i));
  const int step = number_from("CAIRN_FAULTS_EVERY", 8);  // `scripts/campaign faults` tests each
  int failed = 0, after_checkpoint = 0;
  bool any = true;
  for (long n = 1; any; n += step) {
    any = false;
    const TemporaryFolder folder;
    const Options options{.fuse = {.voxel_size = 0.02f, .truncation = 0.08f, .device_memory = 64 << 20}};
    const auto expect_message = [&](const std::runtime_error& error) {
      any = true;
      ++failed;
      const std::string message = error.what();
      EXPECT_NE(message.find("memory"), std::string::npos) << n << ": " << message;
      EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    };
    bool saved = false;
    {
      const Faults faults("allocation=" + std::to_string(n));
      try {
        Session session = Session::create(folder / "session");
        Mapper mapper = session.mapper(camera, options);
        std::size_t fused = 0;
        try {
          for (const Frame& frame : frames) {
            fused += mapper.add(frame).state == FrameState::fused;
            if (fused == 3) {
              session.checkpoint(mapper);
              saved = !session.problem();
            }
          }
          EXPECT_FALSE(mapper.map().mesh().triangles.empty());
        } catch (const std::runtime_error& error) {
          expect_message(error);
          // The failed frame may already have a pose and be part of the surface.
          EXPECT_GE(mapper.trajectory().size(), fused);
          if (fused > 0) {
            EXPECT_FALSE(mapper.map().mesh().triangles.empty()) << n;
          }
        }
      } catch (const std::runtime_error& error) {
        expect_message(error);
      }
    }
    if (!saved) continue;
    ++after_checkpoint;
    EXPECT_EQ(Session::resume(folder / "session").mapper(camera, options).trajectory().size(), 3u) << n;
  }
  EXPECT_GT(failed, 10);
  EXPECT_GT(after_checkpoint, 0);
  std::printf("%d allocations failed, one in each run\n", failed);
}

TEST(FaultyDevice, MinimumVulkanLimitsSuffice) {
  const TemporaryFolder folder;
  const auto reconstruct = [&](const std::string& name, const std::string& environment) {
    const Ran ran = run_cairn(
        {"reconstruct", "synthetic:room", "--frames", "0:6", "--texture", "--esdf", "-o", (folder / name).string()},
        environment);
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
  };
  reconstruct("default", "");
  // Subgroups of 8 or 16 reported as 4; 300 workgroups instead of 65,535 are fewer than a frame needs.
  reconstruct("minimum", faulty_device("groups=300 max_allocation=268435456 subgroup=4 uncached"));
  for (const char* name : {"mesh.glb", "map.vdb", "trajectory.txt"})
    EXPECT_TRUE(read_bytes(folder / "default" / name) == read_bytes(folder / "minimum" / name)) << name;
}

}  // namespace
}  // namespace cairn
