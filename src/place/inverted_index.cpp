// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "place/inverted_index.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <optional>
#include <stdexcept>
#include <utility>

#include "base/spool.hpp"

namespace cairn {
namespace {

// A posting: the low bits of a key, and an entry's index within its run. Postings are sorted by the key's high bits,
// which are implicit, then as numbers.
constexpr int kEntryBits = 14;
constexpr int kLowBits = 32 - kEntryBits;
constexpr int kHighBits = InvertedIndex::kKeyBits - kLowBits;
constexpr std::size_t kMaxRunEntries = std::size_t{1} << kEntryBits;  // entries in a run
constexpr std::size_t kMaxMemoryEntries = 256;  // entries: shorter runs stay in memory, 7 MB together
constexpr std::size_t kMinLengthRatio = 3;      // min. ratio of a run's length to the next run's
constexpr std::size_t kMaxRuns = 32;            // with more runs, add() waits for the merge
constexpr std::size_t kMaxPostingsPerCell = 8;  // maximum, on average
constexpr std::size_t kMaxEntriesPerKey = 256;  // entries: more frequent keys are ignored
constexpr std::size_t kKeysPerLookup = 256;     // keys per lookup

using Words = std::span<const std::uint32_t>;

constexpr std::uint32_t posting(std::uint32_t key, std::size_t entry) {
  return key << kEntryBits | static_cast<std::uint32_t>(entry);
}

constexpr std::size_t entry_of(std::uint32_t posting) { return posting & (kMaxRunEntries - 1); }

/// Postings of a key in its cell; not all if there are more than kMaxEntriesPerKey.
Words postings_of(std::uint32_t key, Words cell) {
  const std::uint32_t low = posting(key, 0) >> kEntryBits;
  const auto is_key = [&](std::size_t i) { return i < cell.size() && cell[i] >> kEntryBits == low; };
  std::size_t from = 0;
  while (from < cell.size() && cell[from] >> kEntryBits < low) ++from;
  std::size_t to = is_key(from + kMaxEntriesPerKey) ? from + kMaxEntriesPerKey + 1 : from;
  while (to <= from + kMaxEntriesPerKey && is_key(to)) ++to;
  return cell.subspan(from, to - from);
}

/// Words in memory or in an unnamed file.
class Storage {
 public:
  /// In memory without a folder. Throws std::runtime_error.
  explicit Storage(const std::optional<std::filesystem::path>& folder) {
    if (folder) file_.emplace(*folder / "places");
  }
  void append(Words words) {
    if (file_)
      file_->append({reinterpret_cast<const char*>(words.data()), words.size_bytes()});
    else
      memory_.insert(memory_.end(), words.begin(), words.end());
  }
  [[nodiscard]] bool in_file() const { return file_.has_value(); }
  [[nodiscard]] Words all() {
    if (!file_) return memory_;
    const std::string_view bytes = file_->mapped();
    return {reinterpret_cast<const std::uint32_t*>(bytes.data()), bytes.size() / sizeof(std::uint32_t)};
  }

 private:
  std::vector<std::uint32_t> memory_;
  std::optional<Spool> file_;
};

}  // namespace

/// Postings of consecutive entries, and the start of each cell of keys with the same first bits.
struct InvertedIndex::Run {
  /// Run of a single entry.
  Run(std::size_t entry, Words keys);
  /// Merged run of two runs, the second's entries after the first's.
  Run(const Run& a, const Run& b, const std::optional<std::filesystem::path>& folder);

  [[nodiscard]] std::size_t end() const { return first + count; }
  /// Postings of some keys; incomplete for a key with more than kMaxEntriesPerKey entries. Prefetches the cells, so
  /// that memory latencies overlap.
  void find(Words keys, std::vector<Words>& found) const {
    std::array<Words, kKeysPerLookup> cells;
    for (std::size_t k = 0; k < keys.size(); ++k) {
      const std::uint32_t cell = keys[k] >> (kKeyBits - cell_bits);
      cells[k] = postings.subspan(begins[cell], begins[cell + 1] - begins[cell]);
      __builtin_prefetch(cells[k].data());
    }
    for (std::size_t k = 0; k < keys.size(); ++k) found.push_back(postings_of(keys[k], cells[k]));
  }
  /// Postings of the keys with these high bits.
  [[nodiscard]] Words with(std::size_t high) const {
    const int more = cell_bits - kHighBits;
    const std::size_t begin = begins[high << more], end = begins[(high + 1) << more];
    return postings.subspan(begin, end - begin);
  }

  std::size_t first, count;  // entries
  int cell_bits;
  Storage storage;
  Words postings, begins;

