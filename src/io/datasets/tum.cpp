// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// TUM RGB-D benchmark (Sturm et al. 2012): rgb.txt and depth.txt list images with times.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <fstream>
#include <stdexcept>
#include <utility>

#include "base/lines.hpp"
#include "cairn/io/known_cameras.hpp"
#include "io/datasets/image_names.hpp"
#include "io/datasets/stamped_list.hpp"
#include "io/intrinsics.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr double kMaxTimeDifference = 0.02;  // seconds between a depth image and its color image

struct Benchmark {
  std::string_view full, short_name;  // in the names of its folders
  std::string_view camera;
};
constexpr Benchmark kBenchmarks[] = {{"freiburg1", "fr1", "freiburg1"},
                                     {"freiburg2", "fr2", "freiburg2"},
                                     {"freiburg3", "fr3", "freiburg3"},
                                     {"rgbd_bonn", "", "bonn"}};
constexpr double kTumBegin = 1.30e9, kTumEnd = 1.35e9;  // seconds since 1970: 2011 and 2012

/// True if a name contains the word without adjacent letters or digits.
bool has_word(const std::string& name, std::string_view word) {
  const auto is_alphanumeric = [&](std::size_t at) {
    return at < name.size() && std::isalnum(static_cast<unsigned char>(name[at])) != 0;
  };
  for (std::size_t at = 0; !word.empty() && (at = name.find(word, at)) != name.npos; ++at)
    if (!(at > 0 && is_alphanumeric(at - 1)) && !is_alphanumeric(at + word.size())) return true;
  return false;
}

/// Reads the comment at the top of depth.txt: `# file: 'rgbd_dataset_freiburg1_xyz.bag'`.
std::string header_of(const fs::path& list) {
  std::ifstream in(list);
  std::string header, line;
  for (int i = 0; i < 3 && std::getline(in, line) && line.starts_with('#'); ++i) header += line.substr(0, 200);
  return header;
}

/// Returns the published calibration of a benchmark. Evidence is the benchmark's name at the top of its list, or a
/// folder name together with images of the benchmark's size and, for short names, times in the benchmark's years.
const KnownCamera* recognized_camera(const fs::path& folder, const std::vector<Stamped>& depth) {
  const std::string header = header_of(folder / "depth.txt");
  for (const Benchmark& b : kBenchmarks)
    if (header.find(b.full) != header.npos) return known_camera(b.camera);
  const std::string name = fs::weakly_canonical(folder).filename().string();
  const double first = depth.front().timestamp;
  const bool is_in_tum_years = first >= kTumBegin && first <= kTumEnd;
  for (const Benchmark& b : kBenchmarks) {
    if (name.find(b.full) == name.npos && !(is_in_tum_years && has_word(name, b.short_name))) continue;
    const KnownCamera* known = known_camera(b.camera);
    for (const Stamped& stamped : depth)
      if (const auto size = size_of_image(stamped.image))
        return *size == Eigen::Vector2i(known->camera.width, known->camera.height) ? known : nullptr;
  }
  return nullptr;
}

/// Sets the camera size from the first readable image.
void set_size(const fs::path& file, const std::vector<Stamped>& depth, Camera& camera) {
  std::optional<Eigen::Vector2i> size;
  for (std::size_t i = 0; i < depth.size() && !size; ++i) size = size_of_image(depth[i].image);
  if (!size)
    throw std::runtime_error(file.string() + ": no image of depth.txt is readable, so the image size is unknown");
  camera.width = size->x();
  camera.height = size->y();
  try {
    check(camera);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
}

/// Returns the color image of each depth image, or -1.
std::vector<int> pair_by_time(const std::vector<Stamped>& depth, const std::vector<Stamped>& color,
                              const fs::path& file) {
  const auto times_of = [](const std::vector<Stamped>& list) {
    std::vector<double> times;
    times.reserve(list.size());
    for (const Stamped& stamped : list) times.push_back(stamped.timestamp);
    return times;
  };
  try {
    return associate(times_of(depth), times_of(color), kMaxTimeDifference);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
}

/// Reads `fx fy cx cy` of ETH3D's SLAM benchmark (Schöps et al. 2019), with undistorted images; the size comes from the
/// first readable image.
Camera read_calibration(const fs::path& file, const std::vector<Stamped>& depth) {
  Camera camera;
  int lines = 0;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    if (++lines > 1 || words.size() != 4)
      throw std::runtime_error(file.string() + ":" + std::to_string(line) + ": expected one line `fx fy cx cy`");
    const auto number = [&](std::size_t i) { return number_of(words[i], file, line); };
    camera.fx = number(0), camera.fy = number(1), camera.cx = number(2), camera.cy = number(3);
  });
  if (lines == 0) throw std::runtime_error(file.string() + ": is empty; expected one line `fx fy cx cy`");
  set_size(file, depth, camera);
  return camera;
}

/// Sets ETH3D's calibration or a benchmark's known calibration; resolve_camera() handles other camera files.
void set_camera(const fs::path& folder, const std::vector<Stamped>& depth, Recording& recording) {
  const auto file = intrinsics_file(folder);
  if (file && file->filename() == "calibration.txt") {
    recording.layout = "ETH3D folder", recording.rig = read_calibration(*file, depth);
    recording.camera_file = *file;
  } else if (const KnownCamera* known = recognized_camera(folder, depth)) {
    recording.rig = known->camera;
    recording.interpretations.push_back({"camera of", fmt::format("{}, by its name and images", known->of)});
  } else {
    recording.camera_is_missing = true;
  }
}

}  // namespace

std::optional<Recording> read_tum(const fs::path& folder) {
  const bool has_depth = fs::exists(folder / "depth.txt"), has_color = fs::exists(folder / "rgb.txt");
  if (!has_depth && !has_color) return std::nullopt;
  if (!has_depth)
    throw std::runtime_error(folder.string() + ": has rgb.txt but no depth.txt; a TUM recording needs both");
  Recording recording;
  recording.layout = "TUM RGB-D folder";
  auto depth = read_stamped_lists(folder / "depth.txt", 1)[0];
  const double units = units_per_second(depth);
  divide_times(depth, units);
  set_camera(folder, depth, recording);
  std::vector<Stamped> color;
  if (has_color) color = read_stamped_lists(folder / "rgb.txt", 1)[0];
  divide_times(color, units);
  const auto match = pair_by_time(depth, color, folder / "rgb.txt");
  const auto paired = std::count_if(match.begin(), match.end(), [](int c) { return c >= 0; });
  if (has_color)
    recording.interpretations.push_back(
        {"pairing",
         fmt::format(
             "by the times in rgb.txt and depth.txt, within {:.0f} ms; {} depth and {} color images are unpaired",
             1000 * kMaxTimeDifference, static_cast<std::ptrdiff_t>(depth.size()) - paired,
             static_cast<std::ptrdiff_t>(color.size()) - paired)});
  for (std::size_t i = 0; i < depth.size(); ++i) {
    Recording::Entry entry{.timestamp = depth[i].timestamp, .depth = depth[i].image, .color = {}, .acceleration = {}};
    std::error_code ignored;  // for names invalid in the file system; the depth image reports the error
    if (const auto confidence = folder / "confidence" / depth[i].image.filename(); fs::exists(confidence, ignored))
      entry.confidence = confidence;
    if (match[i] >= 0) {
      const Stamped& image = color[static_cast<std::size_t>(match[i])];
      entry.color = image.image;
      entry.color_delay = image.timestamp - entry.timestamp;
    }
    recording.entries.push_back(std::move(entry));
  }
  add_motion(folder, recording, units);
  return recording;
}

}  // namespace cairn
