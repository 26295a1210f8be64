// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "place/keyframe_database.hpp"

#include <algorithm>
#include <cmath>
#include <random>

namespace cairn {

KeyframeDatabase::KeyframeDatabase() : buckets_(kTables << kBits) {}

std::uint32_t KeyframeDatabase::key(std::size_t table, const std::array<std::uint8_t, 32>& descriptor) {
  static const auto kSampled = [] {
    std::array<std::array<std::uint32_t, kBits>, kTables> bits{};
    std::mt19937 random(1);
    for (auto& of_table : bits)
      for (auto& bit : of_table) bit = random() % 256;
    return bits;
  }();
  std::uint32_t k = 0;
  for (const std::uint32_t bit : kSampled[table]) k = k << 1 | (descriptor[bit / 8] >> (bit % 8) & 1u);
  return static_cast<std::uint32_t>(table << kBits) | k;
}

void KeyframeDatabase::add(DatabaseEntry entry) {
  const auto id = static_cast<std::uint32_t>(entries_.size());
  for (const auto& descriptor : entry.features.descriptors)
    for (std::size_t t = 0; t < kTables; ++t)
      if (auto& bucket = buckets_[key(t, descriptor)]; bucket.empty() || bucket.back() != id) bucket.push_back(id);
  entries_.push_back(std::move(entry));
}

std::vector<KeyframeDatabase::Candidate> KeyframeDatabase::query(const Features& features, std::size_t count,
                                                                 std::size_t begin, std::size_t end) const {
  end = std::min(end, entries_.size());
  std::vector<float> scores(entries_.size(), 0.0f);
  for (const auto& descriptor : features.descriptors)
    for (std::size_t t = 0; t < kTables; ++t) {
      const auto& bucket = buckets_[key(t, descriptor)];
      for (const std::uint32_t id : bucket) scores[id] += 1.0f / static_cast<float>(bucket.size());
    }
  std::vector<Candidate> alike;
  for (std::size_t i = begin; i < end; ++i)
    if (scores[i] > 0)
      alike.push_back(
          {i, scores[i] / std::sqrt(static_cast<float>(std::max<std::size_t>(1, entries_[i].features.rays.size())))});
  count = std::min(count, alike.size());
  std::partial_sort(alike.begin(), alike.begin() + static_cast<std::ptrdiff_t>(count), alike.end(),
                    [](const Candidate& a, const Candidate& b) {
                      return a.score != b.score ? a.score > b.score : a.entry < b.entry;
                    });
  alike.resize(count);
  return alike;
}

}  // namespace cairn
