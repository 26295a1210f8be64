// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "plan/storey_plan.hpp"

namespace cairn::plan {
namespace {

constexpr double kRoom = 8;       // meters between two opposite known cells, at most
constexpr double kCoarse = 0.05;  // meters of a cell: sufficient for an outline

/// By cell, distance in cells to the nearest known cell before it in its row; in its column for a transposed mask.
cv::Mat1i cells_back(const Mask& known) {
  constexpr int kNever = std::numeric_limits<int>::max() / 4;
  cv::Mat1i back(known.size());
  for (int y = 0; y < known.rows; ++y)
    for (int x = 0, away = kNever; x < known.cols; ++x) {
      away = known(y, x) != 0 ? 0 : std::min(kNever, away + 1);
      back(y, x) = away;
    }
  return back;
}

cv::Mat1i cells_on(const Mask& known) {
  Mask turned;
  cv::flip(known, turned, 1);
  cv::Mat1i on = cells_back(turned);
  cv::flip(on, on, 1);
  return on;
}

/// Inside of a building with walls parallel to the mask's sides.
Mask within_straight(const Mask& known, int room) {
  const Mask across = known.t();
  const cv::Mat1i left = cells_back(known), right = cells_on(known), up = cells_back(across).t(),
                  down = cells_on(across).t();
  Mask inside(known.size(), 0);
  for (int y = 0; y < known.rows; ++y)
    for (int x = 0; x < known.cols; ++x) {
      const bool along = left(y, x) + right(y, x) <= room, upright = up(y, x) + down(y, x) <= room;
      const bool beside = std::min(left(y, x), right(y, x)) <= room, above = std::min(up(y, x), down(y, x)) <= room;
      if ((along && above) || (upright && beside)) inside(y, x) = 255;
    }
  return inside;
}

}  // namespace

Mask within_outline(const Grid& grid, const Mask& known, double angle) {
  // A rotated copy is as large as the mask's diagonal.
  const double scale = std::min(1.0, grid.cell / kCoarse);
  const int side = static_cast<int>(std::ceil(scale * std::hypot(known.cols, known.rows))) + 2;
  const cv::Point2f middle(static_cast<float>(known.cols) / 2, static_cast<float>(known.rows) / 2);
  cv::Mat1d turn = cv::getRotationMatrix2D(middle, angle * 180 / std::numbers::pi, scale);
  turn(0, 2) += (side - known.cols) / 2.0;
  turn(1, 2) += (side - known.rows) / 2.0;
  Mask turned, inside;
  cv::warpAffine(known, turned, turn, {side, side}, cv::INTER_NEAREST);
  const int room = static_cast<int>(std::lround(kRoom * scale / grid.cell));
  cv::warpAffine(within_straight(turned, room), inside, turn, known.size(), cv::INTER_NEAREST | cv::WARP_INVERSE_MAP);
  Mask outside = known.clone();
  cv::floodFill(outside, cv::Point(0, 0), 255);  // the margin is empty
  return inside | known | ~outside;
}

}  // namespace cairn::plan
