// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Replica, rendered for iMAP and NICE-SLAM (Sucar et al. 2021, Zhu et al. 2022): one room.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "base/json_text.hpp"
#include "io/layouts.hpp"

namespace cairn {
namespace {

constexpr double kUnits = 6553.5;  // per meter: 10 m is the largest 16-bit value

class ReplicaWriter final : public LayoutWriter {
 public:
  ReplicaWriter(const std::filesystem::path& folder, const Rig& rig) : files_(folder, rig) {}
  void add(const Frame& frame) override {
    files_.write_depth(fmt::format("results/depth{:06}.png", count_), frame, kUnits);
    files_.write_color(fmt::format("results/frame{:06}.jpg", count_), frame);
    poses_ += rows_of(frame.world_from_camera.value(), 4, " ") + "\n";
    ++count_;
  }
  void finish() override {
    files_.write_text("traj.txt", poses_);
    const Camera& c = files_.camera();
    const nlohmann::json camera{{"w", c.width}, {"h", c.height}, {"fx", c.fx},     {"fy", c.fy},
                                {"cx", c.cx},   {"cy", c.cy},    {"scale", kUnits}};
    files_.write_text("cam_params.json", text_of({{"camera", camera}}, 2));
  }

 private:
  ImageFolder files_;
  int count_ = 0;
  std::string poses_;
};

}  // namespace

std::unique_ptr<LayoutWriter> write_replica(const std::filesystem::path& folder, const Rig& rig) {
  return std::make_unique<ReplicaWriter>(folder, rig);
}

}  // namespace cairn
