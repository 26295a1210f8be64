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

/// Which entries have a key. It is kept as sorted runs of postings that are merged as they come (a log-structured
/// merge-tree: O'Neil et al. 1996): short ones in memory, long ones in nameless files, mapped, so that their pages are
/// in memory as far as there is room. A merge in files goes on beside whoever adds; what is found does not depend on
/// it.
class InvertedIndex {
 public:
  static constexpr int kKeyBits = 27;

  /// `folder`: where the files are. What cannot be written there stays in memory.
  explicit InvertedIndex(std::filesystem::path folder);
  ~InvertedIndex();
  InvertedIndex(InvertedIndex&&) noexcept;
  InvertedIndex& operator=(InvertedIndex&&) noexcept;

  /// Adds the next entry. `keys`: sorted, each once, of kKeyBits, the first of which are spread evenly.
  void add(std::span<const std::uint32_t> keys);
  [[nodiscard]] std::size_t size() const { return size_; }
  /// For each entry, the sum over the keys that it has of one over the number of entries that have it: a key of many
  /// tells little, and one of more than 256 nothing. `keys`: as for add().
  [[nodiscard]] std::vector<float> rarity_in_common(std::span<const std::uint32_t> keys) const;

  struct Bytes {
    std::size_t in_memory = 0, in_files = 0;
  };
  [[nodiscard]] Bytes bytes() const;
  /// Until somebody adds after its end.
  [[nodiscard]] bool is_merging() const { return merging_.valid(); }

 private:
  struct Run;
  using Runs = std::vector<std::shared_ptr<const Run>>;
  [[nodiscard]] bool belong_together(std::size_t i) const;
  void merge_in_files();
  void take_merged();
  std::filesystem::path folder_;
  std::size_t size_ = 0;
  Runs runs_;  // of entries one after the other
  std::size_t merged_at_ = 0;
  std::future<std::shared_ptr<const Run>> merging_;  // of the runs merged_at_ and the next
};

}  // namespace cairn
