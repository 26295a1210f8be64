// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Renders a mesh as a PNG from above and outside without the near walls, for the README's pictures, or from an eye
// towards a point, as from within. Usage: cairn_picture MESH OUT.png [YAW_DEGREES] [PITCH_DEGREES]
//        cairn_picture MESH OUT.png EYE_X EYE_Y EYE_Z AT_X AT_Y AT_Z
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "cairn/eval/evaluation.hpp"

namespace {

/// Camera at `eye` looking towards `at`, with y down.
Eigen::Isometry3d look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& at) {
  const Eigen::Vector3d z = (at - eye).normalized(), x = Eigen::Vector3d::UnitY().cross(z).normalized();
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  world_from_camera.linear() << x, z.cross(x), z;
  world_from_camera.translation() = eye;
  return world_from_camera;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3 || (argc > 5 && argc != 9)) {
    std::fprintf(stderr, "usage: cairn_picture MESH OUT.png [YAW_DEGREES [PITCH_DEGREES] | EYE X Y Z AT X Y Z]\n");
    return 2;
  }
  const std::vector<cairn::Mesh> parts = cairn::read_mesh_parts(argv[1]);
  const auto number = [&](int i, double otherwise) { return argc > i ? std::atof(argv[i]) : otherwise; };
  cairn::Camera camera{1200, 650, 0, 0, 599.5, 324.5, {}};
  Eigen::Isometry3d world_from_camera;
  if (argc == 9) {
    camera.fx = camera.fy = 700;
    world_from_camera = look_at({number(3, 0), number(4, 0), number(5, 0)}, {number(6, 0), number(7, 0), number(8, 0)});
  } else {
    constexpr double kEyeDistance = 100;  // meters: nearly without perspective
    const double degree = std::numbers::pi / 180;
    const Eigen::Matrix3d turn = (Eigen::AngleAxisd(number(4, 42) * degree, Eigen::Vector3d::UnitX()) *
                                  Eigen::AngleAxisd(number(3, 25) * degree, Eigen::Vector3d::UnitY()))
                                     .toRotationMatrix();
    Eigen::AlignedBox3d box;
    for (const cairn::Mesh& mesh : parts)
      for (const auto& p : mesh.positions) box.extend(turn * p.cast<double>());
    camera.fx = camera.fy =
        0.96 * kEyeDistance * std::min(camera.width / box.sizes().x(), camera.height / box.sizes().y());
    Eigen::Isometry3d camera_from_world = Eigen::Isometry3d::Identity();
    camera_from_world.linear() = turn;
    camera_from_world.translation() = Eigen::Vector3d(0, 0, kEyeDistance) - box.center();
    world_from_camera = camera_from_world.inverse();
  }
  const cairn::RenderedView view = cairn::render_mesh(parts, camera, world_from_camera);
  cv::Mat image(camera.height, camera.width, CV_8UC3);
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const auto i = static_cast<std::size_t>(y * camera.width + x);
      const std::uint32_t c = view.depth[i] > 0 ? view.color[i] : 0xffffffffu;
      image.at<cv::Vec3b>(y, x) = {static_cast<std::uint8_t>(c >> 16), static_cast<std::uint8_t>(c >> 8),
                                   static_cast<std::uint8_t>(c)};
    }
  return cv::imwrite(argv[2], image, {cv::IMWRITE_PNG_COMPRESSION, 9}) ? 0 : 1;
}
