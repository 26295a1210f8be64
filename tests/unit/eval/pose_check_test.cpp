// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/eval/pose_check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "cairn/eval/verdict.hpp"
#include "cairn/io/source.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

constexpr double kInterval = 0.1;  // seconds
constexpr int kFrames = 40;
const Camera kCamera{80, 60, 65, 65, 39.5, 29.5, {}};

/// Ray-cast depth of a room with boxes.
std::vector<float> depth_of_a_room(const Eigen::Isometry3d& world_from_camera) {
  static const std::vector<Eigen::AlignedBox3d> boxes = [] {
    std::vector<Eigen::AlignedBox3d> all;
    for (const auto& [middle, half] :
         std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>>{{{0, 0, 0}, {2.2, 1.3, 2.6}},  // the walls
                                                                  {{0.5, 0.9, 1.6}, {0.4, 0.4, 0.3}},
                                                                  {{-0.9, 0.3, 1.9}, {0.3, 1.0, 0.2}},
                                                                  {{1.4, -0.4, 1.2}, {0.2, 0.3, 0.5}},
                                                                  {{-0.2, -0.9, 2.2}, {0.6, 0.2, 0.3}},
                                                                  {{-1.6, 0.8, 0.6}, {0.4, 0.5, 0.4}}})
      all.emplace_back(middle - half, middle + half);
    return all;
  }();
  std::vector<float> depth;
  for (int v = 0; v < kCamera.height; ++v)
    for (int u = 0; u < kCamera.width; ++u) {
      const Eigen::Vector3d from = world_from_camera.translation(),
                            ray = world_from_camera.linear() * kCamera.ray(u, v);
      double nearest = INFINITY;
      for (std::size_t i = 0; i < boxes.size(); ++i) {
        const Eigen::Array3d a = (boxes[i].min() - from).array() / ray.array(),
                             b = (boxes[i].max() - from).array() / ray.array();
        const double enters = a.min(b).maxCoeff(), leaves = a.max(b).minCoeff();
        if (i == 0)
          nearest = leaves;
        else if (enters > 0 && enters < leaves)
          nearest = std::min(nearest, enters);
      }
      depth.push_back(static_cast<float>(nearest));
    }
  return depth;
}

Eigen::Isometry3d hand_held(double t) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() =
      Eigen::Vector3d(0.5 * std::sin(0.9 * t), 0.2 * std::sin(1.7 * t + 1), -0.6 + 0.5 * std::sin(1.1 * t));
  pose.rotate(Eigen::AngleAxisd(0.5 * std::sin(1.3 * t), Eigen::Vector3d::UnitY()));
  pose.rotate(Eigen::AngleAxisd(0.25 * std::sin(2.1 * t), Eigen::Vector3d::UnitX()));
  pose.rotate(Eigen::AngleAxisd(0.2 * std::sin(0.8 * t + 2), Eigen::Vector3d::UnitZ()));
  return pose;
}

std::vector<Frame> frames_along(const PoseAt& path) {
  std::mt19937 random(1);
  std::normal_distribution<float> noise;
  std::vector<Frame> frames;
  for (int i = 0; i < kFrames; ++i) {
    Frame frame{.index = i, .timestamp = i * kInterval, .depth = depth_of_a_room(path(i * kInterval))};
    for (float& z : frame.depth) z += SensorModel{}.sigma(z) * noise(random);
    frames.push_back(std::move(frame));
  }
  return frames;
}

/// Poses of a path from one second before the first frame to one second after the last.
Trajectory poses_along(const PoseAt& path) {
  Trajectory poses;
  for (double t = -1; t < kFrames * kInterval + 1; t += 0.05) poses.push_back({t, path(t)});
  return poses;
}

/// Poses in another convention.
Trajectory written_in(Trajectory poses, const PoseConvention& c) {
  const Eigen::Matrix3d world = c.axes.determinant() < 0 ? c.axes : Eigen::Matrix3d::Identity();
  for (auto& [time, pose] : poses) {
    time -= c.clock;
    pose.linear() = world * pose.linear() * c.axes.transpose();
    pose.translation() = world * pose.translation();
    if (c.camera_from_world) pose = pose.inverse();
    pose.translation() /= c.scale;
    const Eigen::Quaterniond q(pose.linear());
    if (c.quaternion_w_first) pose.linear() = Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()).toRotationMatrix();
  }
  return poses;
}

/// Signed permutations, half of them rotations.
std::vector<Eigen::Matrix3d> all_axes(bool mirrored) {
  std::vector<Eigen::Matrix3d> all;
  std::array order{0, 1, 2};
  do
    for (int signs = 0; signs < 8; ++signs) {
      Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
      for (int i = 0; i < 3; ++i) axes(order[static_cast<std::size_t>(i)], i) = (signs >> i & 1) != 0 ? -1 : 1;
      if ((axes.determinant() < 0) == mirrored) all.push_back(axes);
    }
  while (std::next_permutation(order.begin(), order.end()));
  return all;
}

