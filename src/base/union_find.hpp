// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Sets that are joined pair by pair: union-find with path halving (Tarjan & van Leeuwen 1984).
#pragma once
#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

namespace cairn {

/// Sets of the numbers from 0 on, each alone at first. A set is known by its lowest member, whatever the order in which
/// it was joined.
template <class Index>
class UnionFind {
 public:
  explicit UnionFind(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), Index{0}); }

  /// The lowest member of the set that `i` is in.
  [[nodiscard]] Index find(Index i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  /// Makes one set of those that `a` and `b` are in. Returns its lowest member.
  Index join(Index a, Index b) {
    a = find(a), b = find(b);
    return parent_[std::max(a, b)] = std::min(a, b);
  }
  /// By number: find().
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
