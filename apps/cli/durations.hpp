// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <algorithm>
#include <chrono>
#include <cstddef>
#include <vector>

namespace cairn::apps {

[[nodiscard]] inline double milliseconds(std::chrono::steady_clock::duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

/// Statistics of repeated durations. Counts all, but stores only the newest, so that memory does not grow with the
/// length of a run.
class Durations {
 public:
  void add(double ms) {
    if (newest_.size() < kMaxStored)
      newest_.push_back(ms);
    else
      newest_[count_ % kMaxStored] = ms;
    ++count_;
    total_ += ms;
    max_ = std::max(max_, ms);
  }
  [[nodiscard]] std::size_t count() const { return count_; }
  [[nodiscard]] double total() const { return total_; }
  [[nodiscard]] double max() const { return max_; }
  [[nodiscard]] double mean() const { return count_ == 0 ? 0 : total_ / static_cast<double>(count_); }
  /// Percentile of the newest 4,000 durations; `share` from 0 to 1.
  [[nodiscard]] double percentile(double share) const {
    if (newest_.empty()) return 0;
    std::vector<double> values = newest_;
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
  }

 private:
  static constexpr std::size_t kMaxStored = 4000;
  std::vector<double> newest_;
  std::size_t count_ = 0;
  double total_ = 0, max_ = 0;
};

}  // namespace cairn::apps
