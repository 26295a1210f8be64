// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "place/keyframe_database.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace cairn {
namespace {

// A descriptor of 256 bits has 8 substrings of 32 bits, and a key is the first kBits of a substring (as in multi-index
// hashing: Norouzi, Punjani & Fleet 2012). Two views of a corner differ by some 30 bits: longer keys are seldom shared
// by them, and shorter keys are shared by too many other corners.
constexpr std::uint32_t kTables = 8, kBits = 24;
constexpr std::uint32_t kKeys = kTables << kBits;
static_assert(kKeys == std::uint32_t{1} << InvertedIndex::kKeyBits);

using Descriptor = std::array<std::uint8_t, 32>;

/// Substring index and bits, mixed for uniformly distributed first bits; an odd factor keeps the keys distinct.
std::uint32_t key(std::uint32_t table, const Descriptor& descriptor) {
  const std::uint8_t* const bytes = &descriptor[4 * std::size_t{table}];
  const std::uint32_t bits = std::uint32_t{bytes[0]} | std::uint32_t{bytes[1]} << 8 | std::uint32_t{bytes[2]} << 16;
  return (table << kBits | bits) * 0x9e3779b1u % kKeys;
}

/// Sorted, unique.
std::vector<std::uint32_t> keys_of(const Features& features) {
  std::vector<std::uint32_t> keys;
  keys.reserve(kTables * features.descriptors.size());
  for (std::uint32_t t = 0; t < kTables; ++t)
    for (const Descriptor& descriptor : features.descriptors) keys.push_back(key(t, descriptor));
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  return keys;
}

}  // namespace

KeyframeDatabase::KeyframeDatabase(std::filesystem::path folder) : index_(std::move(folder)) {}

void KeyframeDatabase::add(const std::optional<Eigen::Isometry3d>& tracked_from_camera, const Features& features) {
  add(tracked_from_camera);
  index(features);
}

void KeyframeDatabase::add(const std::optional<Eigen::Isometry3d>& tracked_from_camera, FutureFeatures features) {
  add(tracked_from_camera);
  const std::lock_guard lock(mutex_);
  pending_.push_back(std::move(features));
}

void KeyframeDatabase::index(const Features& features) {
  const auto lock = index_pending();
  index_locked(features);
}

std::size_t KeyframeDatabase::indexed() const {
  const auto lock = index_pending();
  return feature_norms_.size();
}

InvertedIndex::Bytes KeyframeDatabase::bytes() const {
  const auto lock = index_pending();
  return index_.bytes();
}

std::unique_lock<std::mutex> KeyframeDatabase::index_pending() const {
  std::unique_lock lock(mutex_);
  for (const FutureFeatures& features : pending_) index_locked(*features_or_none(features));
  pending_.clear();
  return lock;
}

void KeyframeDatabase::index_locked(const Features& features) const {
  index_.add(keys_of(features));
  feature_norms_.push_back(std::sqrt(static_cast<float>(std::max<std::size_t>(1, features.rays.size()))));
}

std::vector<KeyframeDatabase::Candidate> KeyframeDatabase::query(const Features& features, std::size_t count,
                                                                 std::size_t begin, std::size_t end) const {
  return most_similar(features, count, [&](std::size_t i) { return begin <= i && i < end; });
}

std::vector<KeyframeDatabase::Candidate> KeyframeDatabase::query_tracked(const Features& features,
                                                                         std::size_t count) const {
  return most_similar(features, count, [&](std::size_t i) { return entries_[i].tracked_from_camera.has_value(); });
}

std::vector<KeyframeDatabase::Candidate> KeyframeDatabase::most_similar(
    const Features& features, std::size_t count, const std::function<bool(std::size_t)>& is_candidate) const {
  const auto lock = index_pending();
  const std::vector<float> scores = index_.rarity_in_common(keys_of(features));
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < scores.size(); ++i)
    if (scores[i] > 0 && is_candidate(i)) candidates.push_back({i, scores[i] / feature_norms_[i]});
  count = std::min(count, candidates.size());
  std::partial_sort(candidates.begin(), candidates.begin() + static_cast<std::ptrdiff_t>(count), candidates.end(),
                    [](const Candidate& a, const Candidate& b) {
                      return a.score != b.score ? a.score > b.score : a.entry < b.entry;
                    });
  candidates.resize(count);
  return candidates;
}

}  // namespace cairn
