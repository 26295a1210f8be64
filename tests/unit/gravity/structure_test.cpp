// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "gravity/structure.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>

#include "support/scenes.hpp"

namespace cairn {
namespace {

constexpr float kDegree = static_cast<float>(std::numbers::pi / 180);

float angle(const Eigen::Vector3f& a, const Eigen::Vector3f& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

/// Depth of the plane normal . p = offset.
std::vector<float> plane(const Camera& camera, const Eigen::Vector3d& normal, double offset) {
  std::vector<float> depth;
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u) {
      const Eigen::Vector2d ray = camera.undistorted_ray(u, v);
      depth.push_back(static_cast<float>(offset / normal.dot(Eigen::Vector3d(ray.x(), ray.y(), 1))));
    }
  return depth;
}

/// Visible area of a plane for a camera without lens distortion.
double seen_area(const Camera& camera, const Eigen::Vector3d& normal, double offset) {
  const auto at = [&](double u, double v) -> Eigen::Vector3d {
    const Eigen::Vector3d ray = camera.ray(u, v);
    return ray * (offset / normal.dot(ray));
  };
  const Eigen::Vector3d a = at(-0.5, -0.5), b = at(camera.width - 0.5, -0.5),
                        c = at(camera.width - 0.5, camera.height - 0.5), d = at(-0.5, camera.height - 0.5);
  return 0.5 * ((b - a).cross(c - a).norm() + (c - a).cross(d - a).norm());
}

TEST(Structure, ReportsNormalAndAreaOfAPlane) {
  Rig rig = small_camera();
  rig.sensor = sensor_model("exact");
  const Eigen::Vector3d normal = Eigen::Vector3d(0.3, -0.2, 1).normalized();
  for (const double lens : {0.0, -0.1}) {
    rig.depth.distortion[0] = lens;
    const Structure seen = StructureFinder(rig).find(plane(rig.depth, normal, 1.5));
    ASSERT_EQ(seen.facings.size(), 1u);
    EXPECT_LT(angle(seen.facings[0].normal, -normal.cast<float>()), 0.05f * kDegree);
    EXPECT_FLOAT_EQ(seen.facings[0].area, seen.area);
    // Noisier patches have a lower weight, here down to 0.9; with distortion another part of the plane is visible.
    if (lens == 0) {
      EXPECT_NEAR(seen.area / seen_area(rig.depth, normal, 1.5), 0.93, 0.07);
    }
  }
}

TEST(Structure, FindsFloorAndWallsOfARoomInNoise) {
  const Scene scene = synthetic_scene("room");
  for (int i = 0; i < 60; i += 20) {
    const Frame frame = scene_frame(scene, small_camera(), i, true);
    const Structure seen = StructureFinder(small_camera()).find(frame.depth);
    float near = 0, all = 0;
    for (const Structure::Facing& facing : seen.facings) {
      const Eigen::Vector3f in_scene = frame.world_from_camera->linear().cast<float>() * facing.normal;
      all += facing.area;
      if (in_scene.cwiseAbs().maxCoeff() > std::cos(2 * kDegree)) near += facing.area;
    }
    EXPECT_GT(near, 0.4f * all) << i;  // the rest is noise of the large pixels and edges of furniture
    const Eigen::Vector3f first = frame.world_from_camera->linear().cast<float>() * seen.facings.at(0).normal;
    EXPECT_GT(first.cwiseAbs().maxCoeff(), std::cos(1.5f * kDegree)) << i << ": " << first.transpose();
  }
}

TEST(Structure, IgnoresCurvedOrUnmeasuredPatches) {
  const Camera camera = small_camera();
  const StructureFinder finder(camera);
  EXPECT_TRUE(finder.find(std::vector<float>(plane(camera, Eigen::Vector3d::UnitZ(), 1).size(), 0)).facings.empty());
  std::vector<float> rough = plane(camera, Eigen::Vector3d::UnitZ(), 1);
  for (std::size_t i = 0; i < rough.size(); ++i) rough[i] += (i * 7919 % 13) * 0.02f;
  EXPECT_TRUE(finder.find(rough).facings.empty());
}

}  // namespace
}  // namespace cairn
