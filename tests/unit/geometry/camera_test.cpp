// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/camera.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <opencv2/calib3d.hpp>

#include "cairn/mapping/mapper.hpp"
#include "cairn/mapping/rig.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

TEST(CameraCheck, AcceptsCamerasOfSensors) {
  EXPECT_NO_THROW(check(Camera{}));
  EXPECT_NO_THROW(check(Camera{16, 16, 14, 14, 7.5, 7.5, {}}));
  EXPECT_NO_THROW(check(Camera{4096, 4096, 2000, 2000, 2047.5, 2047.5, {0.2624, -0.9531, -0.0054, 0.0026, 1.1633}}));
  EXPECT_NO_THROW(check(Camera{320, 288, 252, 252, 163, 167, {5.4, 3.6, 0, 0, 0.19}}));  // a time-of-flight camera
}

TEST(CameraCheck, RejectsImpossibleCameras) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const auto refused = [](const Camera& camera, const char* field) {
    const std::string told = error_of([&] { check(camera); });
    EXPECT_NE(told.find(std::string("the camera's ") + field), std::string::npos) << told;
    EXPECT_NE(error_of([&] { Mapper mapper(camera); }).find(field), std::string::npos);
  };
  refused({0, 0, 525, 525, 319.5, 239.5, {}}, "width");
  refused({640, 4097, 525, 525, 319.5, 239.5, {}}, "height");
  refused({640, 480, -1, 525, 319.5, 239.5, {}}, "fx");
  refused({640, 480, 525, kNan, 319.5, 239.5, {}}, "fy");
  refused({640, 480, 525, 525, -5000, 239.5, {}}, "cx");
  refused({640, 480, 525, 525, 319.5, 1e300, {}}, "cy");
  refused({640, 480, 525, 525, 319.5, 239.5, {0, kNan, 0, 0, 0}}, "distortion");
}

TEST(RigCheck, RejectsImpossibleColorCamera) {
  Rig rig;
  rig.color.emplace();
  EXPECT_NO_THROW(check(rig));
  Rig far = rig, bent = rig, turned = rig;
  far.color->color_from_depth.translation().x() = 11;
  bent.color->camera.fx = 0;
  turned.color->color_from_depth.linear() *= 1.1;
  EXPECT_NE(error_of([&] { check(far); }).find("color_from_depth"), std::string::npos);
  EXPECT_NE(error_of([&] { check(bent); }).find("color: the camera's fx"), std::string::npos);
  EXPECT_NE(error_of([&] { check(turned); }).find("rotation"), std::string::npos);
}

/// Real cameras: a Kinect's color camera, an Azure Kinect's depth camera and a wide fisheye.
std::vector<Camera> bent_cameras() {
  Camera time_of_flight{
      640, 576, 504, 504, 320, 333, {0.548, -0.021, -7.2e-5, 2.06e-5, -0.00265, 0.89, 0.086, -0.0139}};
  Camera fisheye{848, 800, 286, 286, 424, 400, {-0.0088, 0.0433, -0.0414, 0.0078}};
  fisheye.lens = Lens::fisheye;
  return {Camera{640, 480, 517, 516, 318, 255, {0.2624, -0.9531, -0.0054, 0.0026, 1.1633}}, time_of_flight, fisheye};
}

TEST(Lens, DistortsAsOpenCv) {
  for (const Camera& camera : bent_cameras()) {
    std::vector<cv::Point3d> points;
    for (double y = -0.4; y <= 0.4; y += 0.1)
      for (double x = -0.5; x <= 0.5; x += 0.1) points.emplace_back(x, y, 1);
    std::vector<cv::Point2d> expected;
    const std::vector<double> d(camera.distortion.begin(), camera.distortion.end());
    if (camera.lens == Lens::fisheye)
      cv::fisheye::projectPoints(points, expected, cv::Vec3d(), cv::Vec3d(), cv::Matx33d::eye(),
                                 std::vector<double>(d.begin(), d.begin() + 4));
    else
      cv::projectPoints(points, cv::Vec3d(), cv::Vec3d(), cv::Matx33d::eye(), d, expected);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector2d bent = camera.distort({points[i].x, points[i].y});
      EXPECT_NEAR(bent.x(), expected[i].x, 1e-12);
      EXPECT_NEAR(bent.y(), expected[i].y, 1e-12);
    }
  }
}

TEST(Lens, UndistortsExactly) {
  for (const Camera& camera : bent_cameras())
    for (double v = 0; v < camera.height; v += 37)
      for (double u = 0; u < camera.width; u += 41) {
        const Eigen::Vector2d ray = camera.undistorted_ray(u, v);
        if (ray.norm() > 0.9 * camera.widest_ray()) continue;  // beyond, Brown's polynomial of a Kinect folds back
        const Eigen::Vector2d bent = camera.distort(ray);
        EXPECT_NEAR(camera.fx * bent.x() + camera.cx, u, 1e-6);
        EXPECT_NEAR(camera.fy * bent.y() + camera.cy, v, 1e-6);
      }
}

}  // namespace
}  // namespace cairn
