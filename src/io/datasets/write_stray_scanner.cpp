// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Stray Scanner's folder (iPhones and iPads with LiDAR). Its poses use the same camera axes as Cairn.
#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <iterator>
#include <opencv2/core.hpp>
#include <stdexcept>

#include "base/atomic_file.hpp"
#include "base/image_file.hpp"
#include "io/datasets/stray_scanner.hpp"
#include "io/layouts.hpp"
#include "io/video/video_writer.hpp"

namespace cairn {
namespace {

constexpr int kRate = 30;          // Hz, of the video; image times are in odometry.csv
constexpr std::uint8_t kSure = 2;  // highest confidence level of a phone
constexpr const char* kHeader = "timestamp, frame, x, y, z, qx, qy, qz, qw\n";
constexpr const char* kMotionHeader = "timestamp, a_x, a_y, a_z, alpha_x, alpha_y, alpha_z\n";

class StrayScannerWriter final : public LayoutWriter {
 public:
  StrayScannerWriter(const std::filesystem::path& folder, const Rig& rig)
      : files_(folder, rig), video_(folder / "rgb.mp4", rig.depth.width, rig.depth.height, kRate) {
    std::filesystem::create_directories(folder / "confidence");
  }
  void add(const Frame& frame) override {
    const Camera& c = files_.camera();
    if (frame.color.size() != frame.depth.size())
      throw std::runtime_error(
          fmt::format("frame {} has no color, which the video of the layout stray-scanner needs", frame.index));
    files_.write_depth(fmt::format("depth/{:06}.png", count_), frame, 1000);
    std::vector<std::uint8_t> sure;
    std::transform(frame.depth.begin(), frame.depth.end(), std::back_inserter(sure),
                   [](float z) { return z > 0 ? kSure : std::uint8_t{0}; });
    write_whole(files_.folder() / fmt::format("confidence/{:06}.png", count_),
                encode_png(cv::Mat(c.height, c.width, CV_8U, sure.data())), Durable::some_time);
    video_.add(frame.color);
    const Eigen::Isometry3d pose = frame.world_from_camera.value();
    const Eigen::Quaterniond q(pose.linear());
    const Eigen::Vector3d t = pose.translation();
    odometry_ += fmt::format("{}, {:06}, {}, {}, {}, {}, {}, {}, {}\n", frame.timestamp, count_, t.x(), t.y(), t.z(),
                             q.x(), q.y(), q.z(), q.w());
    add_motion(frame);
    ++count_;
  }
  void finish() override {
    video_.finish();
    const Camera& c = files_.camera();
    files_.write_text("camera_matrix.csv",
                      fmt::format("{}, 0.0, {}\n0.0, {}, {}\n0.0, 0.0, 1.0\n", c.fx, c.cx, c.fy, c.cy));
    files_.write_text("odometry.csv", kHeader + odometry_);
    if (!motion_.empty()) files_.write_text("imu.csv", kMotionHeader + motion_);
  }

 private:
  /// Adds motion in the phone's axes. Core Motion's acceleration has the opposite sign of an accelerometer measurement.
  void add_motion(const Frame& frame) {
    const Eigen::Quaterniond phone_from_camera = camera_from_phone().conjugate();
    const Eigen::Quaterniond phone_from_imu =
        phone_from_camera * files_.rig().camera_from_imu.value_or(camera_from_phone());
    const Eigen::Vector3d mean = frame.acceleration.value_or(Eigen::Vector3d::Zero());
    accelerations_.insert(accelerations_.end(), frame.accelerations.begin(), frame.accelerations.end());
    for (const AngularRate& sample : frame.gyro) {
      const Eigen::Vector3d rate = phone_from_imu * sample.rate;
      const Eigen::Vector3d a = phone_from_camera * -acceleration_at(sample.timestamp).value_or(mean);
      motion_ += fmt::format("{}, {}, {}, {}, {}, {}, {}\n", sample.timestamp, a.x(), a.y(), a.z(), rate.x(), rate.y(),
                             rate.z());
    }
  }
  /// Interpolated sample, or the nearest one; empty without samples.
  [[nodiscard]] std::optional<Eigen::Vector3d> acceleration_at(double time) {
    while (accelerations_.size() > 1 && accelerations_[1].timestamp <= time) accelerations_.pop_front();
    if (accelerations_.empty()) return std::nullopt;
    const Acceleration& before = accelerations_.front();
    if (accelerations_.size() == 1 || time <= before.timestamp) return before.value;
    const Acceleration& after = accelerations_[1];
    const double share = (time - before.timestamp) / (after.timestamp - before.timestamp);
    return before.value + share * (after.value - before.value);
  }
  ImageFolder files_;
  VideoWriter video_;
  std::deque<Acceleration> accelerations_;  // not yet written
  int count_ = 0;
  std::string odometry_, motion_;
};

}  // namespace

std::unique_ptr<LayoutWriter> write_stray_scanner(const std::filesystem::path& folder, const Rig& rig) {
  return std::make_unique<StrayScannerWriter>(folder, rig);
}

}  // namespace cairn
