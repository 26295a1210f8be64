// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Disjoint sets: union-find with path halving (Tarjan & van Leeuwen 1984).
#pragma once
#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

namespace cairn {

/// Disjoint sets of the numbers from 0 on, initially singletons. The representative of a set is its lowest member,
/// independent of the order of joins.
template <class Index>
class UnionFind {
 public:
  explicit UnionFind(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), Index{0}); }

  /// Lowest member of the set of `i`.
  [[nodiscard]] Index find(Index i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  /// Merges the sets of `a` and `b`. Returns the lowest member.
  Index join(Index a, Index b) {
    a = find(a), b = find(b);
    return parent_[std::max(a, b)] = std::min(a, b);
  }
  /// find() of every number.
  [[nodiscard]] std::vector<Index> all() {
    std::vector<Index> lowest;
    lowest.reserve(parent_.size());
    for (std::size_t i = 0; i < parent_.size(); ++i) lowest.push_back(find(static_cast<Index>(i)));
    return lowest;
  }

 private:
  std::vector<Index> parent_;
};

}  // namespace cairn
