// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "gpu/batch.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "support/device.hpp"

namespace cairn {
namespace {

TEST(Batch, DownloadsEqualUploads) {
  gpu::Device& device = test_device();
  std::vector<std::uint32_t> sent(5 << 20), back(sent.size());  // 20 MiB: larger than a staging chunk
  std::iota(sent.begin(), sent.end(), 7u);
  const gpu::Buffer buffer(device, sent.size() * 4);
  gpu::Batch batch(device);
  batch.upload(buffer, sent);
  batch.download(buffer, back);
  batch.run();
  EXPECT_EQ(sent, back);
}

TEST(Batch, LaterUploadsKeepTheirOrder) {
  gpu::Device& device = test_device();
  std::vector<std::uint32_t> sent(5 << 20), before(4), back(sent.size());
  std::iota(sent.begin(), sent.end(), 7u);
  const gpu::Buffer buffer(device, sent.size() * 4);
  gpu::Batch batch(device);
  batch.fill(buffer, 3);
  batch.download(buffer, before);
  batch.upload(buffer, sent);
  batch.download(buffer, back);
  batch.run();
  EXPECT_EQ(before, std::vector<std::uint32_t>(4, 3));
  EXPECT_EQ(sent, back);
}

TEST(Batch, RunsCommandsInOrder) {
  gpu::Device& device = test_device();
  const gpu::Buffer buffer(device, 16);
  std::vector<std::uint32_t> before(4), after(4);
  gpu::Batch batch(device);
  batch.fill(buffer, 1);
  batch.download(buffer, before);
  batch.fill(buffer, 2, 4, 8);
  batch.download(buffer, after);
  batch.run();
  EXPECT_EQ(before, (std::vector<std::uint32_t>{1, 1, 1, 1}));
  EXPECT_EQ(after, (std::vector<std::uint32_t>{1, 2, 2, 1}));
}

TEST(Batch, RunsAsynchronouslyAndLaterBatchesSeeItsWrites) {
  gpu::Device& device = test_device();
  device.wait();
  const std::uint64_t waits = device.traffic().waits;
  std::vector<std::uint32_t> first(4), second(4), sent{5, 6, 7, 8};
  {
    const gpu::Buffer buffer(device, 16);
    gpu::Batch batch(device);
    batch.fill(buffer, 1);
    batch.download(buffer, first);
    batch.submit();
    batch.upload(buffer, sent);  // must wait for the download
    batch.submit();
    EXPECT_EQ(device.traffic().waits, waits);
    batch.download(buffer, second);
    batch.run();
    EXPECT_EQ(device.traffic().waits, waits + 1);
    EXPECT_EQ(first, std::vector<std::uint32_t>(4, 1));
    EXPECT_EQ(second, sent);
    batch.fill(buffer, 2);
    batch.submit();
  }  // the buffer lives until its last use
  device.wait();
  EXPECT_TRUE(device.validation_messages().empty());
}

TEST(Device, CountsItsMemory) {
  gpu::Device& device = test_device();
  const auto before = device.memory_in_use();
  {
    const gpu::Buffer buffer(device, 1 << 20);
    EXPECT_EQ(device.memory_in_use(), before + (1 << 20));
  }
  EXPECT_EQ(device.memory_in_use(), before);
}

TEST(Device, RejectsAnInvalidIndex) {
  for (const int index : {99, -5})
    EXPECT_THROW(
        try { gpu::Device device(index); } catch (const std::runtime_error& e) {
          EXPECT_NE(std::string(e.what()).find("cairn devices"), std::string::npos);
          throw;
        },
        std::runtime_error);
}

}  // namespace
}  // namespace cairn
