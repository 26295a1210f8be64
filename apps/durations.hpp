// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <algorithm>
#include <cstddef>
#include <vector>

namespace cairn::apps {

/// Times of what happens again and again. All are counted; the newest are kept, so that a run of days takes no more
/// memory than one of minutes.
class Durations {
 public:
  void add(double ms) {
    if (newest_.size() < kKept)
      newest_.push_back(ms);
    else
      newest_[count_ % kKept] = ms;
    ++count_;
    total_ += ms;
    most_ = std::max(most_, ms);
  }
  [[nodiscard]] std::size_t count() const { return count_; }
  [[nodiscard]] double total() const { return total_; }
  [[nodiscard]] double most() const { return most_; }
  [[nodiscard]] double mean() const { return count_ == 0 ? 0 : total_ / static_cast<double>(count_); }
  /// What a share of the newest 4,000 did not exceed.
  [[nodiscard]] double percentile(double share) const {
    if (newest_.empty()) return 0;
    std::vector<double> values = newest_;
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
  }

 private:
  static constexpr std::size_t kKept = 4000;
  std::vector<double> newest_;
  std::size_t count_ = 0;
  double total_ = 0, most_ = 0;
};

}  // namespace cairn::apps
