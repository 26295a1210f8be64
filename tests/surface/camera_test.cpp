// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/camera.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "cairn/mapper.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

TEST(CameraCheck, TakesWhatSensorsHave) {
  EXPECT_NO_THROW(check(Camera{}));
  EXPECT_NO_THROW(check(Camera{16, 16, 14, 14, 7.5, 7.5, {}}));
  EXPECT_NO_THROW(check(Camera{4096, 4096, 2000, 2000, 2047.5, 2047.5, {0.2624, -0.9531, -0.0054, 0.0026, 1.1633}}));
  EXPECT_NO_THROW(check(Camera{320, 288, 252, 252, 163, 167, {5.4, 3.6, 0, 0, 0.19}}));  // a time-of-flight camera
}

TEST(CameraCheck, RefusesWhatNoImageCanBeOf) {
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

}  // namespace
}  // namespace cairn
