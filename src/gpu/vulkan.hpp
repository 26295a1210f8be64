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

/// Vulkan loader. Throws std::runtime_error with an installation hint if it is missing.
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
  std::uint64_t max_texels = 0;      // of a buffer read as texels
  std::uint64_t max_allocation = 0;  // bytes of one buffer
  std::array<std::uint32_t, 3> max_groups{};
  bool subgroup_size_control = false;
  std::uint32_t queue_family = 0;

  DeviceInfo info;
  std::vector<std::string> messages;
  std::map<std::string, KernelTime> times;
  std::uint64_t in_use = 0, peak = 0;
  Traffic traffic;
  // Submissions are numbered from 1; the timeline reaches a number when this and all earlier submissions have finished.
  std::optional<vk::raii::Semaphore> timeline;
  std::uint64_t submitted = 0, completed = 0;
  std::deque<std::unique_ptr<Batch::State>> in_flight;  // oldest first
  std::vector<std::unique_ptr<Batch::State>> idle_batches;

  void open();  // reads the limits of `physical`; creates the device and its queue
  /// Waits for a submission and all earlier ones.
  void wait_for(std::uint64_t submission);
  /// True if all submissions have finished. Does not wait.
  [[nodiscard]] bool is_idle();
  /// Waits for all submissions before the destruction of an object in use.
  void wait_idle() noexcept;
  [[nodiscard]] std::unique_ptr<Batch::State> empty_batch();

 private:
  void retire(std::uint64_t submission);
};

/// A buffer with its own memory. `mapped` is null for memory without host access. Prefers memory that also has the
/// `preferred` properties.
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

  /// Waits for submissions that read the views.
  ~State() { allocation.device.wait_idle(); }
  /// The buffer as texels; the view is created on first use.
  const vk::raii::BufferView& texels(vk::Format format) const;
};

struct Batch::State {
  explicit State(Device::State& d);
  struct Place {
    Allocation* chunk;
    std::uint64_t offset;
  };
  /// Host-visible memory that grows by chunks. A single chunk is kept for the next run; several chunks are replaced by
  /// a chunk of their total size, unless too large to keep.
  struct Arena {
    std::deque<Allocation> chunks;
    std::uint64_t used = 0;               // bytes used in the last chunk
    std::uint64_t first_chunk_bytes = 0;  // minimum size of the first chunk, bytes
    Place take(Device::State& device, std::uint64_t bytes, vk::BufferUsageFlags usage,
               vk::MemoryPropertyFlags preferred);
    void reset();
  };
  struct Download {
    Place from;
    std::span<std::byte> to;
  };
  static constexpr std::uint32_t kMaxTimed = 512;  // timestamped dispatches per run

  Device::State& device;
  vk::raii::CommandPool pool = nullptr;
  vk::raii::CommandBuffer commands = nullptr;
  vk::raii::QueryPool queries = nullptr;
  Arena uploads, downloads;
  std::vector<Download> pending_downloads;
  std::vector<const std::string*> timed;
  bool recording = false;
  std::uint64_t submission = 0;  // number of its submission, once submitted

  vk::raii::CommandBuffer& record();  // starts recording if necessary; adds a barrier after the earlier commands
  void submit();                      // ends recording
  void finish();                      // after completion: copies downloads, adds up times, and resets the batch
};

}  // namespace cairn::gpu
