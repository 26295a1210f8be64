// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Folders with a list of image pairs, written by TUM's associate.py for ORB-SLAM and similar programs. Includes
// ICL-NUIM (Handa et al. 2014), where image numbers serve as times. The ICL-NUIM camera has fy = -480; transforming
// poses to F T F with F = diag(1, -1, 1) makes it an ordinary camera.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <stdexcept>

#include "base/words.hpp"
#include "cairn/io/known_cameras.hpp"
#include "io/datasets/image_names.hpp"
#include "io/datasets/stamped_list.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr double kIclRate = 1;  // Hz: image numbers are used as times

std::optional<fs::path> list_in(const fs::path& folder) {
  for (const char* name : {"associations.txt", "associate.txt", "association.txt", "associated.txt", "assoc.txt"})
    if (fs::exists(folder / name)) return folder / name;
  return std::nullopt;
}

bool is_depth(const Stamped& stamped, const fs::path& folder) {
  return lower(stamped.image.lexically_relative(folder).string()).find("depth") != std::string::npos;
}

/// ICL-NUIM evidence: each image's file name is its number and its time, and images have 640x480 pixels.
bool is_icl_nuim(const std::vector<Stamped>& depth, const std::vector<Stamped>& color, const Camera& camera) {
  for (const auto* list : {&depth, &color})
    for (const Stamped& stamped : *list) {
      const auto number = number_in<int>(stamped.image.stem().string());
      if (!number || *number != stamped.timestamp) return false;
    }
  for (const Stamped& stamped : depth)
    if (const auto size = size_of_image(stamped.image)) return *size == Eigen::Vector2i(camera.width, camera.height);
  return false;
}

void flip_truth(Trajectory& truth) {
  const Eigen::DiagonalMatrix<double, 3> flip(1.0, -1.0, 1.0);
  for (auto& pose : truth) {
    pose.world_from_camera.linear() = flip * pose.world_from_camera.linear() * flip;
    pose.world_from_camera.translation() = flip * pose.world_from_camera.translation();
  }
}

/// Drops listed pairs without a depth file: a shortened copy of a data set may keep the full list.
void keep_existing(const fs::path& list, std::vector<Stamped>& depth, std::vector<Stamped>& color) {
  std::vector<Stamped> kept_depth, kept_color;
  std::error_code ignored;  // for names invalid in the file system
  for (std::size_t i = 0; i < depth.size(); ++i)
    if (fs::exists(depth[i].image, ignored)) {
      kept_depth.push_back(std::move(depth[i]));
      kept_color.push_back(std::move(color[i]));
    }
  if (kept_depth.empty()) throw std::runtime_error(list.string() + ": lists no existing image");
  depth = std::move(kept_depth);
  color = std::move(kept_color);
}

}  // namespace

std::optional<Recording> read_associations(const fs::path& folder) {
  const auto list = list_in(folder);
  if (!list || fs::exists(folder / "depth.txt")) return std::nullopt;
  auto lists = read_stamped_lists(*list, 2);
  auto &color = lists[0], &depth = lists[1];
  if (!is_depth(depth[0], folder) && is_depth(color[0], folder)) std::swap(color, depth);
  keep_existing(*list, depth, color);
  Recording recording;
  double units = 1;
  const Camera icl = known_camera("icl-nuim")->camera;
  const bool is_icl = is_icl_nuim(depth, color, icl) && !has_other_camera(folder, icl);
  if (is_icl) {
    recording.layout = "ICL-NUIM folder";
    recording.rig = icl;
    recording.frame_rate = kIclRate;
    recording.interpretations.push_back({"camera of", "ICL-NUIM's, by the numbers and size of its images"});
  } else {
    recording.layout = fmt::format("folder with {}", list->filename().string());
    recording.camera_is_missing = true;
    recording.has_depth_scale = false;
    recording.invalid_depth = 65535;
    units = units_per_second(depth);
    divide_times(depth, units);
    divide_times(color, units);
  }
  for (std::size_t i = 0; i < depth.size(); ++i)
    recording.entries.push_back({.timestamp = depth[i].timestamp,
                                 .depth = depth[i].image,
                                 .color = color[i].image,
                                 .color_delay = color[i].timestamp - depth[i].timestamp});
  std::stable_sort(recording.entries.begin(), recording.entries.end(),
                   [](const auto& a, const auto& b) { return a.timestamp < b.timestamp; });
  add_motion(folder, recording, units);
  if (is_icl) flip_truth(recording.truth);
  return recording;
}

}  // namespace cairn
