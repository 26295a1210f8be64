// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "floor_plan/storey_plan.hpp"

namespace cairn::plan {
namespace {

constexpr double kMaxRoomLength = 8;   // meters between two opposite known cells, at most
constexpr double kOutlineCell = 0.05;  // meters of a cell: sufficient for an outline

/// By cell, distance in cells to the nearest known cell before it in its row; in its column for a transposed mask.
cv::Mat1i cells_to_previous(const Mask& observed) {
  constexpr int kNever = std::numeric_limits<int>::max() / 4;
  cv::Mat1i back(observed.size());
  for (int y = 0; y < observed.rows; ++y)
    for (int x = 0, distance = kNever; x < observed.cols; ++x) {
      distance = observed(y, x) != 0 ? 0 : std::min(kNever, distance + 1);
      back(y, x) = distance;
    }
  return back;
}

cv::Mat1i cells_to_next(const Mask& observed) {
  Mask turned;
  cv::flip(observed, turned, 1);
  cv::Mat1i on = cells_to_previous(turned);
  cv::flip(on, on, 1);
  return on;
}

/// Inside of a building with walls parallel to the mask's sides.
Mask within_straight(const Mask& observed, int room) {
  const Mask across = observed.t();
  const cv::Mat1i left = cells_to_previous(observed), right = cells_to_next(observed),
                  up = cells_to_previous(across).t(), down = cells_to_next(across).t();
  Mask inside(observed.size(), 0);
  for (int y = 0; y < observed.rows; ++y)
    for (int x = 0; x < observed.cols; ++x) {
      const bool along = left(y, x) + right(y, x) <= room, upright = up(y, x) + down(y, x) <= room;
      const bool beside = std::min(left(y, x), right(y, x)) <= room, above = std::min(up(y, x), down(y, x)) <= room;
      if ((along && above) || (upright && beside)) inside(y, x) = 255;
    }
  return inside;
}

}  // namespace

Mask within_outline(const Grid& grid, const Mask& observed, double angle) {
  // A rotated copy is as large as the mask's diagonal.
  const double scale = std::min(1.0, grid.cell / kOutlineCell);
  const int side = static_cast<int>(std::ceil(scale * std::hypot(observed.cols, observed.rows))) + 2;
  const cv::Point2f middle(static_cast<float>(observed.cols) / 2, static_cast<float>(observed.rows) / 2);
  cv::Mat1d turn = cv::getRotationMatrix2D(middle, angle * 180 / std::numbers::pi, scale);
  turn(0, 2) += (side - observed.cols) / 2.0;
  turn(1, 2) += (side - observed.rows) / 2.0;
  Mask turned, inside;
  cv::warpAffine(observed, turned, turn, {side, side}, cv::INTER_NEAREST);
  const int room = static_cast<int>(std::lround(kMaxRoomLength * scale / grid.cell));
  cv::warpAffine(within_straight(turned, room), inside, turn, observed.size(),
                 cv::INTER_NEAREST | cv::WARP_INVERSE_MAP);
  Mask outside = observed.clone();
  cv::floodFill(outside, cv::Point(0, 0), 255);  // the margin is empty
  return inside | observed | ~outside;
}

}  // namespace cairn::plan
