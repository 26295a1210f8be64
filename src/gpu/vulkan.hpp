// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Private to src/gpu: the Vulkan objects behind Device, Buffer and Batch.
#pragma once
#define VULKAN_HPP_NO_STRUCT_CONSTRUCTORS
#include <array>
#include <deque>
#include <filesystem>
#include <map>
#include <optional>
#include <vulkan/vulkan_raii.hpp>

#include "gpu/batch.hpp"
#include "gpu/buffer.hpp"
#include "gpu/device.hpp"

namespace cairn::gpu {

/// Vulkan's loader. Throws std::runtime_error that says what to install where there is none.
[[nodiscard]] vk::raii::Context open_loader();

struct Device::State {
  vk::raii::Context context = open_loader();
  std::optional<vk::raii::Instance> instance;
  std::optional<vk::raii::DebugUtilsMessengerEXT> messenger;
  std::optional<vk::raii::PhysicalDevice> physical;
  std::optional<vk::raii::Device> device;
  std::optional<vk::raii::Queue> queue;
  std::optional<vk::raii::PipelineCache> pipelines;
  std::filesystem::path pipelines_file;
  vk::PhysicalDeviceMemoryProperties memory_types;
  float timestamp_period_ns = 1.0f;
  std::uint64_t max_binding = 0;     // bytes
  std::uint64_t max_texels = 0;      // of a buffer that is read as texels
  std::uint64_t max_allocation = 0;  // bytes of one buffer
  std::array<std::uint32_t, 3> max_groups{};
  bool subgroup_size_control = false;
  std::uint32_t queue_family = 0;

  DeviceInfo info;
  std::vector<std::string> messages;
  std::map<std::string, KernelTime> times;
  std::uint64_t in_use = 0, peak = 0;
  Traffic traffic;
  // Submissions are numbered from 1; the timeline reaches a submission's number when it and all before it have ended.
  std::optional<vk::raii::Semaphore> timeline;
  std::uint64_t submitted = 0, ended = 0;
  std::deque<std::unique_ptr<Batch::State>> under_way;  // the oldest first
  std::vector<std::unique_ptr<Batch::State>> idle_batches;

  void open();  // `physical`: its limits, the device, and its queue
  /// Waits for a submission and all before it.
  void wait_for(std::uint64_t submission);
  /// Whether everything that was submitted has ended. Does not wait.
  [[nodiscard]] bool is_idle();
  /// Before something goes away that submissions may still use.
  void let_go() noexcept;
  [[nodiscard]] std::unique_ptr<Batch::State> empty_batch();

 private:
  void note_ended(std::uint64_t submission);
};

/// A buffer with memory of its own. `mapped` is null for memory that only the device reaches. Memory with `preferred`
/// properties, too, is taken where the device has it.
struct Allocation {
  Allocation(Device::State& device, std::uint64_t bytes, vk::BufferUsageFlags usage, vk::MemoryPropertyFlags properties,
             vk::MemoryPropertyFlags preferred = {});
  ~Allocation();
  Allocation(const Allocation&) = delete;
  Allocation& operator=(const Allocation&) = delete;

  Device::State& device;
  std::uint64_t size;
  vk::raii::Buffer buffer = nullptr;
  vk::raii::DeviceMemory memory = nullptr;
  std::byte* mapped = nullptr;
};

struct Buffer::State {
  Allocation allocation;
  std::uint64_t address = 0;
  mutable std::map<vk::Format, vk::raii::BufferView> views;

  /// The buffer as texels; the view is made when it is first asked for.
  const vk::raii::BufferView& texels(vk::Format format) const;
};

struct Batch::State {
  explicit State(Device::State& d);
  struct Place {
    Allocation* chunk;
    std::uint64_t offset;
  };
  /// Host-visible memory that grows by chunks. One chunk stays for the next run; instead of several that one gets a
  /// chunk of their size, unless it is too large to keep.
  struct Arena {
    std::deque<Allocation> chunks;
    std::uint64_t used = 0;   // bytes of the last chunk
    std::uint64_t usual = 0;  // bytes of the first chunk, if more than of others
    Place take(Device::State& device, std::uint64_t bytes, vk::BufferUsageFlags usage,
               vk::MemoryPropertyFlags preferred);
    void reset();
  };
  struct Download {
    Place from;
    std::span<std::byte> to;
  };
  static constexpr std::uint32_t kMaxTimed = 512;  // dispatches of one run that get a timestamp

  Device::State& device;
  vk::raii::CommandPool pool = nullptr;
  vk::raii::CommandBuffer commands = nullptr;
  vk::raii::QueryPool queries = nullptr;
  Arena uploads, downloads;
  std::vector<Download> pending_downloads;
  std::vector<const std::string*> timed;
  bool recording = false;
  std::uint64_t submission = 0;  // its number, once it has one

  vk::raii::CommandBuffer& record();  // begins when needed; orders what follows after what came before
  void submit();                      // ends recording
  void finish();                      // after the device has: hands downloads out, adds up times, and is empty again
};

}  // namespace cairn::gpu
