// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "place/matches.hpp"

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

namespace cairn {
namespace {

constexpr int kMaxHamming = 64;  // max. differing bits of 256 between two views of a corner

using Words = std::array<std::uint64_t, 4>;  // of a descriptor
struct Nearest {
  std::size_t index = 0;
  int bits = std::numeric_limits<int>::max();  // Hamming distance
};

std::vector<Words> words_of(const Features& features) {
  std::vector<Words> words(features.descriptors.size());
  static_assert(sizeof(Words) == sizeof(features.descriptors[0]));
  if (!words.empty()) std::memcpy(words.data(), features.descriptors.data(), words.size() * sizeof(Words));
  return words;
}

/// Nearest neighbors in both directions; the first of equally near ones.
[[gnu::always_inline]] inline void compare(const std::vector<Words>& a, const std::vector<Words>& b,
                                           std::vector<Nearest>& of_a, std::vector<Nearest>& of_b) {
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Words from = a[i];
    Nearest nearest;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const Words& to = b[j];
      const int bits = std::popcount(from[0] ^ to[0]) + std::popcount(from[1] ^ to[1]) +
                       std::popcount(from[2] ^ to[2]) + std::popcount(from[3] ^ to[3]);
      if (bits < nearest.bits) nearest = {j, bits};
      if (bits < of_b[j].bits) of_b[j] = {i, bits};
    }
    of_a[i] = nearest;
  }
}

void compare_plainly(const std::vector<Words>& a, const std::vector<Words>& b, std::vector<Nearest>& of_a,
                     std::vector<Nearest>& of_b) {
  compare(a, b, of_a, of_b);
}
#ifdef __x86_64__  // the first x86-64 processors have no popcount instruction
[[gnu::target("popcnt")]] void compare_quickly(const std::vector<Words>& a, const std::vector<Words>& b,
                                               std::vector<Nearest>& of_a, std::vector<Nearest>& of_b) {
  compare(a, b, of_a, of_b);
}
const bool is_quick = __builtin_cpu_supports("popcnt") != 0;
#else
constexpr auto compare_quickly = compare_plainly;
constexpr bool is_quick = false;
#endif

}  // namespace

Matches match(const Features& known, const Features& seen) {
  const std::vector<Words> of_seen = words_of(seen), of_known = words_of(known);
  std::vector<Nearest> known_of(of_seen.size()), seen_of(of_known.size());
  (is_quick ? compare_quickly : compare_plainly)(of_seen, of_known, known_of, seen_of);
  Matches matches;
  for (std::size_t s = 0; s < known_of.size(); ++s) {
    const auto [k, bits] = known_of[s];
    if (bits > kMaxHamming || seen_of[k].index != s) continue;
    const Eigen::Vector3d& p = known.points[k];
    if (p.z() <= 0) continue;
    matches.points.emplace_back(p.x(), p.y(), p.z());
    matches.rays.emplace_back(seen.rays[s].x(), seen.rays[s].y());
  }
  return matches;
}

}  // namespace cairn
