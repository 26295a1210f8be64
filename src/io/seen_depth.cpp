// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Analysis of some depth images when a recording is opened, for properties missing from its files.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>

#include "base/depth_image.hpp"
#include "base/read_whole.hpp"
#include "io/enlarged.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr std::size_t kSamples = 9;  // depth images sampled for size, unit and blocks
constexpr int kEvery = 7;            // minimum pixel stride
constexpr int kPixels = 50'000;      // approximate maximum of pixels per image
constexpr double kCentral = 0.2;     // share of the size; offset of a principal point from the middle of its image

std::uint16_t swapped(std::uint16_t value) { return static_cast<std::uint16_t>(value << 8 | value >> 8); }

/// Values of some depth images of a recording.
struct Sample {
  std::size_t tried = 0;
  std::map<std::pair<int, int>, int> sizes;  // number of images of each size
  bool is_float = false;
  std::vector<double> values;             // valid measurements in the images' unit, sorted
  std::vector<int> steps, swapped_steps;  // between neighboring 16-bit pixels, as stored and with swapped bytes
  DepthChanges changes;
  std::string first_problem;
  [[nodiscard]] Eigen::Vector2i usual_size() const {
    const auto most =
        std::max_element(sizes.begin(), sizes.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
    return {most->first.first, most->first.second};
  }
};

/// Pixel stride; odd, unlike image sizes.
int every_pixel(const cv::Mat& image) { return std::max(kEvery, static_cast<int>(image.total()) / kPixels | 1); }

void take_steps(const cv::Mat& image, Sample& seen) {
  const auto* values = image.ptr<std::uint16_t>();
  const int every = every_pixel(image);
  for (int i = every; i < static_cast<int>(image.total()); i += every) {
    const std::uint16_t a = values[i - 1], b = values[i];
    if (a == b || a == 0 || b == 0 || a == 65535 || b == 65535) continue;
    seen.steps.push_back(std::abs(a - b));
    seen.swapped_steps.push_back(std::abs(swapped(a) - swapped(b)));
  }
}

void look_into(cv::Mat image, int invalid, Sample& seen) {
  if (image.type() != CV_16UC1 && image.type() != CV_32FC1)
    throw std::runtime_error("is a picture of 8 bits; depth must be a 16-bit image with one channel");
  ++seen.sizes[{image.cols, image.rows}];
  seen.is_float = image.type() == CV_32FC1;
  seen.changes.add(image, invalid);
  if (!seen.is_float) take_steps(image, seen);
  image.convertTo(image, CV_32F);
  for (int i = 0; i < static_cast<int>(image.total()); i += every_pixel(image))
    if (const float v = image.ptr<float>()[i]; std::isfinite(v) && v > 0 && v != 65535)
      seen.values.push_back(static_cast<double>(v));
}

Sample sample(const std::vector<Recording::Entry>& entries, int invalid) {
  Sample seen;
  seen.tried = std::min(entries.size(), kSamples);
  for (std::size_t k = 0; k < seen.tried; ++k) {
    const fs::path& file = entries[seen.tried < 2 ? 0 : (entries.size() - 1) * k / (seen.tried - 1)].depth;
    try {
      look_into(decode_depth(read_whole(file)), invalid, seen);
    } catch (const std::exception& error) {
      if (seen.first_problem.empty()) seen.first_problem = file.string() + ": " + error.what();
    }
  }
  return seen;
}

/// True if the two bytes of each value are swapped: depth is continuous between pixels, and a low byte in place of the
/// high byte makes most steps a multiple of 256.
bool has_swapped_bytes(Sample& seen) {
  constexpr std::size_t kFewSteps = 1000;
  constexpr int kLeastStep = 256, kTimes = 16;
  if (seen.steps.size() < kFewSteps) return false;
  const auto median = [](std::vector<int>& steps) {
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::nth_element(steps.begin(), middle, steps.end());
    return *middle;
  };
  const int as_stored = median(seen.steps), turned = median(seen.swapped_steps);
  // Stored multiples of 256 have all their information in one byte and become values below 256, too small for depth.
  const auto tells_twice = [](double v) { return swapped(static_cast<std::uint16_t>(v)) >= 256; };
  const auto high = std::count_if(seen.values.begin(), seen.values.end(), tells_twice);
  return as_stored >= kLeastStep && turned * kTimes <= as_stored &&
         2 * static_cast<std::size_t>(high) > seen.values.size();
}

struct Unit {
  double per_metre;
  const char* words;
};
constexpr Unit kMetres{1, "metres"}, kMillimetres{1000, "millimetres"}, kTum{5000, "units of 1/5000 m"},
    kTenth{10000, "units of 0.1 mm"};

/// Estimates the unit, so that the median is within the indoor range of a depth camera.
Unit guess_unit(const Sample& seen) {
  constexpr double kNearest = 0.15, kFarthest = 6.5;    // meters, of a median
  constexpr double kRoom = 4000, kMostInRoom = 10'000;  // millimeters: median, and a high value rare for depth cameras
  constexpr std::size_t kFewValues = 20;
  if (seen.values.empty()) return seen.is_float ? kMetres : kMillimetres;
  const double median = seen.values[seen.values.size() / 2];
  const auto fits = [&](const Unit& unit) {
    return median >= kNearest * unit.per_metre && median <= kFarthest * unit.per_metre;
  };
  if (seen.is_float) return fits(kMillimetres) ? kMillimetres : kMetres;
  // TUM's tools multiply millimeters by five. With few values, or with multiples of ten only, the factor is no
  // evidence.
  const auto all_are_multiples = [&](double of) {
    return std::all_of(seen.values.begin(), seen.values.end(), [&](double v) { return std::fmod(v, of) == 0; });
  };
  const std::set<double> different(seen.values.begin(), seen.values.end());
  if (fits(kTum) && different.size() >= kFewValues && all_are_multiples(5) && !all_are_multiples(10)) return kTum;
  // Read as millimeters, TUM's desks at 1.1 m would be as far as the walls of halls.
  if (fits(kTum) && median > kRoom && seen.values[seen.values.size() * 99 / 100] > kMostInRoom) return kTum;
  for (const Unit& unit : {kMillimetres, kTum, kTenth})
    if (fits(unit)) return unit;
  return kMillimetres;
}

/// Checks the cameras once their sizes are known.
void check_in(const Recording& recording) {
  try {
    check(recording.rig);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: {}", recording.entries[0].depth.parent_path().string(), error.what()));
  }
}

/// Sets a missing size to the image size with the principal point near its middle: depth's or color's.
void take_size(const Eigen::Vector2i& depth, Recording& recording) {
  Camera& camera = recording.rig.depth;
  const auto is_central = [&](const Eigen::Vector2i& size) {
    return std::abs(camera.cx / size.x() - 0.5) < kCentral && std::abs(camera.cy / size.y() - 0.5) < kCentral;
  };
  Eigen::Vector2i size = depth;
  auto color =
      recording.rig.colour
          ? std::optional<Eigen::Vector2i>({recording.rig.colour->camera.width, recording.rig.colour->camera.height})
          : usual_color_size(recording.entries);
  if (!is_central(depth) && color && is_central(*color)) {
    size = *color;
    recording.understood.push_back(
        {"size of the camera", fmt::format("{}x{}, of color by the principal point", size.x(), size.y())});
  }
  camera.width = size.x(), camera.height = size.y();
  check_in(recording);
  if (recording.rig.colour) recording.rig.colour->camera = scaled_to(camera, *color);
}

void scale_camera(const Sample& seen, Recording& recording) {
  const Eigen::Vector2i size = seen.usual_size();
  Camera& camera = recording.rig.depth;
  if (!recording.size_is_told) take_size(size, recording);
  if (seen.sizes.count({camera.width, camera.height}) > 0) return;
  const double stretch = static_cast<double>(size.x()) * camera.height / (static_cast<double>(size.y()) * camera.width);
  if (!(std::abs(stretch - 1) <= kMostStretch))
    throw std::runtime_error(fmt::format("{}: is {}x{}, the camera {}x{}: tell the camera of the depth images",
                                         recording.entries[0].depth.string(), size.x(), size.y(), camera.width,
                                         camera.height));
  recording.understood.push_back({"scaled", fmt::format("the camera of {}x{} pixels to the depth images' {}x{}",
                                                        camera.width, camera.height, size.x(), size.y())});
  camera = scaled_to(camera, size);
  check_in(recording);
}

void find_unit(const Sample& seen, Recording& recording) {
  if (recording.unit_is_told) {
    recording.understood.push_back({"unit of depth", fmt::format("{:g} a metre", recording.depth_scale)});
    return;
  }
  const Unit unit = guess_unit(seen);
  recording.depth_scale = unit.per_metre;
  const double median = seen.values.empty() ? 0 : seen.values[seen.values.size() / 2] / unit.per_metre;
  recording.understood.push_back({"unit of depth", fmt::format("{} assumed: median {:.1f} m", unit.words, median)});
  recording.notes.push_back(
      fmt::format("depth in {} assumed: median {:.1f} m; say depth_scale (units per metre) in camera.yaml if not",
                  unit.words, median));
}

/// Keeps one pixel of each block of enlarged depth, with a camera scaled to match.
void take_blocks(const Sample& seen, Recording& recording) {
  Camera& camera = recording.rig.depth;
  auto [columns, rows] = seen.changes.blocks();
  const Eigen::Vector2i stored(camera.width, camera.height),
      size(static_cast<int>(columns.size()), static_cast<int>(rows.size()));
  if (columns.empty() || seen.usual_size() != stored) return;
  const Rig before = recording.rig;
  camera = scaled_to(camera, size);
  if (!recording.rig.colour) {  // keep the color size
    const auto color = usual_color_size(recording.entries);
    if (color) recording.rig.colour = ColourCamera{.camera = scaled_to(before.depth, *color)};
  }
  try {
    check(recording.rig);
  } catch (const std::runtime_error&) {  // too small for a camera
    recording.rig = before;
    return;
  }
  const auto middles = [](std::vector<int> first, int end) {
    for (std::size_t i = 0; i < first.size(); ++i)
      first[i] = (first[i] + (i + 1 < first.size() ? first[i + 1] : end)) / 2;
    return first;
  };
  recording.blocks = {stored, middles(std::move(columns), stored.x()), middles(std::move(rows), stored.y())};
  const std::string words = fmt::format("enlarged from {}x{} to {}x{} by nearest neighbor: used at {}x{}", size.x(),
                                        size.y(), stored.x(), stored.y(), size.x(), size.y());
  recording.understood.push_back({"depth", words});
  recording.notes.push_back("depth was " + words);
}

}  // namespace

void see_images(Recording& recording) {
  Sample seen = sample(recording.entries, recording.invalid_depth);
  if (seen.sizes.empty()) {
    if (recording.size_is_told && recording.unit_is_told) return;  // each frame reports its own problem
    throw std::runtime_error(
        fmt::format("{}; {} of {} depth images were tried", seen.first_problem, seen.tried, recording.entries.size()));
  }
  if (has_swapped_bytes(seen)) {
    recording.bytes_are_swapped = true;
    for (double& value : seen.values) value = swapped(static_cast<std::uint16_t>(value));
    recording.notes.push_back("the bytes of depth are in the other order than its files say: they are swapped");
  }
  std::sort(seen.values.begin(), seen.values.end());
  if (recording.camera_is_missing) {
    recording.rig.depth = scaled_to(Camera{}, seen.usual_size());  // for the error message
    return;
  }
  scale_camera(seen, recording);
  find_unit(seen, recording);
  take_blocks(seen, recording);
}

}  // namespace cairn
