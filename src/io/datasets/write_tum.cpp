// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// TUM RGB-D (Sturm et al. 2012), and data sets in its layout: Bonn (Palazzolo et al. 2019), with the camera known from
// the folder name, and ETH3D's SLAM benchmark (Schoeps et al. 2019) with calibration.txt.
#include <fmt/format.h>

#include <stdexcept>

#include "base/atomic_file.hpp"
#include "cairn/io/recorder.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "io/layouts.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

class TumWriter final : public LayoutWriter {
 public:
  TumWriter(const fs::path& folder, const Rig& rig, TumKind kind)
      : folder_(folder), rig_(rig), kind_(kind), recorder_(folder, rig) {}
  void add(const Frame& frame) override {
    const EncodedFrame images = encode(frame, rig_, kind_ != TumKind::cairn);
    recorder_.add(images);
    if (!images.color.empty() && kind_ == TumKind::eth3d)
      pairs_ += fmt::format("{0:.6f} rgb/{0:.6f}.png {0:.6f} depth/{0:.6f}.png\n", frame.timestamp);
    poses_.push_back({frame.timestamp, frame.world_from_camera.value()});
  }
  void finish() override {
    write_trajectory(folder_ / "groundtruth.txt", poses_);
    if (kind_ == TumKind::cairn) return;
    fs::remove(folder_ / "camera.yaml");
    if (kind_ != TumKind::eth3d) return;
    const Camera& c = rig_.depth;
    write_whole(folder_ / "calibration.txt", fmt::format("{} {} {} {}\n", c.fx, c.fy, c.cx, c.cy));
    write_whole(folder_ / "associated.txt", pairs_);
  }

 private:
  fs::path folder_;
  Rig rig_;
  TumKind kind_;
  Recorder recorder_;
  Trajectory poses_;
  std::string pairs_;
};

}  // namespace

std::unique_ptr<LayoutWriter> write_tum(const fs::path& folder, const Rig& rig, TumKind kind) {
  if (kind == TumKind::bonn && folder.filename().string().find("rgbd_bonn") == std::string::npos)
    throw std::runtime_error(
        "the layout bonn does not store its camera: programs know it by the folder name, which must contain "
        "`rgbd_bonn`");
  return std::make_unique<TumWriter>(folder, rig, kind);
}

}  // namespace cairn
