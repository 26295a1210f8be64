// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// ICL-NUIM (Handa et al. 2014): associations.txt with image numbers as times. Its camera has fy = -480; turning poses
// by F T F with F = diag(1, -1, 1) makes it an ordinary camera.
#include <algorithm>
#include <set>
#include <stdexcept>

#include "base/lines.hpp"
#include "io/recording.hpp"

namespace cairn {

std::optional<Recording> read_icl_nuim(const std::filesystem::path& folder) {
  namespace fs = std::filesystem;
  const fs::path list = folder / "associations.txt";
  if (!fs::exists(list) || fs::exists(folder / "depth.txt")) return std::nullopt;
  Recording recording;
  recording.layout = "ICL-NUIM folder";
  recording.rig.depth = {640, 480, 481.2, 480.0, 319.5, 239.5, {}};
  std::set<int> numbers;
  for_each_line(list, [&](int line, const std::vector<std::string>& words) {
    if (words.size() != 4)
      throw std::runtime_error(list.string() + ":" + std::to_string(line) + ": expected `number depth number colour`");
    const double time = number_of(words[0], list, line);
    const bool depth_first = words[1].starts_with("depth");
    // A shortened copy of the set may keep the whole list.
    const fs::path depth = folder / words[depth_first ? 1 : 3];
    std::error_code ignored;  // a name that no file can have
    if (fs::exists(depth, ignored)) recording.entries.push_back({time, depth, folder / words[depth_first ? 3 : 1]});
  });
  if (recording.entries.empty()) throw std::runtime_error(list.string() + ": lists no image that exists");
  std::stable_sort(recording.entries.begin(), recording.entries.end(),
                   [](const auto& a, const auto& b) { return a.timestamp < b.timestamp; });
  if (fs::exists(folder / "groundtruth.txt")) {
    recording.truth = read_trajectory(folder / "groundtruth.txt");
    const Eigen::DiagonalMatrix<double, 3> flip(1.0, -1.0, 1.0);
    for (auto& pose : recording.truth) {
      pose.world_from_camera.linear() = flip * pose.world_from_camera.linear() * flip;
      pose.world_from_camera.translation() = flip * pose.world_from_camera.translation();
    }
  }
  return recording;
}

}  // namespace cairn
