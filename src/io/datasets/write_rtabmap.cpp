// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// RTAB-Map exports (Labbe & Michaud 2019): images named by time, the calibration in OpenCV's YAML, and poses of the
// robot's base, with x forward and z up.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "io/layouts.hpp"

namespace cairn {
namespace {

/// Rotation from the camera (x right, y down, z forward) to the base.
Eigen::Isometry3d base_from_camera() {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return pose;
}

std::string matrix(const char* name, int rows, int columns, const std::string& numbers) {
  return fmt::format("{}:\n   rows: {}\n   cols: {}\n   data: [ {} ]\n", name, rows, columns, numbers);
}

std::string calibration(const Camera& c) {
  const bool fisheye = c.lens == Lens::fisheye;
  const std::ptrdiff_t terms = fisheye ? 4 : 8;
  return fmt::format("%YAML:1.0\n---\ncamera_name: calib\nimage_width: {}\nimage_height: {}\n", c.width, c.height) +
         matrix("camera_matrix", 3, 3, fmt::format("{}, 0., {}, 0., {}, {}, 0., 0., 1.", c.fx, c.cx, c.fy, c.cy)) +
         matrix("distortion_coefficients", 1, static_cast<int>(terms),
                fmt::format("{}", fmt::join(c.distortion.begin(), c.distortion.begin() + terms, ", "))) +
         fmt::format("distortion_model: {}\n", fisheye ? "fisheye" : "rational_polynomial") +
         matrix("rectification_matrix", 3, 3, "1., 0., 0., 0., 1., 0., 0., 0., 1.") +
         matrix("projection_matrix", 3, 4,
                fmt::format("{}, 0., {}, 0., 0., {}, {}, 0., 0., 0., 1., 0.", c.fx, c.cx, c.fy, c.cy)) +
         matrix("local_transform", 3, 4, rows_of(base_from_camera(), 3, ", "));
}

class RtabmapWriter final : public LayoutWriter {
 public:
  RtabmapWriter(const std::filesystem::path& folder, const Rig& rig) : files_(folder, rig) {}
  void add(const Frame& frame) override {
    const std::string time = fmt::format("{:.6f}", frame.timestamp);
    files_.write_depth("depth/" + time + ".png", frame, 1000);
    files_.write_color("rgb/" + time + ".jpg", frame);
    const Eigen::Isometry3d pose = frame.world_from_camera.value() * base_from_camera().inverse();
    const Eigen::Quaterniond q(pose.linear());
    const Eigen::Vector3d t = pose.translation();
    poses_ += fmt::format("{} {} {} {} {} {} {} {} {}\n", time, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w(), ++id_);
  }
  void finish() override {
    files_.write_text("poses.txt", "#timestamp x y z qx qy qz qw id\n" + poses_);
    files_.write_text("calib.yaml", calibration(files_.camera()));
  }

 private:
  ImageFolder files_;
  int id_ = 0;
  std::string poses_;
};

}  // namespace

std::unique_ptr<LayoutWriter> write_rtabmap(const std::filesystem::path& folder, const Rig& rig) {
  return std::make_unique<RtabmapWriter>(folder, rig);
}

}  // namespace cairn
