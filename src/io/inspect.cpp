// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/io/inspect.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "base/atomic_file.hpp"
#include "base/image_file.hpp"
#include "geometry/color_view.hpp"
#include "io/inspect_inertial.hpp"

namespace cairn {
namespace {

constexpr std::size_t kPixelStride = 37;  // stride of sampled depth pixels; shares no factor with common widths
constexpr double kMinMedianDepth = 0.05, kMaxMedianDepth = 100;  // meters, plausible median of a depth camera
constexpr double kMaxColorDelay = 0.1;                           // seconds between a depth image and its color image
constexpr double kMinMeasuredRatio = 0.2;                        // share of pixels
constexpr float kEdgeOffset = 0.05f, kEdgeSlope = 0.05f;         // meters, and share of the depth, across a depth edge

/// Quantile of the values at `share`; reorders them.
template <class T>
T quantile(std::vector<T>& values, double share) {
  if (values.empty()) return T{};
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Statistics collected frame by frame.
struct Statistics {
  std::vector<double> steps, delays;  // seconds
  std::vector<float> depths;          // meters
  std::size_t pixels = 0;             // total number of pixels
  std::optional<double> first, last;  // seconds
};

void add_frame(const Frame& frame, Statistics& statistics, SourceSummary& summary) {
  if (statistics.last) statistics.steps.push_back(frame.timestamp - *statistics.last);
  if (!statistics.first) statistics.first = frame.timestamp;
  statistics.last = frame.timestamp;
  for (std::size_t i = 0; i < frame.depth.size(); i += kPixelStride, ++statistics.pixels)
    if (frame.depth[i] > 0) statistics.depths.push_back(frame.depth[i]);
  if (!frame.color.empty()) {
    ++summary.with_color;
    statistics.delays.push_back(frame.color_delay);
  }
  summary.with_pose += frame.world_from_camera.has_value();
  summary.with_acceleration += frame.acceleration.has_value() || !frame.accelerations.empty();
  summary.with_gyroscope += !frame.gyro.empty();
  summary.with_confidence += !frame.confidence.empty();
}

std::vector<std::string> find_doubts(const SourceSummary& s) {
  std::vector<std::string> doubts;
  const auto add = [&](std::string text) { doubts.push_back(std::move(text)); };
  const int readable = s.inspected - s.unreadable;
  if (s.unreadable > 0)
    add(fmt::format("{} of {} frames cannot be read: {}", s.unreadable, s.inspected, s.first_problem));
  if (readable == 0) return doubts;
  if (s.median > kMaxMedianDepth || (s.median > 0 && s.median < kMinMedianDepth))
    add(
        fmt::format("half of the depth is {} than {:.3g} m: the unit of depth is wrong, perhaps by a factor of 1000; "
                    "check depth_scale",
                    s.median > kMaxMedianDepth ? "farther" : "nearer", s.median));
  if (s.measured_share < kMinMeasuredRatio)
    add(fmt::format("only {:.0f} % of the depth pixels hold a measurement", 100 * s.measured_share));
  if (s.with_color == 0)
    add("there is no color: the map is gray, and plain walls are hard to track");
  else if (s.with_color < readable)
    add(fmt::format("{} of {} frames have no color image near their time", readable - s.with_color, readable));
  if (std::abs(s.color_delay) > kMaxColorDelay)
    add(fmt::format("color and depth differ by {:.2f} s in time: their clocks do not agree", s.color_delay));
  if (s.rate > 0 && s.rate < 5)
    add(fmt::format("only {:.1f} frames per second: tracking needs a slowly moving camera", s.rate));
  return doubts;
}

}  // namespace

SourceSummary inspect(Source& source, int frames) {
  SourceSummary summary;
  summary.layout = source.layout();
  summary.rig = source.rig();
  summary.frames = source.size();
  Statistics statistics;
  InertialRecord inertial;
  while (summary.inspected < frames) {
    const auto frame = source.next();
    if (!frame) break;
    ++summary.inspected;
    if (!frame->problem) {
      add_frame(*frame, statistics, summary);
      inertial.add(*frame);
    } else if (summary.unreadable++ == 0) {
      summary.first_problem = *frame->problem;
    }
  }
  if (statistics.first) summary.seconds = *statistics.last - *statistics.first;
  if (const double step = quantile(statistics.steps, 0.5); step > 0) summary.rate = 1 / step;
  if (statistics.pixels > 0)
    summary.measured_share = static_cast<double>(statistics.depths.size()) / static_cast<double>(statistics.pixels);
  summary.nearest = static_cast<double>(quantile(statistics.depths, 0.01));
  summary.median = static_cast<double>(quantile(statistics.depths, 0.5));
  summary.farthest = static_cast<double>(quantile(statistics.depths, 0.99));
  summary.color_delay = quantile(statistics.delays, 0.5);
  summary.inertial = summarize(inertial);
  summary.doubts = find_doubts(summary);
  for (std::string& doubt : find_doubts(inertial, summary.inertial)) summary.doubts.push_back(std::move(doubt));
  if (const auto early = source.ended_early()) summary.doubts.push_back(*early);
  return summary;
}

void write_edges_picture(const std::filesystem::path& file, const Rig& rig, const Frame& frame) {
  const Camera& camera = rig.color_view();
  const auto pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  if (frame.color.size() != pixels) throw std::runtime_error("the frame has no color image to draw depth edges on");
  const Frame registered = ColorView(rig)(frame);
  cv::Mat rgb;
  cv::cvtColor(cv::Mat(camera.height, camera.width, CV_8UC4, const_cast<std::uint32_t*>(frame.color.data())), rgb,
               cv::COLOR_RGBA2RGB);
  const auto depth_at = [&](int x, int y) {
    return registered
        .depth[static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width) + static_cast<std::size_t>(x)];
  };
  const auto is_edge = [&](float a, float b) {
    return a > 0 && b > 0 && std::abs(a - b) > kEdgeOffset + kEdgeSlope * std::min(a, b);
  };
  const int thick = std::max(camera.width / 640, 1);
  for (int y = 0; y + 1 < camera.height; ++y)
    for (int x = 0; x + 1 < camera.width; ++x)
      if (is_edge(depth_at(x, y), depth_at(x + 1, y)) || is_edge(depth_at(x, y), depth_at(x, y + 1)))
        cv::circle(rgb, {x, y}, thick, cv::Scalar(255, 0, 0), cv::FILLED);
  write_whole(file, encode_png(rgb));
}

}  // namespace cairn
