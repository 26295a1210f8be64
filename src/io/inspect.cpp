// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/inspect.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "base/colour_view.hpp"
#include "base/image_file.hpp"
#include "cairn/atomic_file.hpp"

namespace cairn {
namespace {

constexpr std::size_t kEvery = 37;  // stride of sampled depth pixels; shares no factor with common widths
constexpr double kNearest = 0.05, kFarthest = 100;  // meters, plausible median of a depth camera
constexpr double kLongest = 0.1;                    // seconds between a depth image and its color image
constexpr double kFewMeasured = 0.2;                // share of pixels
constexpr float kJump = 0.05f, kSlope = 0.05f;      // meters, and share of the depth, across a depth edge

/// Quantile of the values at `share`; reorders them.
template <class T>
T quantile(std::vector<T>& values, double share) {
  if (values.empty()) return T{};
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Statistics collected frame by frame.
struct Seen {
  std::vector<double> steps, delays;  // seconds
  std::vector<float> depths;          // meters
  std::size_t pixels = 0;             // total number of pixels
  std::optional<double> first, last;  // seconds
};

void look_at(const Frame& frame, Seen& seen, SourceSummary& summary) {
  if (seen.last) seen.steps.push_back(frame.timestamp - *seen.last);
  if (!seen.first) seen.first = frame.timestamp;
  seen.last = frame.timestamp;
  for (std::size_t i = 0; i < frame.depth.size(); i += kEvery, ++seen.pixels)
    if (frame.depth[i] > 0) seen.depths.push_back(frame.depth[i]);
  if (!frame.colour.empty()) {
    ++summary.with_colour;
    seen.delays.push_back(frame.colour_delay);
  }
  summary.with_pose += frame.world_from_camera.has_value();
  summary.with_acceleration += frame.acceleration.has_value();
  summary.with_gyroscope += !frame.gyro.empty();
  summary.with_confidence += !frame.confidence.empty();
}

std::vector<std::string> doubts_about(const SourceSummary& s) {
  std::vector<std::string> doubts;
  const auto doubt = [&](std::string text) { doubts.push_back(std::move(text)); };
  const int readable = s.looked_at - s.unreadable;
  if (s.unreadable > 0)
    doubt(fmt::format("{} of {} frames cannot be read: {}", s.unreadable, s.looked_at, s.first_problem));
  if (readable == 0) return doubts;
  if (s.median > kFarthest || (s.median > 0 && s.median < kNearest))
    doubt(
        fmt::format("half of the depth is {} than {:.3g} m: the unit of depth is wrong, perhaps by a factor of 1000; "
                    "check depth_scale",
                    s.median > kFarthest ? "farther" : "nearer", s.median));
  if (s.measured_share < kFewMeasured)
    doubt(fmt::format("only {:.0f} % of the depth pixels hold a measurement", 100 * s.measured_share));
  if (s.with_colour == 0)
    doubt("there is no colour: the map is grey, and plain walls are hard to follow");
  else if (s.with_colour < readable)
    doubt(fmt::format("{} of {} frames have no colour image near their time", readable - s.with_colour, readable));
  if (std::abs(s.colour_delay) > kLongest)
    doubt(fmt::format("colour is {:.2f} s beside depth: the two clocks do not agree", s.colour_delay));
  if (s.rate > 0 && s.rate < 5)
    doubt(fmt::format("{:.1f} frames a second are few: the camera must have moved slowly", s.rate));
  return doubts;
}

}  // namespace

SourceSummary inspect(Source& source, int frames) {
  SourceSummary summary;
  summary.layout = source.layout();
  summary.rig = source.rig();
  summary.frames = source.size();
  Seen seen;
  while (summary.looked_at < frames) {
    const auto frame = source.next();
    if (!frame) break;
    ++summary.looked_at;
    if (!frame->problem) {
      look_at(*frame, seen, summary);
    } else if (summary.unreadable++ == 0) {
      summary.first_problem = *frame->problem;
    }
  }
  if (seen.first) summary.seconds = *seen.last - *seen.first;
  if (const double step = quantile(seen.steps, 0.5); step > 0) summary.rate = 1 / step;
  if (seen.pixels > 0)
    summary.measured_share = static_cast<double>(seen.depths.size()) / static_cast<double>(seen.pixels);
  summary.nearest = static_cast<double>(quantile(seen.depths, 0.01));
  summary.median = static_cast<double>(quantile(seen.depths, 0.5));
  summary.farthest = static_cast<double>(quantile(seen.depths, 0.99));
  summary.colour_delay = quantile(seen.delays, 0.5);
  summary.doubts = doubts_about(summary);
  if (const auto early = source.ended_early()) summary.doubts.push_back(*early);
  return summary;
}

void write_edges_picture(const std::filesystem::path& file, const Rig& rig, const Frame& frame) {
  const Camera& camera = rig.colour_view();
  const auto pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  if (frame.colour.size() != pixels)
    throw std::runtime_error("the frame has no colour to draw the edges of depth over");
  const Frame seen = ColourView(rig)(frame);
  cv::Mat rgb;
  cv::cvtColor(cv::Mat(camera.height, camera.width, CV_8UC4, const_cast<std::uint32_t*>(frame.colour.data())), rgb,
               cv::COLOR_RGBA2RGB);
  const auto depth_at = [&](int x, int y) {
    return seen
        .depth[static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width) + static_cast<std::size_t>(x)];
  };
  const auto is_edge = [&](float a, float b) {
    return a > 0 && b > 0 && std::abs(a - b) > kJump + kSlope * std::min(a, b);
  };
  const int thick = std::max(camera.width / 640, 1);
  for (int y = 0; y + 1 < camera.height; ++y)
    for (int x = 0; x + 1 < camera.width; ++x)
      if (is_edge(depth_at(x, y), depth_at(x + 1, y)) || is_edge(depth_at(x, y), depth_at(x, y + 1)))
        cv::circle(rgb, {x, y}, thick, cv::Scalar(255, 0, 0), cv::FILLED);
  write_whole(file, encode_png(rgb));
}

}  // namespace cairn
