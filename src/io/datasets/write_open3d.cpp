// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Output of Open3D's recorders (Zhou et al. 2018). Their format has no poses; groundtruth.txt is added for them.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "base/json_text.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "io/layouts.hpp"

namespace cairn {
namespace {

class Open3dWriter final : public LayoutWriter {
 public:
  Open3dWriter(const std::filesystem::path& folder, const Rig& rig) : files_(folder, rig) {}
  void add(const Frame& frame) override {
    files_.write_depth(fmt::format("depth/{:06}.png", poses_.size()), frame, 1000);
    files_.write_color(fmt::format("color/{:06}.jpg", poses_.size()), frame);
    poses_.push_back({frame.timestamp, frame.world_from_camera.value()});
  }
  void finish() override {
    const Camera& c = files_.camera();
    const nlohmann::json by_column{c.fx, 0, 0, 0, c.fy, 0, c.cx, c.cy, 1};
    write_trajectory(files_.folder() / "groundtruth.txt", poses_);
    files_.write_text("camera_intrinsic.json",
                      text_of({{"width", c.width}, {"height", c.height}, {"intrinsic_matrix", by_column}}, 2));
  }

 private:
  ImageFolder files_;
  Trajectory poses_;
};

}  // namespace

std::unique_ptr<LayoutWriter> write_open3d(const std::filesystem::path& folder, const Rig& rig) {
  return std::make_unique<Open3dWriter>(folder, rig);
}

}  // namespace cairn
