// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/sensor_model.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "cairn/mapping/options.hpp"
#include "cairn/mapping/rig.hpp"
#include "cairn/synthetic/synthetic.hpp"
#include "mapper/checked_frame.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

std::string error_of(const std::function<void()>& work) {
  try {
    work();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

TEST(SensorModel, IsFoundByName) {
  for (const auto& [name, model] : kSensorModels) {
    EXPECT_EQ(sensor_model(name), model);
    EXPECT_EQ(to_string(model), name);
    EXPECT_NO_THROW(check(model));
  }
  SensorModel other;
  other.growth = 0.003f;
  EXPECT_EQ(to_string(other), "custom");
  EXPECT_NE(
      error_of([] { (void)sensor_model("sonar"); }).find("'sonar'; known sensors: structured_light, time_of_flight"),
      std::string::npos);
  other.floor = NAN;
  EXPECT_NE(error_of([&] { check(other); }).find("floor"), std::string::npos);
}

TEST(SensorModel, ChoosesRangeAndTruncation) {
  EXPECT_EQ(options_for({}).fuse.truncation, FuseOptions{}.truncation);
  EXPECT_EQ(options_for({}).surface.max_depth, SurfaceOptions{}.max_depth);
  const SensorModel noisy{.floor = 0.03f, .growth = 0, .max_depth = 3};
  const Options options = options_for(noisy);
  EXPECT_FLOAT_EQ(options.fuse.truncation, 0.075f);
  EXPECT_EQ(options.surface.max_depth, 3);
  EXPECT_FLOAT_EQ(options_for(noisy, 0.05f).fuse.truncation, 0.2f);
}

TEST(SensorModel, IsStoredInCameraFile) {
  const TemporaryFolder folder;
  Rig rig = small_camera();
  rig.depth.readout = 0.02;
  rig.camera_from_imu = Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5);
  SensorModel own = sensor_model("stereo");
  own.max_depth = 4;
  for (const SensorModel& model : {SensorModel{}, sensor_model("phone_lidar"), own}) {
    rig.sensor = model;
    write_rig(folder / "camera.yaml", rig);
    EXPECT_EQ(read_rig(folder / "camera.yaml"), rig);
  }
  const auto refused = [&](const char* lines) {
    std::ofstream(folder / "bad.yaml") << "fx: 500\nfy: 500\ncx: 320\ncy: 240\n" << lines;
    return error_of([&] { (void)read_rig(folder / "bad.yaml"); });
  };
  EXPECT_NE(refused("sensor: sonar\n").find("unknown sensor 'sonar'"), std::string::npos);
  EXPECT_NE(refused("sensor: {floor: -1}\n").find("floor is -1"), std::string::npos);
  EXPECT_NE(refused("sensor: {weight: heavy}\n").find("by_distance or by_noise"), std::string::npos);
  EXPECT_NE(refused("sensor: [1]\n").find("`sensor` takes"), std::string::npos);
  EXPECT_NE(refused("readout: -0.1\n").find("readout"), std::string::npos);
  EXPECT_NE(refused("readout: fast\n").find("readout"), std::string::npos);
  EXPECT_NE(refused("imu: {rotation: [1, 1, 1, 1]}\n").find("not a unit quaternion"), std::string::npos);
  EXPECT_NE(refused("imu: {rotation: [1, 0]}\n").find("qx qy qz qw"), std::string::npos);
}

TEST(SensorModel, DropsUnreliableDepth) {
  Rig rig = small_camera();
  rig.sensor.min_confidence = 100;
  Frame frame = scene_frame(synthetic_scene("room"), rig.depth, 0);
  frame.confidence.assign(frame.depth.size(), 255);
  frame.confidence[7] = 99;
  frame.confidence[8] = 100;
  const CheckedFrame checked(frame, rig, std::nullopt);
  EXPECT_EQ(checked.cause(), FrameCause::none);
  EXPECT_EQ(checked.frame().depth[7], 0);
  EXPECT_EQ(checked.frame().depth[8], frame.depth[8]);
  frame.confidence.pop_back();
  const CheckedFrame short_one(frame, rig, std::nullopt);
  EXPECT_EQ(short_one.cause(), FrameCause::partly_used);
  EXPECT_NE(short_one.reason().find("confidence"), std::string::npos);
  EXPECT_EQ(short_one.frame().depth[7], frame.depth[7]);
}

/// Standard deviation of depth between `nearest` and `farthest`, meters, away from edges.
double deviation(const SceneImages& noisy, const SceneImages& truth, float nearest, float farthest) {
  std::vector<float> errors;
  for (std::size_t i = 0; i < truth.depth.size(); ++i)
    if (truth.depth[i] > nearest && truth.depth[i] < farthest && noisy.depth[i] > 0 && truth.cosine[i] > 0.5f)
      errors.push_back(std::abs(noisy.depth[i] - truth.depth[i]));
  EXPECT_GT(errors.size(), 500u);
  std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2), errors.end());
  return 1.4826 * static_cast<double>(errors[errors.size() / 2]);
}

TEST(SensorModel, MatchesRenderedNoise) {
  const Scene scene = synthetic_scene("room");
  SceneRenderer renderer(test_device(), scene, synthetic_camera());
  const SceneImages truth = renderer.render(scene.world_from_camera(0));
  for (const auto& [noise, sensor] : {std::pair{"kinect", "structured_light"},
                                      {"tof", "time_of_flight"},
                                      {"stereo", "stereo"},
                                      {"lidar", "phone_lidar"}}) {
    SceneImages noisy = truth, again = truth;
    add_noise(noisy, synthetic_camera(), noise, 5, 2);
    add_noise(again, synthetic_camera(), noise, 5, 2);
    EXPECT_EQ(noisy.depth, again.depth) << noise;
    EXPECT_EQ(noisy.color, again.color) << noise;
    EXPECT_EQ(noisy.confidence.empty(), std::string(noise) != "lidar");
    const double found = deviation(noisy, truth, 1.8f, 2.2f), told = static_cast<double>(sensor_model(sensor).sigma(2));
    std::printf("%s: %.1f mm at 2 m, the model says %.1f\n", noise, 1000 * found, 1000 * told);
    EXPECT_GT(found, 0.25 * told) << noise;
    EXPECT_LT(found, 2 * told) << noise;  // the models exclude shifted pixels of slanted surfaces
  }
  SceneImages same = truth;
  add_noise(same, synthetic_camera(), "none", 1, 0);
  EXPECT_EQ(same.depth, truth.depth);
  EXPECT_THROW(add_noise(same, synthetic_camera(), "sonar", 1, 0), std::runtime_error);
}

}  // namespace
}  // namespace cairn