class PosesOfARoom : public testing::Test {
 protected:
  static const std::vector<Frame>& frames() {
    static const std::vector<Frame> all = frames_along(hand_held);
    return all;
  }
  static PoseCheck check_written_in(const PoseConvention& c) {
    return check_poses(kCamera, frames(), written_in(poses_along(hand_held), c));
  }
  static void expect_named(const PoseConvention& c) {
    const PoseCheck check = check_written_in(c);
    EXPECT_TRUE(check.contradicts) << to_string(c);
    EXPECT_TRUE(check.is_only) << to_string(c) << ": " << to_string(check.likely);
    EXPECT_EQ(to_string(check.likely), to_string(c));
    EXPECT_NE(to_string(check).find("give --poses-convention " + to_string(c)), std::string::npos) << to_string(check);
  }
};

TEST_F(PosesOfARoom, AreNotContradictedIfCorrect) {
  const PoseCheck check = check_written_in({});
  EXPECT_GE(check.pairs, 20);
  EXPECT_GT(check.as_given, 0.9);
  EXPECT_LT(check.motionless, 0.6);
  EXPECT_FALSE(check.contradicts);
  EXPECT_EQ(to_string(check), "");
}

TEST_F(PosesOfARoom, AreNotContradictedByTypicalTrackingErrors) {
  std::mt19937 random(2);
  std::normal_distribution<double> noise;
  Trajectory poses = poses_along([](double t) { return hand_held(t + 0.03); });
  for (auto& [time, pose] : poses) {
    pose.translation() *= 1.03;
    pose.translation() += 0.005 * Eigen::Vector3d(noise(random), noise(random), noise(random));
    pose.rotate(Eigen::AngleAxisd(0.005 * noise(random), Eigen::Vector3d::UnitY()));
  }
  EXPECT_FALSE(check_poses(kCamera, frames(), poses).contradicts);
}

TEST_F(PosesOfARoom, RevealTheirAxes) {
  for (const auto& axes : all_axes(false))
    if (axes != Eigen::Matrix3d::Identity()) expect_named({.axes = axes});
}

TEST_F(PosesOfARoom, RevealMirroring) {
  const auto all = all_axes(true);
  for (std::size_t i = 0; i < all.size(); i += 3) expect_named({.axes = all[i]});
}

TEST_F(PosesOfARoom, RevealDirectionOrderUnitAndClock) {
  expect_named({.camera_from_world = true});
  expect_named({.quaternion_w_first = true});
  for (const char* unit : {"mm", "cm", "ft", "km"}) expect_named(pose_convention(unit));
  for (const double clock : {0.5, -0.5}) expect_named({.clock = clock});
  expect_named(pose_convention("camera_from_world,opengl"));
  expect_named(pose_convention("wxyz,ros"));
  expect_named(pose_convention("wxyz,camera_from_world"));
}

TEST_F(PosesOfARoom, OfAnotherPathAreContradictedWithoutAConvention) {
  const PoseCheck check =
      check_poses(kCamera, frames(), poses_along([](double t) {
                    Eigen::Isometry3d pose = hand_held(1.37 * t + 40);
                    pose.rotate(Eigen::AngleAxisd(0.6 * std::sin(1.9 * t), Eigen::Vector3d::UnitX()));
                    return pose;
                  }));
  EXPECT_TRUE(check.contradicts);
  EXPECT_FALSE(check.is_likely) << to_string(check.likely) << check.explained;
  EXPECT_NE(to_string(check).find("no known pose convention explains it"), std::string::npos) << to_string(check);
}

TEST_F(PosesOfARoom, AreNotJudgedWithoutMotion) {
  const auto stands = [](double) { return hand_held(0); };
  const PoseCheck check = check_poses(kCamera, frames_along(stands), poses_along(stands));
  EXPECT_EQ(check.pairs, 0);
  EXPECT_FALSE(check.contradicts);
}

TEST_F(PosesOfARoom, AreNotJudgedWithOtherTimestamps) {
  Trajectory later = poses_along(hand_held);
  for (auto& pose : later) pose.timestamp += 1000;
  EXPECT_FALSE(check_poses(kCamera, frames(), later).contradicts);
}

TEST_F(PosesOfARoom, NameNoOptionIfTwoConventionsFitEqually) {
  // A camera rotating only about its own vertical: inverted, or with two flipped axes.
  const auto turns = [](double t) {
    return Eigen::Isometry3d(Eigen::AngleAxisd(0.5 * std::sin(1.3 * t), Eigen::Vector3d::UnitY()));
  };
  const PoseCheck check =
      check_poses(kCamera, frames_along(turns), written_in(poses_along(turns), {.camera_from_world = true}));
  EXPECT_TRUE(check.contradicts);
  EXPECT_TRUE(check.is_likely);
  EXPECT_FALSE(check.is_only) << to_string(check.likely);
  EXPECT_EQ(to_string(check).find("give --poses-convention"), std::string::npos) << to_string(check);
}

