// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// 7-Scenes (Shotton et al. 2013): frame-000000.{depth.png,color.png or jpg,pose.txt}, depth in millimetres.
#include <stdexcept>

#include "base/lines.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr double kFrameRate = 30.0;  // Hz; the set has no timestamps

Eigen::Isometry3d read_pose(const fs::path& file) {
  std::vector<double> v;
  for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    for (const auto& word : words) v.push_back(number_of(word, file, line));
  });
  if (v.size() != 16) throw std::runtime_error(file.string() + ": expected a 4x4 matrix");
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 4; ++c) pose.matrix()(r, c) = v[static_cast<std::size_t>(4 * r + c)];
  pose.linear() = Eigen::Quaterniond(pose.linear()).normalized().toRotationMatrix();
  if (!pose.matrix().allFinite()) throw std::runtime_error(file.string() + ": its numbers are too large for a pose");
  return pose;
}

}  // namespace

std::optional<Recording> read_seven_scenes(const fs::path& folder) {
  const auto name = [&](int i, const char* suffix) {
    char text[64];
    std::snprintf(text, sizeof(text), "frame-%06d.%s", i, suffix);
    return folder / text;
  };
  if (!fs::exists(name(0, "depth.png"))) return std::nullopt;
  Recording recording;
  recording.layout = "7-Scenes folder";
  recording.rig.depth = {640, 480, 585.0, 585.0, 320.0, 240.0, {}};
  recording.colour_is_told = false;
  recording.depth_scale = 1000.0;
  recording.invalid_depth = 65535;
  for (int i = 0; fs::exists(name(i, "depth.png")); ++i) {
    const double time = i / kFrameRate;
    fs::path colour = name(i, "color.png");
    if (!fs::exists(colour)) colour = name(i, "color.jpg");
    recording.entries.push_back({time, name(i, "depth.png"), fs::exists(colour) ? colour : fs::path()});
    if (fs::exists(name(i, "pose.txt"))) recording.truth.push_back({time, read_pose(name(i, "pose.txt"))});
  }
  return recording;
}

}  // namespace cairn
