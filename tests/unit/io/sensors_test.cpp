// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// RealSense and Azure Kinect by stand-ins for their libraries: tests/support/sensor.
#include "cairn/io/sensors.hpp"

#include <dlfcn.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <numbers>

#include "cairn/io/source.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

/// Loads a stand-in before the library of the system, and configures it.
class VirtualSensors : public testing::Test {
 protected:
  VirtualSensors() {
    for (const char* name : {"/librealsense2.so", "/libk4a.so"}) {
      const std::string file = sensor_folder() + name;
      static_cast<void>(dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL));
    }
  }
  ~VirtualSensors() override {
    unsetenv("CAIRN_REALSENSE");
    unsetenv("CAIRN_K4A");
  }
  static std::unique_ptr<Source> open(const std::string& name, const std::string& behavior = "",
                                      const SourceOptions& options = {}) {
    configure(behavior);
    return open_source(name, options);
  }
  static std::string error(const std::string& name, const std::string& behavior) {
    return error_of([&] { (void)open(name, behavior); });
  }
  /// At 10 Hz a slow computer drops no image.
  static void configure(const std::string& behavior) {
    setenv("CAIRN_REALSENSE", (behavior + " rate=10").c_str(), 1);
    setenv("CAIRN_K4A", (behavior + " rate=10").c_str(), 1);
  }
  /// The next frames, without frames of an unplugged device.
  static std::vector<Frame> frames_of(Source& source, int count) {
    std::vector<Frame> frames;
    while (static_cast<int>(frames.size()) < count)
      if (auto frame = source.next().value(); !frame.problem) frames.push_back(std::move(frame));
    return frames;
  }
};

TEST_F(VirtualSensors, HaveTheirCamerasAndModels) {
  const auto realsense = open("realsense:");
  const Rig& d435 = realsense->rig();
  EXPECT_EQ(d435.depth, (Camera{.width = 848, .height = 480, .fx = 424, .fy = 424, .cx = 423.5, .cy = 239.5}));
  EXPECT_EQ(d435.sensor, sensor_model("stereo"));
  ASSERT_TRUE(d435.color);
  EXPECT_EQ(d435.color->camera.width, 1280);
  EXPECT_EQ(d435.color->camera.fx, 960);
  EXPECT_NEAR(d435.color->color_from_depth.translation().x(), -0.015, 1e-7);
  EXPECT_EQ(open("realsense:", "l515")->rig().sensor, sensor_model("time_of_flight"));

  const auto k4a = open("k4a:");
  const Rig& azure = k4a->rig();
  EXPECT_EQ(azure.depth.width, 640);
  EXPECT_EQ(azure.depth.cy, 288.25);
  EXPECT_NEAR(azure.depth.distortion[2], 2e-5, 1e-10) << "p1";
  EXPECT_NEAR(azure.depth.distortion[3], -7e-5, 1e-10) << "p2";
  EXPECT_NEAR(azure.depth.distortion[5], 0.9, 1e-6) << "k4";
  EXPECT_EQ(azure.sensor, sensor_model("time_of_flight"));
  ASSERT_TRUE(azure.color);
  EXPECT_EQ(azure.color->camera.height, 720);
  EXPECT_NEAR(azure.color->color_from_depth.translation().x(), -0.032, 1e-7);

  const Eigen::AngleAxisd quarter_turn(std::numbers::pi / 2, Eigen::Vector3d::UnitZ());
  for (const Rig* rig : {&d435, &azure}) {
    ASSERT_TRUE(rig->camera_from_imu);
    EXPECT_TRUE(rig->camera_from_imu->isApprox(Eigen::Quaterniond(quarter_turn), 1e-6));
  }
}

