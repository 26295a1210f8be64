// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/frame_samples.hpp"

#include <algorithm>
#include <cmath>
#include <istream>
#include <limits>
#include <ostream>
#include <string>
#include <utility>

namespace cairn {
namespace {

constexpr int kMaxWidth = 64;  // maximum width of the grid in pixels
constexpr std::size_t kOutside = std::numeric_limits<std::size_t>::max();
constexpr float kMaxDepthStep = 0.04f;  // relative depth difference of neighbors; excludes mixed pixels and silhouettes

std::size_t pixels_of(const Camera& c) {
  return static_cast<std::size_t>(c.width) * static_cast<std::size_t>(c.height);
}

/// Camera with every `step`-th pixel of the undistorted image.
Camera grid_of(const Camera& image) {
  const int step = (image.width + kMaxWidth - 1) / kMaxWidth, first = step / 2;
  Camera grid = image.rectified();
  grid.width = image.width / step, grid.height = image.height / step;
  grid.fx = image.fx / step, grid.fy = image.fy / step;
  grid.cx = (image.cx - first) / step, grid.cy = (image.cy - first) / step;
  return grid;
}

/// Depth of a pixel if its four neighbors are on the same surface, else 0.
float flat_depth(const std::vector<float>& depth, std::size_t pixel, std::size_t width) {
  const float z = depth[pixel];
  if (!(z > 0)) return 0;
  for (const std::size_t neighbor : {pixel - 1, pixel + 1, pixel - width, pixel + width})
    if (!(std::abs(depth[neighbor] - z) <= kMaxDepthStep * z)) return 0;
  return z;
}

std::uint8_t brightness_of(std::uint32_t rgba) {
  return static_cast<std::uint8_t>(((rgba & 255) + 2 * (rgba >> 8 & 255) + (rgba >> 16 & 255)) / 4);
}

constexpr char kDigits[] = "0123456789abcdef";

template <class Number>
std::string in_hex(const std::vector<Number>& numbers) {
  std::string text = "x";  // keeps an empty list readable as a word
  for (const Number n : numbers)
    for (int shift = 8 * static_cast<int>(sizeof(Number)) - 4; shift >= 0; shift -= 4) text += kDigits[n >> shift & 15];
  return text;
}

template <class Number>
bool from_hex(const std::string& text, std::vector<Number>& numbers) {
  constexpr std::size_t kDigitsPerNumber = 2 * sizeof(Number);
  if (text.empty() || text[0] != 'x' || (text.size() - 1) % kDigitsPerNumber != 0) return false;
  numbers.assign((text.size() - 1) / kDigitsPerNumber, 0);
  for (std::size_t i = 1; i < text.size(); ++i) {
    const auto digit = std::string_view(kDigits).find(text[i]);
    if (digit == std::string_view::npos) return false;
    Number& n = numbers[(i - 1) / kDigitsPerNumber];
    n = static_cast<Number>(n << 4 | digit);
  }
  return true;
}

}  // namespace

FrameSamples::FrameSamples(const Rig& rig) : rig_(rig), camera_(grid_of(rig.depth)) {
  const Camera& image = rig_.depth;
  for (int y = 0; y < camera_.height; ++y)
    for (int x = 0; x < camera_.width; ++x) {
      const Eigen::Vector2d distorted = image.distort(camera_.ray(x, y).head<2>());
      const double u = std::round(image.fx * distorted.x() + image.cx),
                   v = std::round(image.fy * distorted.y() + image.cy);
      const bool inside = u >= 1 && v >= 1 && u <= image.width - 2 && v <= image.height - 2;
      pixels_.push_back(inside ? static_cast<std::size_t>(v) * static_cast<std::size_t>(image.width) +
                                     static_cast<std::size_t>(u)
                               : kOutside);
    }
}

FrameSample FrameSamples::sample_of(const Frame& frame, double min_depth, double max_depth) const {
  FrameSample sample{.timestamp = frame.timestamp,
                     .held_out = frame.held_out,
                     .depth = std::vector<std::uint16_t>(pixels_.size(), 0),
                     .brightness = {}};
  const bool has_color = !rig_.color && frame.color.size() == frame.depth.size();
  const bool has_confidence = frame.confidence.size() == frame.depth.size();
  if (has_color) sample.brightness.assign(pixels_.size(), 0);
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    const std::size_t p = pixels_[i];
    if (p == kOutside) continue;
    if (has_color) sample.brightness[i] = brightness_of(frame.color[p]);
    if (has_confidence && frame.confidence[p] < rig_.sensor.min_confidence) continue;
    const auto z = static_cast<double>(flat_depth(frame.depth, p, static_cast<std::size_t>(rig_.depth.width)));
    const double units = std::round(z / FrameSample::kDepthUnit);
    if (z >= min_depth && z <= max_depth && units <= 65535) sample.depth[i] = static_cast<std::uint16_t>(units);
  }
  return sample;
}

void FrameSamples::add(const Frame& frame, int recording, double min_depth, double max_depth) {
  if (frame.depth.size() != pixels_of(rig_.depth)) return;
  Thinned& of = frame.held_out ? held_out_ : fused_;
  if (of.seen++ % of.every != 0) return;
  of.kept.push_back(sample_of(frame, min_depth, max_depth));
  of.kept.back().recording = recording;
  if (of.kept.size() < (frame.held_out ? kMaxHeldOut : kMaxFused)) return;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < of.kept.size(); i += 2)
    if (const std::size_t at = kept++; at != i) of.kept[at] = std::move(of.kept[i]);
  of.kept.resize(kept);
  of.every *= 2;
}

std::vector<const FrameSample*> FrameSamples::all() const {
  std::vector<const FrameSample*> all;
  for (const Thinned* of : {&fused_, &held_out_})
    for (const FrameSample& sample : of->kept) all.push_back(&sample);
  return all;
}

void FrameSamples::save(std::ostream& out) const {
  for (const Thinned* of : {&fused_, &held_out_}) {
    out << of->seen << ' ' << of->every << ' ' << of->kept.size() << ' ';
    for (const FrameSample& s : of->kept)
      out << s.timestamp << ' ' << s.recording << ' ' << in_hex(s.depth) << ' ' << in_hex(s.brightness) << ' ';
  }
}

void FrameSamples::restore(std::istream& in) {
  Thinned read[2];
  for (Thinned& of : read) {
    std::size_t count = 0;
    if (!(in >> of.seen >> of.every >> count) || of.every == 0 || count > kMaxFused) return;
    for (std::size_t i = 0; i < count; ++i) {
      FrameSample s{.held_out = &of == &read[1], .depth = {}, .brightness = {}};
      std::string depth, brightness;
      if (!(in >> s.timestamp >> s.recording >> depth >> brightness) || !from_hex(depth, s.depth) ||
          !from_hex(brightness, s.brightness) || s.depth.size() != pixels_.size() ||
          (!s.brightness.empty() && s.brightness.size() != pixels_.size()))
        return;
      of.kept.push_back(std::move(s));
    }
  }
  fused_ = std::move(read[0]), held_out_ = std::move(read[1]);
}

}  // namespace cairn
