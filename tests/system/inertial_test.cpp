// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Inertial sensors through the program: estimated biases, mounting, clock and gravity.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <numbers>

#include "support/recordings.hpp"

namespace cairn {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

TEST(InertialSensors, AreCalibratedByTwentySecondsOfHandMotion) {
  const TemporaryFolder out;
  const auto to = [&](const char* name) { return (out / name).string(); };
  Ran ran = run_cairn({"synth",   "room",        "-o",    to("recording"), "--frames",
                       "300",     "--rate",      "15",    "--width",       "320",
                       "--noise", "none",        "--imu", "mems",          "--imu-misalignment",
                       "0.015",   "--imu-lever", "0.02",  "--imu-delay",   "0.003"});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  ran = run_cairn({"info", to("recording"), "--json"});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NEAR(nlohmann::json::parse(ran.out)["inertial"]["gyroscope"]["hertz"].get<double>(), 200, 1);

  ran = run_cairn({"reconstruct", to("recording"), "-o", to("map"), "--quality", "fast", "--no-mesh"});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NE(ran.out.find("inertial    sensors trusted"), std::string::npos) << ran.out;
  EXPECT_NE(ran.out.find("upright     measured by gyroscope and accelerometer"), std::string::npos) << ran.out;
  ran = run_cairn({"evaluate", "inertial", to("map"), to("recording"), "--json"});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  const auto error = nlohmann::json::parse(ran.out);
  std::printf("%s\n", ran.out.c_str());
  // With 640x480 pixels, 30 Hz and a Kinect's noise: 0.008 degrees/s, 0.007 m/s^2, 0.00 and 0.05 degrees, 0.9 cm, 0.3
  // ms.
  EXPECT_LT(error["gyroscope_bias"].get<double>(), 0.03 * kDegree);
  EXPECT_LT(error["accelerometer_bias"].get<double>(), 0.03);
  EXPECT_LT(error["gravity_rad"].get<double>(), 0.2 * kDegree);
  EXPECT_LT(error["rotation_rad"].get<double>(), 0.3 * kDegree);
  EXPECT_LT(error["lever_m"].get<double>(), 0.015);
  EXPECT_NEAR(error["clock_s"].get<double>(), 0, 0.001);

  ran = run_cairn({"evaluate", "inertial", to("map"), to("map")});
  EXPECT_EQ(ran.exit_code, 1);
  EXPECT_NE(ran.err.find("has no groundtruth_imu.json"), std::string::npos) << ran.err;
}

}  // namespace
}  // namespace cairn
