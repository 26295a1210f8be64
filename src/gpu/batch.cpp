// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "gpu/batch.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstring>
#include <exception>
#include <stdexcept>
#include <string>

#include "gpu/vulkan.hpp"

namespace cairn::gpu {
namespace {

constexpr std::uint64_t kMinChunkBytes = 256 << 10;  // minimum size of a staging chunk, bytes
constexpr std::uint64_t kMaxKeptBytes = 8 << 20;     // staging bytes kept between runs: the images of a few frames
constexpr std::size_t kMaxInFlight = 32;             // batches; each keeps its staging memory until it finishes
// Host-visible memory. Downloads prefer host-cached memory, which the host reads faster.
constexpr auto kHost = vk::MemoryPropertyFlagBits::eHostVisible | vk::MemoryPropertyFlagBits::eHostCoherent;

/// Validates a range, since Vulkan does not check buffer bounds.
void check_range(const char* what, const Buffer& buffer, std::uint64_t offset, std::uint64_t bytes) {
  if (!buffer) throw std::logic_error(std::string(what) + ": the buffer has no memory");
  if (offset > buffer.size() || bytes > buffer.size() - offset)
    throw std::logic_error(std::string(what) + " of " + std::to_string(bytes) + " bytes at " + std::to_string(offset) +
                           ": the buffer has " + std::to_string(buffer.size()));
}

}  // namespace

Batch::State::State(Device::State& d) : device(d) {
  pool = vk::raii::CommandPool(
      *d.device, {.flags = vk::CommandPoolCreateFlagBits::eTransient, .queueFamilyIndex = d.queue_family});
  commands = std::move(vk::raii::CommandBuffers(*d.device, {.commandPool = *pool, .commandBufferCount = 1}).front());
  queries = vk::raii::QueryPool(*d.device, {.queryType = vk::QueryType::eTimestamp, .queryCount = 2 * kMaxTimed});
}

Batch::State::Place Batch::State::Arena::take(Device::State& d, std::uint64_t bytes, vk::BufferUsageFlags usage,
                                              vk::MemoryPropertyFlags preferred) {
  const std::uint64_t aligned = (bytes + 15) & ~std::uint64_t{15};
  if (chunks.empty() || used + aligned > chunks.back().size) {
    chunks.emplace_back(d, std::max({aligned, kMinChunkBytes, chunks.empty() ? first_chunk_bytes : 0}), usage, kHost,
                        preferred);
    used = 0;
  }
  const Place place{&chunks.back(), used};
  used += aligned;
  return place;
}

void Batch::State::Arena::reset() {
  std::uint64_t total = 0;
  for (const auto& chunk : chunks) total += chunk.size;
  // Reuses a single chunk from its start; replaces several chunks by a larger one in the next run.
  first_chunk_bytes = total > kMaxKeptBytes ? 0 : total;
  if (chunks.size() > 1 || first_chunk_bytes == 0) chunks.clear();
  used = 0;
}

vk::raii::CommandBuffer& Batch::State::record() {
  if (!recording) {
    pool.reset();
    commands.begin({.flags = vk::CommandBufferUsageFlagBits::eOneTimeSubmit});
    commands.resetQueryPool(*queries, 0, 2 * kMaxTimed);
    recording = true;
  }
  // Also at the start of a batch: earlier submissions may still be running.
  constexpr auto kStages = vk::PipelineStageFlagBits::eComputeShader | vk::PipelineStageFlagBits::eTransfer |
                           vk::PipelineStageFlagBits::eDrawIndirect;
  commands.pipelineBarrier(
      kStages, kStages, {},
      vk::MemoryBarrier{.srcAccessMask = vk::AccessFlagBits::eMemoryWrite,
                        .dstAccessMask = vk::AccessFlagBits::eMemoryRead | vk::AccessFlagBits::eMemoryWrite},
      {}, {});
  return commands;
}

void Batch::State::submit() {
  commands.pipelineBarrier(vk::PipelineStageFlagBits::eComputeShader | vk::PipelineStageFlagBits::eTransfer,
                           vk::PipelineStageFlagBits::eHost, {},
                           vk::MemoryBarrier{.srcAccessMask = vk::AccessFlagBits::eMemoryWrite,
                                             .dstAccessMask = vk::AccessFlagBits::eHostRead},
                           {}, {});
  commands.end();
  submission = device.submitted + 1;
  const vk::TimelineSemaphoreSubmitInfo number{.signalSemaphoreValueCount = 1, .pSignalSemaphoreValues = &submission};
  device.queue->submit(vk::SubmitInfo{.pNext = &number,
                                      .commandBufferCount = 1,
                                      .pCommandBuffers = &*commands,
                                      .signalSemaphoreCount = 1,
                                      .pSignalSemaphores = &**device.timeline});
  ++device.submitted;
  recording = false;
}

void Batch::State::finish() {
  for (const auto& d : pending_downloads) std::memcpy(d.to.data(), d.from.chunk->mapped + d.from.offset, d.to.size());
  if (!timed.empty()) {
    const auto count = static_cast<std::uint32_t>(2 * timed.size());
    const auto [result, ticks] = queries.getResults<std::uint64_t>(0, count, count * sizeof(std::uint64_t),
                                                                   sizeof(std::uint64_t), vk::QueryResultFlagBits::e64);
    for (std::size_t i = 0; result == vk::Result::eSuccess && i < timed.size(); ++i) {
      auto& time = device.times[*timed[i]];
      ++time.calls;
      time.total_ms += 1e-6 * device.timestamp_period_ns * static_cast<double>(ticks[2 * i + 1] - ticks[2 * i]);
    }
  }
  timed.clear();
  pending_downloads.clear();
  uploads.reset();
  downloads.reset();
}

void Device::State::wait_for(std::uint64_t submission) {
  if (submission <= completed) return;
  ++traffic.waits;
  const vk::SemaphoreWaitInfo wait{.semaphoreCount = 1, .pSemaphores = &**timeline, .pValues = &submission};
  if (device->waitSemaphores(wait, UINT64_MAX) != vk::Result::eSuccess)
    throw std::runtime_error("device " + info.name + " did not finish its work");
  retire(submission);
}

bool Device::State::is_idle() {
  if (completed < submitted) retire(timeline->getCounterValue());
  return completed == submitted;
}

void Device::State::wait_idle() noexcept {
  try {
    if (!is_idle()) wait_for(submitted);
  } catch (const std::exception&) {  // a lost device uses no memory
  }
}

void Device::State::retire(std::uint64_t submission) {
  completed = std::max(completed, submission);
  while (!in_flight.empty() && in_flight.front()->submission <= completed) {
    auto batch = std::move(in_flight.front());
    in_flight.pop_front();
    batch->finish();
    idle_batches.push_back(std::move(batch));
  }
}

std::unique_ptr<Batch::State> Device::State::empty_batch() {
  if (idle_batches.empty()) return std::make_unique<Batch::State>(*this);
  auto batch = std::move(idle_batches.back());
  idle_batches.pop_back();
  return batch;
}

Batch::Batch(Device& device) : state_(device.state().empty_batch()) {}

Batch::~Batch() {
  if (!state_) return;
  assert((!state_->recording || std::uncaught_exceptions() > 0) && "a batch was recorded and never run");
  // A batch cut off by an exception may refer to destroyed objects, so it is not reused.
  if (!state_->recording) state_->device.idle_batches.push_back(std::move(state_));
}

void Batch::upload_bytes(const Buffer& to, std::span<const std::byte> data, std::uint64_t offset) {
  if (data.empty()) return;
  check_range("upload", to, offset, data.size());
  state_->device.traffic.uploaded += data.size();
  // Direct copy if this batch is still empty and no other batch is in flight.
  if (std::byte* mapped = to.state().allocation.mapped;
      mapped != nullptr && !state_->recording && state_->device.is_idle()) {
    std::memcpy(mapped + offset, data.data(), data.size());
    return;
  }
  const auto place = state_->uploads.take(state_->device, data.size(), vk::BufferUsageFlagBits::eTransferSrc, {});
  std::memcpy(place.chunk->mapped + place.offset, data.data(), data.size());
  state_->record().copyBuffer(*place.chunk->buffer, *to.state().allocation.buffer,
                              vk::BufferCopy{.srcOffset = place.offset, .dstOffset = offset, .size = data.size()});
}

void Batch::download_bytes(const Buffer& from, std::span<std::byte> data, std::uint64_t offset) {
  if (data.empty()) return;
  check_range("download", from, offset, data.size());
  state_->device.traffic.downloaded += data.size();
  const auto place = state_->downloads.take(state_->device, data.size(), vk::BufferUsageFlagBits::eTransferDst,
                                            vk::MemoryPropertyFlagBits::eHostCached);
  state_->record().copyBuffer(*from.state().allocation.buffer, *place.chunk->buffer,
                              vk::BufferCopy{.srcOffset = offset, .dstOffset = place.offset, .size = data.size()});
  state_->pending_downloads.push_back({place, data});
}

void Batch::copy(const Buffer& from, const Buffer& to) {
  check_range("copy", to, 0, from.size());
  state_->record().copyBuffer(*from.state().allocation.buffer, *to.state().allocation.buffer,
                              vk::BufferCopy{.size = from.size()});
}

void Batch::fill(const Buffer& buffer, std::uint32_t word, std::uint64_t offset, std::uint64_t bytes) {
  check_range("fill", buffer, offset, bytes);
  state_->record().fillBuffer(*buffer.state().allocation.buffer, offset, bytes == 0 ? VK_WHOLE_SIZE : bytes, word);
}

void Batch::run() {
  if (!state_->recording) return;
  Device::State& device = state_->device;
  state_->submit();
  try {
    device.wait_for(state_->submission);
  } catch (...) {
    state_->pending_downloads.clear();  // their spans may become invalid while the device still works
    device.in_flight.push_back(std::move(state_));
    throw;
  }
  state_->finish();
}

void Batch::submit() {
  if (!state_->recording) return;
  Device::State& device = state_->device;
  state_->submit();
  device.in_flight.push_back(std::move(state_));
  if (device.in_flight.size() > kMaxInFlight) device.wait_for(device.in_flight.front()->submission);
  state_ = device.empty_batch();
}

}  // namespace cairn::gpu
