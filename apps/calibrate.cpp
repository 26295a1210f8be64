// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include "cairn/map.hpp"
#include "cairn/rig.hpp"
#include "commands.hpp"

namespace cairn::apps {
namespace {

struct Arguments {
  std::filesystem::path map, output;
  int device = -1;
};

void calibrate(const Arguments& a) {
  const auto rig = Map::open(a.map, a.device).find_colour_camera();
  if (!rig) {
    fmt::print("colour lies on depth as well as the keyframes can tell; nothing was written\n");
    return;
  }
  write_rig(a.output, *rig);
  const Eigen::Isometry3d& pose = rig->colour->colour_from_depth;
  const Eigen::Vector3d t = 100 * pose.translation();
  fmt::print(
      "colour camera  fx {:.1f} fy {:.1f} pixels, {:.1f} {:.1f} {:.1f} cm beside depth, turned by {:.2f} degrees\n",
      rig->colour->camera.fx, rig->colour->camera.fy, t.x(), t.y(), t.z(),
      Eigen::AngleAxisd(pose.linear()).angle() * 57.29578);
  fmt::print("{}: give it to reconstruct with --camera\n", a.output.string());
}

}  // namespace

void add_calibrate(CLI::App& program) {
  auto* command = program.add_subcommand("calibrate", "Find the colour camera from a map's keyframes");
  const auto a = std::make_shared<Arguments>();
  command->add_option("MAP", a->map, "Folder of a map")->required()->check(CLI::ExistingDirectory);
  command->add_option("-o,--output", a->output, "camera.yaml to write")->required();
  command->add_option("--device", a->device, "Vulkan device; -1 chooses")->capture_default_str();
  command->callback([a] { calibrate(*a); });
}

}  // namespace cairn::apps
