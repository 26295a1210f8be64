// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "splats/radix_sort.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <vector>

#include "support/device.hpp"

namespace cairn {
namespace {

std::vector<std::uint32_t> random_words(std::size_t count, std::uint32_t below) {
  std::minstd_rand random(static_cast<unsigned>(count) + 7);
  std::vector<std::uint32_t> words(count);
  for (std::uint32_t& word : words) word = static_cast<std::uint32_t>(random()) % below;
  return words;
}

class RadixSortOf : public testing::TestWithParam<std::uint32_t> {};

TEST_P(RadixSortOf, KeysIsStable) {
  const std::uint32_t count = GetParam();
  const std::vector<std::uint32_t> keys = random_words(count, 5000);
  std::vector<std::uint32_t> expected(count), values(count);
  std::iota(values.begin(), values.end(), 0u);
  expected = values;
  std::stable_sort(expected.begin(), expected.end(), [&](auto a, auto b) { return keys[a] < keys[b]; });
  gpu::Device& device = test_device();
  RadixSort sort(device);
  sort.reserve(count);
  const auto buffer = [&] { return gpu::Buffer(device, 4 * std::uint64_t{count}); };
  RadixSort::Pairs pairs{buffer(), buffer()}, scratch{buffer(), buffer()};
  gpu::Batch batch(device);
  batch.upload(pairs.keys, keys);
  batch.upload(pairs.values, values);
  sort.sort(batch, pairs, scratch, count, 13);
  batch.download(pairs.values, values);
  batch.run();
  EXPECT_EQ(values, expected);
}

TEST_P(RadixSortOf, NumbersGivesPrefixSums) {
  const std::uint32_t count = GetParam();
  std::vector<std::uint32_t> numbers = random_words(count, 9), expected(count), total(1);
  std::exclusive_scan(numbers.begin(), numbers.end(), expected.begin(), 0u);
  gpu::Device& device = test_device();
  RadixSort sort(device);
  const gpu::Buffer buffer(device, 4 * std::uint64_t{count}), sum(device, 4);
  gpu::Batch batch(device);
  batch.upload(buffer, numbers);
  sort.scan(batch, buffer, count, sum);
  batch.download(sum, total);
  const std::uint32_t expected_total = expected.back() + numbers.back();
  batch.download(buffer, numbers);
  batch.run();
  EXPECT_EQ(numbers, expected);
  EXPECT_EQ(total[0], expected_total);
}

INSTANTIATE_TEST_SUITE_P(Counts, RadixSortOf, testing::Values(1u, 255u, 256u, 257u, 100003u));

}  // namespace
}  // namespace cairn
