// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// ICL-NUIM (Handa et al. 2014) in the format of TUM's tools, with frame numbers in place of times. Its camera has fy <
// 0: with F = diag(1, -1, 1), its poses are F T F of an ordinary camera's poses T.
#include <fmt/format.h>

#include "cairn/mapping/trajectory.hpp"
#include "io/layouts.hpp"

namespace cairn {
namespace {

class IclNuimWriter final : public LayoutWriter {
 public:
  IclNuimWriter(const std::filesystem::path& folder, const Rig& rig) : files_(folder, rig) {}
  void add(const Frame& frame) override {
    files_.write_depth(fmt::format("depth/{}.png", count_), frame, 5000);
    files_.write_color(fmt::format("rgb/{}.png", count_), frame);
    pairs_ += fmt::format("{0} depth/{0}.png {0} rgb/{0}.png\n", count_);
    const Eigen::DiagonalMatrix<double, 3> flip(1, -1, 1);
    Eigen::Isometry3d pose = frame.world_from_camera.value();
    pose.linear() = flip * pose.linear() * flip;
    pose.translation() = flip * pose.translation();
    poses_.push_back({static_cast<double>(count_), pose});
    ++count_;
  }
  void finish() override {
    write_trajectory(files_.folder() / "groundtruth.txt", poses_);
    files_.write_text("associations.txt", pairs_);
  }

 private:
  ImageFolder files_;
  int count_ = 0;
  std::string pairs_;
  Trajectory poses_;
};

}  // namespace

std::unique_ptr<LayoutWriter> write_icl_nuim(const std::filesystem::path& folder, const Rig& rig) {
  return std::make_unique<IclNuimWriter>(folder, rig);
}

}  // namespace cairn
