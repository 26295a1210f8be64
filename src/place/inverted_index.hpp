// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <future>
#include <memory>
#include <span>
#include <vector>

namespace cairn {

/// Inverted index from keys to entries. Stored as sorted runs of postings that are merged as they grow (a
/// log-structured merge-tree: O'Neil et al. 1996): short runs in memory, long runs in unnamed, memory-mapped files, so
/// that their pages are cached as far as there is room. File merges run concurrently with add(); query results do not
/// depend on them.
class InvertedIndex {
 public:
  static constexpr int kKeyBits = 27;

  /// `folder`: for the files. Runs that cannot be written there stay in memory.
  explicit InvertedIndex(std::filesystem::path folder);
  ~InvertedIndex();
  InvertedIndex(InvertedIndex&&) noexcept;
  InvertedIndex& operator=(InvertedIndex&&) noexcept;

  /// Adds the next entry. `keys`: sorted, unique, of kKeyBits, with uniformly distributed first bits.
  void add(std::span<const std::uint32_t> keys);
  [[nodiscard]] std::size_t size() const { return size_; }
  /// For each entry, the sum over its matching keys of the inverse number of entries with the key: frequent keys weigh
  /// little, and keys of more than 256 entries nothing. `keys`: as for add().
  [[nodiscard]] std::vector<float> rarity_in_common(std::span<const std::uint32_t> keys) const;

  struct Bytes {
    std::size_t in_memory = 0, in_files = 0;
  };
  [[nodiscard]] Bytes bytes() const;
  /// True until an add() after the end of the merge.
  [[nodiscard]] bool is_merging() const { return merging_.valid(); }

 private:
  struct Run;
  using Runs = std::vector<std::shared_ptr<const Run>>;
  [[nodiscard]] bool should_merge(std::size_t i) const;
  void merge_in_files();
  void take_merged();
  std::filesystem::path folder_;
  std::size_t size_ = 0;
  Runs runs_;  // of consecutive entries
  std::size_t merged_at_ = 0;
  std::future<std::shared_ptr<const Run>> merging_;  // of the runs merged_at_ and merged_at_ + 1
};

}  // namespace cairn
