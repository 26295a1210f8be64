// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "gpu/buffer.hpp"

#include <algorithm>
#include <stdexcept>

#include "gpu/vulkan.hpp"

namespace cairn::gpu {
namespace {

std::uint32_t memory_type(const Device::State& device, std::uint32_t allowed, vk::MemoryPropertyFlags properties,
                          vk::MemoryPropertyFlags preferred) {
  for (const auto wanted : {properties | preferred, properties})
    for (std::uint32_t i = 0; i < device.memory_types.memoryTypeCount; ++i)
      if ((allowed & (1u << i)) && (device.memory_types.memoryTypes[i].propertyFlags & wanted) == wanted) return i;
  throw std::runtime_error("device " + device.info.name + " has no memory type with " + vk::to_string(properties));
}

/// True if device and host access the memory equally: no staging copy is needed.
bool is_shared_with_host(const Device::State& device, std::uint32_t type) {
  constexpr auto kShared = vk::MemoryPropertyFlagBits::eHostVisible | vk::MemoryPropertyFlagBits::eHostCoherent;
  return (device.info.type == "cpu" || device.info.type == "integrated") &&
         (device.memory_types.memoryTypes[type].propertyFlags & kShared) == kShared;
}

constexpr auto kStorage = vk::BufferUsageFlagBits::eStorageBuffer | vk::BufferUsageFlagBits::eUniformTexelBuffer |
                          vk::BufferUsageFlagBits::eTransferSrc | vk::BufferUsageFlagBits::eTransferDst |
                          vk::BufferUsageFlagBits::eShaderDeviceAddress | vk::BufferUsageFlagBits::eIndirectBuffer |
                          vk::BufferUsageFlagBits::eUniformBuffer;

}  // namespace

Allocation::Allocation(Device::State& d, std::uint64_t bytes, vk::BufferUsageFlags usage,
                       vk::MemoryPropertyFlags properties, vk::MemoryPropertyFlags preferred)
    : device(d), size(std::max<std::uint64_t>(bytes, 4)) {
  std::uint32_t type = 0;
  if (size > d.max_allocation)
    throw std::runtime_error("device " + d.info.name + " allocates at most " + std::to_string(d.max_allocation >> 20) +
                             " MiB at once, not " + std::to_string(size >> 20) +
                             ": lower FuseOptions::device_memory, or choose a larger FuseOptions::voxel_size");
  try {
    buffer = vk::raii::Buffer(*d.device, vk::BufferCreateInfo{.size = size, .usage = usage});
    const auto needs = buffer.getMemoryRequirements();
    const vk::MemoryAllocateFlagsInfo flags{.flags = vk::MemoryAllocateFlagBits::eDeviceAddress};
    const bool addressed = static_cast<bool>(usage & vk::BufferUsageFlagBits::eShaderDeviceAddress);
    type = memory_type(d, needs.memoryTypeBits, properties, preferred);
    memory = vk::raii::DeviceMemory(
        *d.device, vk::MemoryAllocateInfo{
                       .pNext = addressed ? &flags : nullptr, .allocationSize = needs.size, .memoryTypeIndex = type});
  } catch (const vk::OutOfDeviceMemoryError&) {
    throw std::runtime_error("device " + d.info.name + " is out of memory for " + std::to_string(size >> 20) +
                             " MiB: lower FuseOptions::device_memory");
  } catch (const vk::OutOfHostMemoryError&) {
    throw std::runtime_error("out of memory for " + std::to_string(size >> 20) +
                             " MiB: lower FuseOptions::device_memory");
  }
  buffer.bindMemory(*memory, 0);
  if ((properties & vk::MemoryPropertyFlagBits::eHostVisible) || is_shared_with_host(d, type))
    mapped = static_cast<std::byte*>(memory.mapMemory(0, VK_WHOLE_SIZE));
  d.in_use += size;
  d.peak = std::max(d.peak, d.in_use);
}

Allocation::~Allocation() {
  device.in_use -= size;
  device.wait_idle();
}

Buffer::Buffer(Device& device, std::uint64_t bytes)
    : state_(new State{.allocation = {device.state(), bytes, kStorage, vk::MemoryPropertyFlagBits::eDeviceLocal},
                       .views = {}}) {
  state_->address = device.state().device->getBufferAddress({.buffer = *state_->allocation.buffer});
}

const vk::raii::BufferView& Buffer::State::texels(vk::Format format) const {
  if (const auto it = views.find(format); it != views.end()) return it->second;
  const std::uint64_t texel_bytes = format == vk::Format::eR32G32Uint ? 8 : 4;
  const std::uint64_t texels = allocation.size / texel_bytes;
  const auto& d = allocation.device;
  if (texels > d.max_texels)
    throw std::runtime_error("device " + d.info.name + " reads at most " + std::to_string(d.max_texels) +
                             " texels of a buffer, not " + std::to_string(texels));
  vk::raii::BufferView view(*d.device, {.buffer = *allocation.buffer, .format = format, .range = texels * texel_bytes});
  return views.emplace(format, std::move(view)).first->second;
}

Buffer::Buffer() = default;
Buffer::~Buffer() = default;
Buffer::Buffer(Buffer&&) noexcept = default;
Buffer& Buffer::operator=(Buffer&&) noexcept = default;

std::uint64_t Buffer::size() const { return state_ ? state_->allocation.size : 0; }
std::uint64_t Buffer::address() const { return state_->address; }

}  // namespace cairn::gpu