TEST_F(VirtualSensors, ColorLensInvertsTheSensorsModel) {
  const Camera color = open("realsense:")->rig().color->camera;
  const Eigen::Vector2d measured(0.4, -0.3);  // at z = 1
  const double r2 = measured.squaredNorm(), x = measured.x(), y = measured.y();
  const double f = 1 + r2 * (-0.05 + r2 * (0.06 + r2 * -0.02));
  const Eigen::Vector2d ray(x * f + 2 * 0.0005 * x * y - 0.0005 * (r2 + 2 * x * x),
                            y * f - 2 * 0.0005 * x * y + 0.0005 * (r2 + 2 * y * y));
  EXPECT_LT((color.distort(ray) - measured).norm() * color.fx, 0.05) << "pixels";
}

TEST_F(VirtualSensors, DeliverDepthColorAndMotionInOneClock) {
  for (const char* name : {"realsense:", "k4a:"}) {
    SCOPED_TRACE(name);
    const auto source = open(name);
    const auto frames = frames_of(*source, 4);
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const Frame& frame = frames[i];
      EXPECT_EQ(frame.index, static_cast<int>(i));
      EXPECT_NEAR(frame.timestamp, 1000 + static_cast<double>(i + 1) / 32, 1e-9);
      const Rig& rig = source->rig();
      ASSERT_EQ(frame.depth.size(), static_cast<std::size_t>(rig.depth.width * rig.depth.height));
      EXPECT_NEAR(frame.depth[0], 1.0, 0.0045);
      EXPECT_NEAR(frame.depth[500], 1.5, 0.0045);
      ASSERT_EQ(frame.color.size(), static_cast<std::size_t>(1280 * 720));
      EXPECT_EQ(frame.color[0] >> 24, 255u);
      EXPECT_NEAR(frame.color_delay, 0.004, 1e-6);
      ASSERT_GT(frame.gyro.size(), 5u);
      EXPECT_TRUE(frame.gyro.front().rate.isApprox(Eigen::Vector3d(0.1, 0.2, 0.3), 1e-6));
      EXPECT_LE(frame.gyro.back().timestamp, frame.timestamp);
      EXPECT_GT(frame.gyro.back().timestamp, frame.timestamp - 0.006);
      ASSERT_TRUE(frame.acceleration);
      EXPECT_TRUE(frame.acceleration->isApprox(Eigen::Vector3d(9.81, 0, 0), 1e-5)) << frame.acceleration->transpose();
    }
    EXPECT_EQ(source->dropped(), 0);
  }
}

TEST_F(VirtualSensors, ColorChannelsAreInOrder) {
  const TemporaryFolder folder;
  std::string pixels;
  for (int p = 0; p < 1280 * 720; ++p) pixels += "\x10\x20\x30";
  write_text(folder / "depth-0.raw", std::string(2 * 848 * 480, '\1'));
  write_text(folder / "color-0.raw", pixels);
  for (const char* name : {"realsense:", "k4a:"}) {
    const auto source = open(name, "frames=" + folder.path().string());
    EXPECT_EQ(frames_of(*source, 1)[0].color[7], 0xff302010u) << name;
  }
}

TEST_F(VirtualSensors, DepthUnitIsTheSensors) {
  EXPECT_NEAR(frames_of(*open("realsense:", "l515"), 1)[0].depth[0], 0.25, 0.002);
  const auto small = open("realsense:", "small noimu");
  EXPECT_EQ(small->rig().depth.width, 480);
  EXPECT_FALSE(small->rig().camera_from_imu);
  const Frame frame = frames_of(*small, 1)[0];
  EXPECT_NEAR(frame.depth[0], 0.2, 0.001);
  EXPECT_FALSE(frame.acceleration);
  EXPECT_TRUE(frame.gyro.empty());
}

TEST_F(VirtualSensors, DroppedImagesAreCountedAndNoError) {
  for (const char* name : {"realsense:", "k4a:"}) {
    const auto source = open(name, "drop=4");
    EXPECT_NEAR(frames_of(*source, 7).back().timestamp, 1000 + 9.0 / 32, 1e-9) << name;
    EXPECT_EQ(source->dropped(), 2) << name;
  }
}