TEST_F(PosesOfARoom, LowerTheVerdictIfContradicted) {
  const RunMonitor evidence(kCamera, {});
  RunSummary outcome{.total = 40, .fused = 40, .poses = check_written_in({})};
  EXPECT_EQ(evidence.verdict(outcome).level, Verdict::Level::good);
  outcome.poses = check_written_in({.camera_from_world = true});
  const Verdict verdict = evidence.verdict(outcome);
  EXPECT_EQ(verdict.level, Verdict::Level::bad);
  EXPECT_NE(verdict.reasons.at(0).find("camera_from_world"), std::string::npos) << verdict.reasons.at(0);
  outcome.poses->as_given = 0.9;
  EXPECT_EQ(evidence.verdict(outcome).level, Verdict::Level::weak);
}

TEST(SampledFrames, AreFewAndSpreadOverARecording) {
  std::vector<Frame> all(1000);
  for (int i = 0; i < 1000; ++i)
    all[static_cast<std::size_t>(i)] = {.index = i, .timestamp = i / 30.0, .depth = std::vector<float>(4800, 1.0f)};
  /// Counts the frames read.
  class Seekable final : public Source {
   public:
    Seekable(std::vector<Frame> frames) : frames_(std::move(frames)) {}
    const Rig& rig() const override { return rig_; }
    std::optional<int> size() const override { return static_cast<int>(frames_.size()); }
    std::optional<double> next_timestamp() const override {
      return next_ < frames_.size() ? std::optional(frames_[next_].timestamp) : std::nullopt;
    }
    void skip() override { ++next_; }
    std::optional<Frame> next() override {
      return next_ < frames_.size() ? std::optional(frames_[next_++]) : std::nullopt;
    }

   private:
    Rig rig_{kCamera};
    std::vector<Frame> frames_;
    std::size_t next_ = 0;
  };
  Seekable seekable(all);
  const auto sampled = sampled_frames(seekable);
  ASSERT_EQ(sampled.size(), 96u);
  EXPECT_EQ(sampled[0].index, 0);
  EXPECT_EQ(sampled[1].index, 3);
  EXPECT_EQ(sampled[24].index, 250);
  EXPECT_EQ(sampled[72].index, 750);
  all.resize(30);
  Seekable brief(all);
  EXPECT_EQ(sampled_frames(brief).size(), 30u);
  GivenFrames in_order(kCamera, std::vector<Frame>(all));
  EXPECT_EQ(sampled_frames(in_order).size(), 30u);
}

class PosesOfARecording : public testing::Test {
 protected:
  static PoseCheck check(const std::string& recording, const std::string& poses, const std::string& written = "") {
    const auto source = open_source((data_folder() / recording).string(), {.find_color_camera = false});
    const auto frames = sampled_frames(*source);
    return check_poses(source->rig(), frames,
                       written_in(recorded_truth(data_folder() / poses), pose_convention(written)));
  }
  static void expect_right(const std::string& recording, const std::string& poses) {
    const PoseCheck right = check(recording, poses);
    EXPECT_FALSE(right.contradicts) << to_string(right);
    EXPECT_GT(right.as_given, 0.8) << recording;
  }
  static void expect_named(const std::string& recording, const std::string& poses, const std::string& written) {
    const PoseCheck wrong = check(recording, poses, written);
    EXPECT_TRUE(wrong.contradicts) << written;
    EXPECT_EQ(to_string(wrong.likely), written);
    EXPECT_TRUE(wrong.is_only);
  }
};

TEST_F(PosesOfARecording, OfAKinectThatTurns) {
  const std::string name = "tum_fr1_rpy_400";
  CAIRN_REQUIRE_DATA(name);
  expect_right(name, name);
  for (const char* written : {"camera_from_world", "opengl", "wxyz"}) expect_named(name, name, written);
  EXPECT_EQ(to_string(check(name, name, "mm").likely), "mm");  // rotates; the scale of its translation is uncertain
  EXPECT_NEAR(check(name, name, "clock=0.5").likely.clock, 0.5, 0.05);
}

TEST_F(PosesOfARecording, OfAKinectInAKitchen) {
  const std::string name = "7scenes_redkitchen_600";
  CAIRN_REQUIRE_DATA(name);
  expect_right(name, name);
  expect_right(name, name + "/groundtruth_sfm.txt");
  for (const char* written : {"camera_from_world", "opengl", "wxyz", "mm"}) expect_named(name, name, written);
  EXPECT_NEAR(check(name, name, "clock=-0.5").likely.clock, -0.5, 0.05);
}

TEST_F(PosesOfARecording, OfAStereoCamera) {
  for (const std::string name : {"realsense_d435_300", "realsense_d435_turn"}) {
    CAIRN_REQUIRE_DATA(name);
    expect_right(name, name + "/groundtruth.txt");
    EXPECT_TRUE(check(name, name + "/groundtruth.txt", "camera_from_world").contradicts);
  }
}

TEST_F(PosesOfARecording, WithImageNumbersAsTimes) {
  const std::string name = "icl_office_kt0_101";
  CAIRN_REQUIRE_DATA(name);
  expect_right(name, name);
  EXPECT_TRUE(check(name, name, "camera_from_world").contradicts);
}

}  // namespace
}  // namespace cairn