 private:
  void choose_cells(std::size_t size) {
    cell_bits = std::clamp(static_cast<int>(std::bit_width(size / kMaxPostingsPerCell)), kHighBits, kKeyBits);
  }
  /// Counts the next postings in their cells.
  void count_cells(std::size_t high, Words next, std::vector<std::uint32_t>& ends) const {
    const int more = cell_bits - kHighBits;
    for (const std::uint32_t p : next) ++ends[1 + (high << more | std::size_t{p} >> (32 - more))];
  }
  /// Appends the cells after all postings are stored.
  void finish(std::vector<std::uint32_t> ends) {
    for (std::size_t i = 1; i < ends.size(); ++i) ends[i] += ends[i - 1];
    storage.append(ends);
    const Words all = storage.all();
    postings = all.first(ends.back());
    begins = all.subspan(ends.back());
  }
};

InvertedIndex::Run::Run(std::size_t entry, Words keys) : first(entry), count(1), storage(std::nullopt) {
  choose_cells(keys.size());
  std::vector<std::uint32_t> ends((std::size_t{1} << cell_bits) + 1), all;
  for (const std::uint32_t key : keys) {
    all.push_back(posting(key, 0));
    ++ends[1 + (key >> (kKeyBits - cell_bits))];
  }
  storage.append(all);
  finish(std::move(ends));
}

InvertedIndex::Run::Run(const Run& a, const Run& b, const std::optional<std::filesystem::path>& folder)
    : first(a.first), count(a.count + b.count), storage(folder) {
  choose_cells(a.postings.size() + b.postings.size());
  std::vector<std::uint32_t> ends((std::size_t{1} << cell_bits) + 1), later, all;
  for (std::size_t high = 0; high < std::size_t{1} << kHighBits; ++high) {
    const Words of_a = a.with(high), of_b = b.with(high);
    later.assign(of_b.begin(), of_b.end());
    for (std::uint32_t& p : later) p += static_cast<std::uint32_t>(a.count);
    all.resize(of_a.size() + later.size());
    std::merge(of_a.begin(), of_a.end(), later.begin(), later.end(), all.begin());
    count_cells(high, all, ends);
    storage.append(all);
  }
  finish(std::move(ends));
}

InvertedIndex::InvertedIndex(std::filesystem::path folder) : folder_(std::move(folder)) {}
InvertedIndex::~InvertedIndex() = default;  // waits for the merge
InvertedIndex::InvertedIndex(InvertedIndex&&) noexcept = default;
InvertedIndex& InvertedIndex::operator=(InvertedIndex&&) noexcept = default;

/// True if two consecutive runs are to be merged.
bool InvertedIndex::should_merge(std::size_t i) const {
  const std::size_t a = runs_[i]->count, b = runs_[i + 1]->count;
  return a < kMinLengthRatio * b && a + b <= kMaxRunEntries;
}

void InvertedIndex::add(Words keys) {
  if (runs_.size() > kMaxRuns && merging_.valid()) merging_.wait();
  take_merged();
  runs_.push_back(std::make_shared<const Run>(size_++, keys));
  const std::size_t free = merging_.valid() ? merged_at_ + 2 : 0;
  while (runs_.size() >= free + 2) {
    const std::size_t i = runs_.size() - 2;
    if (!should_merge(i) || runs_[i]->count + runs_[i + 1]->count >= kMaxMemoryEntries) break;
    runs_[i] = std::make_shared<const Run>(*runs_[i], *runs_[i + 1], std::nullopt);
    runs_.pop_back();
  }
  if (!merging_.valid()) merge_in_files();
}

/// Starts to merge the first two runs that form a long run.
void InvertedIndex::merge_in_files() {
  for (std::size_t i = 0; i + 1 < runs_.size(); ++i) {
    if (!should_merge(i) || runs_[i]->count + runs_[i + 1]->count < kMaxMemoryEntries) continue;
    merged_at_ = i;
    merging_ = std::async(std::launch::async, [a = runs_[i], b = runs_[i + 1], folder = folder_] {
      try {
        return std::make_shared<const Run>(*a, *b, folder);
      } catch (const std::runtime_error&) {
        return std::make_shared<const Run>(*a, *b, std::nullopt);
      }
    });
    return;
  }
}

void InvertedIndex::take_merged() {
  if (!merging_.valid() || merging_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return;
  runs_[merged_at_] = merging_.get();
  runs_.erase(runs_.begin() + static_cast<std::ptrdiff_t>(merged_at_) + 1);
}

std::vector<float> InvertedIndex::rarity_in_common(Words keys) const {
  std::vector<float> sums(size_, 0.0f);
  std::vector<Words> found;  // by run, then by key
  for (; !keys.empty(); keys = keys.subspan(std::min(kKeysPerLookup, keys.size()))) {
    const Words some = keys.first(std::min(kKeysPerLookup, keys.size()));
    found.clear();
    for (const auto& run : runs_) run->find(some, found);
    for (std::size_t k = 0; k < some.size(); ++k) {
      std::size_t total = 0;
      for (std::size_t r = 0; r < runs_.size(); ++r) total += found[r * some.size() + k].size();
      if (total > kMaxEntriesPerKey) continue;
      const float rarity = 1.0f / static_cast<float>(total);
      for (std::size_t r = 0; r < runs_.size(); ++r)
        for (const std::uint32_t p : found[r * some.size() + k]) sums[runs_[r]->first + entry_of(p)] += rarity;
    }
  }
  return sums;
}

InvertedIndex::Bytes InvertedIndex::bytes() const {
  Bytes bytes;
  for (const auto& run : runs_)
    (run->storage.in_file() ? bytes.in_files : bytes.in_memory) +=
        run->postings.size_bytes() + run->begins.size_bytes();
  return bytes;
}

}  // namespace cairn
