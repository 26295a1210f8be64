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
#include "io/datasets/enlarged.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr std::size_t kSamples = 9;  // depth images sampled for size, unit and blocks
constexpr int kMinStride = 7;        // minimum pixel stride
constexpr int kMaxPixels = 50'000;   // approximate maximum of pixels per image
constexpr double kMaxPrincipalOffset =
    0.2;  // share of the size; offset of a principal point from the middle of its image

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
  [[nodiscard]] Eigen::Vector2i common_size() const {
    const auto largest =
        std::max_element(sizes.begin(), sizes.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
    return {largest->first.first, largest->first.second};
  }
};

/// Pixel stride; odd, unlike image sizes.
int pixel_stride(const cv::Mat& image) {
  return std::max(kMinStride, static_cast<int>(image.total()) / kMaxPixels | 1);
}

void add_steps(const cv::Mat& image, Sample& sample) {
  const auto* values = image.ptr<std::uint16_t>();
  const int stride = pixel_stride(image);
  for (int i = stride; i < static_cast<int>(image.total()); i += stride) {
    const std::uint16_t a = values[i - 1], b = values[i];
    if (a == b || a == 0 || b == 0 || a == 65535 || b == 65535) continue;
    sample.steps.push_back(std::abs(a - b));
    sample.swapped_steps.push_back(std::abs(swapped(a) - swapped(b)));
  }
}

void add_image(cv::Mat image, int invalid, Sample& sample) {
  if (image.type() != CV_16UC1 && image.type() != CV_32FC1)
    throw std::runtime_error("is an 8-bit image; depth must be a 16-bit image with one channel");
  ++sample.sizes[{image.cols, image.rows}];
  sample.is_float = image.type() == CV_32FC1;
  sample.changes.add(image, invalid);
  if (!sample.is_float) add_steps(image, sample);
  image.convertTo(image, CV_32F);
  for (int i = 0; i < static_cast<int>(image.total()); i += pixel_stride(image))
    if (const float v = image.ptr<float>()[i]; std::isfinite(v) && v > 0 && v != 65535)
      sample.values.push_back(static_cast<double>(v));
}

Sample sample_images(const std::vector<Recording::Entry>& entries, int invalid) {
  Sample sample;
  sample.tried = std::min(entries.size(), kSamples);
  for (std::size_t k = 0; k < sample.tried; ++k) {
    const fs::path& file = entries[sample.tried < 2 ? 0 : (entries.size() - 1) * k / (sample.tried - 1)].depth;
    try {
      add_image(decode_depth(read_whole(file)), invalid, sample);
    } catch (const std::exception& error) {
      if (sample.first_problem.empty()) sample.first_problem = file.string() + ": " + error.what();
    }
  }
  return sample;
}

/// True if the two bytes of each value are swapped: depth is continuous between pixels, and a low byte in place of the
/// high byte makes most steps a multiple of 256.
bool has_swapped_bytes(Sample& sample) {
  constexpr std::size_t kMinSteps = 1000;
  constexpr int kMinStep = 256, kMinRatio = 16;
  if (sample.steps.size() < kMinSteps) return false;
  const auto median = [](std::vector<int>& steps) {
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::nth_element(steps.begin(), middle, steps.end());
    return *middle;
  };
  const int as_stored = median(sample.steps), with_swap = median(sample.swapped_steps);
  // Stored multiples of 256 have all their information in one byte and become values below 256, too small for depth.
  const auto is_plausible = [](double v) { return swapped(static_cast<std::uint16_t>(v)) >= 256; };
  const auto plausible = std::count_if(sample.values.begin(), sample.values.end(), is_plausible);
  return as_stored >= kMinStep && with_swap * kMinRatio <= as_stored &&
         2 * static_cast<std::size_t>(plausible) > sample.values.size();
}

struct Unit {
  double per_meter;
  const char* words;
};
constexpr Unit kMeters{1, "meters"}, kMillimeters{1000, "millimeters"}, kTum{5000, "units of 1/5000 m"},
    kTenthMillimeters{10000, "units of 0.1 mm"};

/// Estimates the unit, so that the median is within the indoor range of a depth camera.
Unit guess_unit(const Sample& sample) {
  constexpr double kMinMedian = 0.15, kMaxMedian = 6.5;  // meters, of a median
  constexpr double kMaxRoomMedian = 4000,
                   kMaxRoomDepth = 10'000;  // millimeters: median, and a high value rare for depth cameras
  constexpr std::size_t kMinValues = 20;
  if (sample.values.empty()) return sample.is_float ? kMeters : kMillimeters;
  const double median = sample.values[sample.values.size() / 2];
  const auto fits = [&](const Unit& unit) {
    return median >= kMinMedian * unit.per_meter && median <= kMaxMedian * unit.per_meter;
  };
  if (sample.is_float) return fits(kMillimeters) ? kMillimeters : kMeters;
  // TUM's tools multiply millimeters by five. With few values, or with multiples of ten only, the factor is no
  // evidence.
  const auto all_are_multiples = [&](double of) {
    return std::all_of(sample.values.begin(), sample.values.end(), [&](double v) { return std::fmod(v, of) == 0; });
  };
  const std::set<double> different(sample.values.begin(), sample.values.end());
  if (fits(kTum) && different.size() >= kMinValues && all_are_multiples(5) && !all_are_multiples(10)) return kTum;
  // Read as millimeters, TUM's desks at 1.1 m would be as far as the walls of halls.
  if (fits(kTum) && median > kMaxRoomMedian && sample.values[sample.values.size() * 99 / 100] > kMaxRoomDepth)
    return kTum;
  for (const Unit& unit : {kMillimeters, kTum, kTenthMillimeters})
    if (fits(unit)) return unit;
  return kMillimeters;
}

