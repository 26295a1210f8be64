// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Runs with poses of another convention.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "cairn/io/pose_convention.hpp"
#include "support/files.hpp"
#include "support/recordings.hpp"

namespace cairn {
namespace {

/// Small recording with true poses, and the poses in other conventions.
class GivenPoses : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    setenv("CAIRN_VALIDATION", "0", 1);
    folder = new TemporaryFolder;
    write_small_recording(*folder / "rec", {.frames = 30, .speed = 3});
    const Scene scene = synthetic_scene("room");
    Trajectory poses;
    for (int i = 0; i < 30; ++i) poses.push_back({i / 30.0, scene.world_from_camera(i / 10.0)});
    write_trajectory(*folder / "right.txt", poses);
    write_trajectory(*folder / "inverse.txt", with_convention(poses, pose_convention("camera_from_world")));
    std::string wxyz;
    for (const auto& [time, pose] : poses) {
      const Eigen::Quaterniond q(pose.linear());
      wxyz += std::to_string(time);
      for (const double v :
           {pose.translation().x(), pose.translation().y(), pose.translation().z(), q.w(), q.x(), q.y(), q.z()})
        wxyz += ' ' + std::to_string(v);
      wxyz += '\n';
    }
    write_text(*folder / "wxyz.txt", wxyz);
  }
  static void TearDownTestSuite() {
    setenv("CAIRN_VALIDATION", "1", 1);
    delete folder;
  }
  static Ran fuse(const std::string& output, std::vector<std::string> more) {
    std::vector<std::string> all{"reconstruct", "rec", output, "--config", "rec.yaml", "--no-texture"};
    all.insert(all.end(), more.begin(), more.end());
    return run_cairn(all, "cd '" + folder->path().string() + "'; ");
  }
  static nlohmann::json report(const std::string& output) {
    return nlohmann::json::parse(read_bytes(*folder / output / "report.json"));
  }
  static TemporaryFolder* folder;
};
TemporaryFolder* GivenPoses::folder = nullptr;

TEST_F(GivenPoses, ThatAreRightAreGood) {
  const Ran ran = fuse("right", {"--poses", "right.txt"});
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NE(ran.out.find("good: 30 of 30"), std::string::npos) << ran.out;
  EXPECT_EQ(ran.err.find("contradict"), std::string::npos) << ran.err;
  EXPECT_FALSE(report("right")["poses"]["contradicted"]);
  EXPECT_GT(report("right")["poses"]["agree"], 0.9);
}

TEST_F(GivenPoses, OfAnotherConventionAreNotGoodUntilItIsGiven) {
  for (const auto& [file, convention] :
       {std::pair<std::string, std::string>{"inverse", "camera_from_world"}, {"wxyz", "wxyz"}}) {
    const Ran ran = fuse(file, {"--poses", file + ".txt"});
    EXPECT_NE(ran.exit_code, 0) << ran.out;
    EXPECT_EQ(ran.out.find("good:"), std::string::npos) << ran.out;
    EXPECT_NE(ran.err.find("the poses contradict the depth"), std::string::npos) << ran.err;
    EXPECT_NE(ran.out.find("give --poses-convention " + convention), std::string::npos) << ran.out;
    const auto told = report(file);
    EXPECT_NE(told["verdict"]["level"], "good");
    EXPECT_EQ(told["poses"]["likely"]["convention"], convention);
    EXPECT_TRUE(told["poses"]["likely"]["only"]);
    const Ran again = fuse(file + "-again", {"--poses", file + ".txt", "--poses-convention", convention});
    EXPECT_EQ(again.exit_code, 0) << again.err;
    EXPECT_NE(again.out.find("good: 30 of 30"), std::string::npos) << again.out;
  }
}

TEST_F(GivenPoses, AsAGuessOfAnotherConventionAreWarnedOf) {
  const Ran ran = fuse("guess", {"--guess", "inverse.txt"});
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NE(ran.err.find("--guess: the poses contradict the depth"), std::string::npos) << ran.err;
  EXPECT_EQ(
      fuse("guess-again", {"--guess", "inverse.txt", "--poses-convention", "camera_from_world"}).err.find("contradict"),
      std::string::npos);
}

TEST_F(GivenPoses, HaveAConventionThatIsChecked) {
  expect_one_line(fuse("no", {"--poses", "right.txt", "--poses-convention", "opencv"}), 2, "is not a pose convention");
  EXPECT_EQ(fuse("no", {"--poses-convention", "opengl"}).exit_code, 2);
}

}  // namespace
}  // namespace cairn
