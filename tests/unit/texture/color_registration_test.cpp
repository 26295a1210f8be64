// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "texture/color_registration.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace cairn {
namespace {

/// Patterned wall at a distance of a meter, seen from four cameras side by side with a wrong nominal focal scale.
ColorObservations wall(int points_a_side, float focal_scale) {
  struct Seen {
    Eigen::Vector2f point, camera;
  };
  std::vector<Seen> seen;
  ColorObservations o;
  o.points = static_cast<std::size_t>(points_a_side * points_a_side);
  for (const float camera : {-0.6f, -0.2f, 0.2f, 0.6f})
    for (std::size_t i = 0; i < o.points; ++i) {
      const auto n = static_cast<std::size_t>(points_a_side);
      const Eigen::Vector2f cell(static_cast<float>(i % n), static_cast<float>(i / n));
      seen.push_back({2 * cell / static_cast<float>(n) - Eigen::Vector2f::Ones(), {camera, -camera / 2}});
      o.point.push_back(i);
    }
  o.brightness = [seen, focal_scale](const shader::ColorCamera& camera, bool) {
    std::vector<float> brightness;
    for (const Seen& s : seen) {
      const Eigen::Vector2f at = s.point + (camera.focal_scale / focal_scale - 1) * (s.point - s.camera);
      brightness.push_back(0.5f + 0.4f * std::sin(9 * at.x()) * std::cos(7 * at.y()));
    }
    return brightness;
  };
  return o;
}

TEST(ColorRegistration, FindsTheFocalScaleOfConsistentColors) {
  constexpr float kScale = 1.06f, kNearly = 1e-3f;  // the prior has a slight influence
  const auto camera = register_color_camera(wall(30, kScale));
  ASSERT_TRUE(camera);
  EXPECT_NEAR(camera->focal_scale, kScale, kNearly);
}

TEST(ColorRegistration, KeepsACorrectCamera) { EXPECT_FALSE(register_color_camera(wall(30, 1.0f))); }

TEST(ColorRegistration, NeedsEnoughPoints) { EXPECT_FALSE(register_color_camera(wall(20, 1.06f))); }

}  // namespace
}  // namespace cairn