/// Checks the cameras once their sizes are known.
void check_rig(const Recording& recording) {
  try {
    check(recording.rig);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: {}", recording.entries[0].depth.parent_path().string(), error.what()));
  }
}

/// Sets a missing size to the image size with the principal point near its middle: depth's or color's.
void set_size(const Eigen::Vector2i& depth, Recording& recording) {
  Camera& camera = recording.rig.depth;
  const auto is_central = [&](const Eigen::Vector2i& size) {
    return std::abs(camera.cx / size.x() - 0.5) < kMaxPrincipalOffset &&
           std::abs(camera.cy / size.y() - 0.5) < kMaxPrincipalOffset;
  };
  Eigen::Vector2i size = depth;
  auto color =
      recording.rig.color
          ? std::optional<Eigen::Vector2i>({recording.rig.color->camera.width, recording.rig.color->camera.height})
          : common_color_size(recording.entries);
  if (!is_central(depth) && color && is_central(*color)) {
    size = *color;
    recording.interpretations.push_back(
        {"size of the camera", fmt::format("{}x{}, of color, by the principal point", size.x(), size.y())});
  }
  camera.width = size.x(), camera.height = size.y();
  check_rig(recording);
  if (recording.rig.color) recording.rig.color->camera = scaled_to(camera, *color);
}

void scale_camera(const Sample& sample, Recording& recording) {
  const Eigen::Vector2i size = sample.common_size();
  Camera& camera = recording.rig.depth;
  if (!recording.has_image_size) set_size(size, recording);
  if (sample.sizes.count({camera.width, camera.height}) > 0) return;
  const double stretch = static_cast<double>(size.x()) * camera.height / (static_cast<double>(size.y()) * camera.width);
  if (!(std::abs(stretch - 1) <= kMaxAspectError))
    throw std::runtime_error(fmt::format("{}: is {}x{}, the camera {}x{}: give the camera of the depth images",
                                         recording.entries[0].depth.string(), size.x(), size.y(), camera.width,
                                         camera.height));
  recording.interpretations.push_back({"scaled", fmt::format("the camera of {}x{} pixels to the depth images' {}x{}",
                                                             camera.width, camera.height, size.x(), size.y())});
  camera = scaled_to(camera, size);
  check_rig(recording);
}

void set_unit(const Sample& sample, Recording& recording) {
  if (recording.has_depth_scale) {
    recording.interpretations.push_back({"unit of depth", fmt::format("{:g} per meter", recording.depth_scale)});
    return;
  }
  const Unit unit = guess_unit(sample);
  recording.depth_scale = unit.per_meter;
  const double median = sample.values.empty() ? 0 : sample.values[sample.values.size() / 2] / unit.per_meter;
  recording.interpretations.push_back(
      {"unit of depth", fmt::format("{} assumed: median {:.1f} m", unit.words, median)});
  recording.notes.push_back(
      fmt::format("depth in {} assumed: median {:.1f} m; set depth_scale (units per meter) in camera.yaml if not",
                  unit.words, median));
}

/// Keeps one pixel of each block of enlarged depth, with a camera scaled to match.
void set_blocks(const Sample& sample, Recording& recording) {
  Camera& camera = recording.rig.depth;
  auto [columns, rows] = sample.changes.blocks();
  const Eigen::Vector2i stored(camera.width, camera.height),
      size(static_cast<int>(columns.size()), static_cast<int>(rows.size()));
  if (columns.empty() || sample.common_size() != stored) return;
  const Rig previous = recording.rig;
  camera = scaled_to(camera, size);
  if (!recording.rig.color) {  // keep the color size
    const auto color = common_color_size(recording.entries);
    if (color) recording.rig.color = ColorCamera{.camera = scaled_to(previous.depth, *color)};
  }
  try {
    check(recording.rig);
  } catch (const std::runtime_error&) {  // too small for a camera
    recording.rig = previous;
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
  recording.interpretations.push_back({"depth", words});
  recording.notes.push_back("depth was " + words);
}

}  // namespace

void infer_depth_format(Recording& recording) {
  Sample sample = sample_images(recording.entries, recording.invalid_depth);
  if (sample.sizes.empty()) {
    if (recording.has_image_size && recording.has_depth_scale) return;  // each frame reports its own problem
    throw std::runtime_error(fmt::format("{}; {} of {} depth images were tried", sample.first_problem, sample.tried,
                                         recording.entries.size()));
  }
  if (has_swapped_bytes(sample)) {
    recording.bytes_are_swapped = true;
    for (double& value : sample.values) value = swapped(static_cast<std::uint16_t>(value));
    recording.notes.push_back("depth has the opposite byte order from the one its files state: bytes are swapped");
  }
  std::sort(sample.values.begin(), sample.values.end());
  if (recording.camera_is_missing) {
    recording.rig.depth = scaled_to(Camera{}, sample.common_size());  // for the error message
    return;
  }
  scale_camera(sample, recording);
  set_unit(sample, recording);
  set_blocks(sample, recording);
}

}  // namespace cairn