TEST_F(VirtualSensors, ContinueAfterTheyArePluggedInAgain) {
  for (const char* name : {"realsense:", "k4a:"}) {
    SCOPED_TRACE(name);
    const auto source = open(name, "unplug=5 replug=3.5");
    const auto before = frames_of(*source, 5);
    const auto waiting = source->next();
    ASSERT_TRUE(waiting);
    ASSERT_TRUE(waiting->problem);
    EXPECT_NE(waiting->problem->find("the sensor is unplugged"), std::string::npos);
    const auto after = frames_of(*source, 3);
    EXPECT_NEAR(after[0].timestamp - before.back().timestamp, 3.6, 0.6) << "seconds of the computer's clock";
    EXPECT_NEAR(after[2].timestamp - after[0].timestamp, 2.0 / 32, 1e-9);
    EXPECT_FALSE(after[1].gyro.empty());
    EXPECT_EQ(source->dropped(), 0);
    EXPECT_FALSE(source->ended_early());
  }
}

TEST_F(VirtualSensors, AreSelectedBySerialNumber) {
  EXPECT_EQ(frames_of(*open("realsense:123622270002", "two"), 1).size(), 1u);
  EXPECT_EQ(frames_of(*open("k4a:000145594513", "two"), 1).size(), 1u);
  EXPECT_EQ(error("realsense:7", "two"),
            "realsense:7: no RealSense camera has this serial number; plugged in: 123622270001, 123622270002");
  EXPECT_EQ(error("k4a:7", "two"),
            "k4a:7: no Azure Kinect or Femto has this serial number; plugged in: 000145594512, 000145594513");
}

TEST_F(VirtualSensors, AreListed) {
  configure("two");
  const auto libraries = list_sensors();
  ASSERT_EQ(libraries.size(), 4u);
  ASSERT_EQ(libraries[1].sensors.size(), 2u);
  EXPECT_EQ(libraries[1].sensors[1].input, "realsense:123622270002");
  EXPECT_EQ(libraries[1].sensors[1].model, "Intel RealSense D435I");
  ASSERT_EQ(libraries[2].sensors.size(), 2u);
  EXPECT_EQ(libraries[2].sensors[0].input, "k4a:000145594512");
}

TEST_F(VirtualSensors, ErrorsNameCauseAndRemedy) {
  EXPECT_NE(error("realsense:", "none").find("realsense: no RealSense camera is plugged in"), std::string::npos);
  EXPECT_NE(error("k4a:", "none").find("k4a: no Azure Kinect or Femto is plugged in"), std::string::npos);
  EXPECT_NE(error("realsense:", "busy").find("is another program using it?"), std::string::npos);
  EXPECT_NE(error("k4a:", "busy").find("is another program using it?"), std::string::npos);
  EXPECT_NE(error("k4a:", "nocalibration").find("its calibration cannot be read"), std::string::npos);
}

TEST_F(VirtualSensors, TakeACameraFileOfTheirSize) {
  const TemporaryFolder folder;
  write_text(
      folder / "camera.yaml",
      "width: 848\nheight: 480\nfx: 430\nfy: 430\ncx: 423\ncy: 239\ncolor: {width: 1280, height: 720, fx: 950, fy: "
      "950, cx: 640, cy: 360, translation: [-0.02, 0, 0], rotation: [0, 0, 0, 1]}\n");
  const auto source = open("realsense:", "", {.camera = folder / "camera.yaml"});
  EXPECT_EQ(source->rig().depth.fx, 430);
  EXPECT_EQ(source->rig().color->camera.fx, 950);
  EXPECT_EQ(source->rig().sensor, sensor_model("stereo"));
  EXPECT_NE(error_of([&] { (void)open("k4a:", "", {.camera = folder / "camera.yaml"}); }).find("640x576"),
            std::string::npos);
}

TEST_F(VirtualSensors, AreNamesOfSensors) {
  for (const char* name : {"openni:", "realsense:", "realsense:1", "k4a:", "k4a:1"}) EXPECT_TRUE(is_sensor(name));
  for (const char* name : {"realsense", "synthetic:room", "k4a"}) EXPECT_FALSE(is_sensor(name));
}

}  // namespace
}  // namespace cairn
