// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/datasets/enlarged.hpp"

#include <algorithm>
#include <cmath>

namespace cairn {
namespace {

constexpr double kMinFactor = 1.2;  // below, borders without changes are few and may occur by chance
constexpr int kMinBorders = 16;     // borders with changes, in each direction: a flat wall shows none
constexpr double kMinOpenRatio =
    0.9;  // share of grid borders between the first and the last change that must show changes
constexpr int kBordersPerMismatch = 64;  // borders per tolerated mismatch: OpenCV rounds the first ties down
constexpr double kMaxFactorRatio = 1.1;  // ratio of the factors along columns and rows

template <class T>
void count(const cv::Mat& image, int invalid, std::vector<std::int64_t>& columns, std::vector<std::int64_t>& rows) {
  const auto is_measured = [&](T value) { return value > 0 && value != static_cast<T>(invalid); };
  for (int y = 0; y < image.rows; ++y) {
    const T* row = image.ptr<T>(y);
    const T* above = image.ptr<T>(std::max(y - 1, 0));
    for (int x = 0; x < image.cols; ++x) {
      if (!is_measured(row[x])) continue;
      if (x > 0 && is_measured(row[x - 1]) && row[x] != row[x - 1]) ++columns[static_cast<std::size_t>(x)];
      if (is_measured(above[x]) && row[x] != above[x]) ++rows[static_cast<std::size_t>(y)];
    }
  }
}

/// First pixels of `blocks` blocks in a line of `pixels`: pixel x belongs to block floor((x + shift) * blocks /
/// pixels), as in OpenCV (shift 0), and in PIL and scikit-image (0.5).
std::vector<int> grid(int pixels, int blocks, double shift) {
  std::vector<int> first;
  int last = -1;
  for (int x = 0; x < pixels; ++x) {
    const int block = std::min(static_cast<int>(std::floor((x + shift) * blocks / pixels + 1e-9)), blocks - 1);
    if (block != last) first.push_back(x);
    last = block;
  }
  return first;
}

/// True if changes occur at nearly all grid borders between the first and the last, and hardly anywhere else.
bool fits(const std::vector<int>& grid, const std::vector<std::int64_t>& changes, int first, int last) {
  int inside = 0, open = 0, all = 0;
  std::size_t next = 0;
  for (int x = first; x <= last; ++x) {
    while (next < grid.size() && grid[next] < x) ++next;
    const bool is_border = next < grid.size() && grid[next] == x,
               has_changes = changes[static_cast<std::size_t>(x)] > 0;
    inside += has_changes && !is_border;
    all += is_border;
    open += has_changes && is_border;
  }
  return inside * kBordersPerMismatch <= all && open >= kMinOpenRatio * all;
}

/// Returns the first pixels of the blocks in one direction; empty if the image has no blocks.
std::vector<int> blocks_along(const std::vector<std::int64_t>& changes) {
  const int pixels = static_cast<int>(changes.size());
  int first = -1, last = -1, borders = 0;
  for (int x = 1; x < pixels; ++x) {
    if (changes[static_cast<std::size_t>(x)] == 0) continue;
    if (first < 0) first = x;
    last = x;
    ++borders;
  }
  if (borders < kMinBorders) return {};
  const double factor = static_cast<double>(last - first) / (borders - 1);
  if (factor < kMinFactor) return {};
  // Borders without a change, and the margins, leave the number of blocks ambiguous.
  const int max_blocks = static_cast<int>(pixels / kMinFactor),
            estimate = static_cast<int>(std::lround(pixels / factor));
  for (int blocks = std::max(borders, estimate - 1); blocks <= std::min(max_blocks, estimate + estimate / 8 + 2);
       ++blocks)
    for (const double shift : {0.0, 0.5})
      if (auto found = grid(pixels, blocks, shift); fits(found, changes, first, last)) return found;
  return {};
}

}  // namespace

void DepthChanges::add(const cv::Mat& image, int invalid) {
  if (width_ == 0) {
    width_ = image.cols, height_ = image.rows;
    columns_.resize(static_cast<std::size_t>(width_));
    rows_.resize(static_cast<std::size_t>(height_));
  }
  if (image.cols != width_ || image.rows != height_) return;
  if (image.type() == CV_16UC1)
    count<std::uint16_t>(image, invalid, columns_, rows_);
  else
    count<float>(image, invalid, columns_, rows_);
}

DepthChanges::Blocks DepthChanges::blocks() const {
  Blocks found{blocks_along(columns_), blocks_along(rows_)};
  if (found.columns.empty() || found.rows.empty()) return {};
  const double ratio = static_cast<double>(width_) * static_cast<double>(found.rows.size()) /
                       (static_cast<double>(height_) * static_cast<double>(found.columns.size()));
  return ratio < kMaxFactorRatio && ratio > 1 / kMaxFactorRatio ? found : Blocks{};
}

}  // namespace cairn
