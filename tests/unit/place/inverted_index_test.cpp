// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "place/inverted_index.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <random>
#include <thread>

#include "support/files.hpp"

namespace cairn {
namespace {

using Keys = std::vector<std::uint32_t>;

/// Keys shared by all entries, keys shared by a few neighboring entries, and keys of a single entry.
Keys keys_of(std::uint32_t entry) {
  std::mt19937 random(entry + 1);
  Keys keys;
  const auto spread = [](std::uint32_t k) { return k * 0x9e3779b1u % (1u << InvertedIndex::kKeyBits); };
  for (std::uint32_t i = 0; i < 10; ++i) keys.push_back(spread(i));
  for (std::uint32_t i = 0; i < 20; ++i) keys.push_back(spread(1000 + entry / 8 * 32 + random() % 32));
  for (std::uint32_t i = 0; i < 20; ++i) keys.push_back(spread(random()));
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  return keys;
}

/// Reference implementation with plain lists.
std::vector<float> rarity_by_lists(std::size_t entries, const Keys& keys) {
  std::map<std::uint32_t, std::vector<std::size_t>> lists;
  for (std::size_t i = 0; i < entries; ++i)
    for (const std::uint32_t key : keys_of(static_cast<std::uint32_t>(i))) lists[key].push_back(i);
  std::vector<float> sums(entries);
  for (const std::uint32_t key : keys)
    if (const auto& list = lists[key]; list.size() <= 256)
      for (const std::size_t i : list) sums[i] += 1.0f / static_cast<float>(list.size());
  return sums;
}

TEST(InvertedIndex, MatchesPlainListsAtEverySize) {
  const TemporaryFolder folder;
  InvertedIndex index(folder.path());
  for (const std::size_t size : {1u, 3u, 100u, 255u, 257u, 900u, 3000u}) {
    while (index.size() < size) index.add(keys_of(static_cast<std::uint32_t>(index.size())));
    for (const std::uint32_t entry : {0u, static_cast<std::uint32_t>(size / 2), static_cast<std::uint32_t>(size) + 5})
      EXPECT_EQ(index.rarity_in_common(keys_of(entry)), rarity_by_lists(size, keys_of(entry))) << size << ", " << entry;
  }
  EXPECT_EQ(index.rarity_in_common({}), std::vector<float>(3000));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 0) << "a file with a name";
}

TEST(InvertedIndex, HasMoreEntriesThanOneRun) {
  const TemporaryFolder folder;
  InvertedIndex index(folder.path());
  constexpr std::uint32_t kEntries = 40000;
  for (std::uint32_t i = 0; i < kEntries; ++i) {
    Keys keys{i, (1u << InvertedIndex::kKeyBits) - 1 - i / 100};
    index.add(keys);
  }
  for (const std::uint32_t i : {0u, 16383u, 16384u, 39999u}) {
    const auto sums = index.rarity_in_common(Keys{i, (1u << InvertedIndex::kKeyBits) - 1 - i / 100});
    EXPECT_FLOAT_EQ(sums[i], 1.01f);
    EXPECT_EQ(std::count_if(sums.begin(), sums.end(), [](float s) { return s > 0; }), 100);
  }
}

TEST(InvertedIndex, KeepsFewOfItsBytesInMemory) {
  const TemporaryFolder folder;
  InvertedIndex index(folder.path());
  for (std::uint32_t i = 0; i < 4000; ++i) index.add(keys_of(i));
  for (; index.is_merging(); index.add(keys_of(0))) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  const auto bytes = index.bytes();
  std::printf("%zu bytes in memory, %zu in files\n", bytes.in_memory, bytes.in_files);
  EXPECT_LT(bytes.in_memory, 100'000u);  // 256 entries of 50 postings, and runs' cells
  EXPECT_GT(bytes.in_files, 700'000u);
}

TEST(InvertedIndex, StaysInMemoryWithoutAWritableFolder) {
  const TemporaryFolder folder;
  InvertedIndex index(folder / "missing");
  for (std::uint32_t i = 0; i < 900; ++i) index.add(keys_of(i));
  EXPECT_EQ(index.bytes().in_files, 0u);
  EXPECT_EQ(index.rarity_in_common(keys_of(450)), rarity_by_lists(900, keys_of(450)));
}

}  // namespace
}  // namespace cairn
