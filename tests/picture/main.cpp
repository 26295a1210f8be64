// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Draws a mesh as a PNG, seen from above and outside with the near walls left out: the README's picture.
// Usage: cairn_picture MESH OUT.png [YAW_DEGREES] [PITCH_DEGREES]
#include <Eigen/Geometry>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "cairn/mesh.hpp"

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: cairn_picture MESH OUT.png [YAW_DEGREES] [PITCH_DEGREES]\n");
    return 2;
  }
  constexpr int kWidth = 2400, kHeight = 1300;  // twice the picture, for smooth edges
  const cairn::Mesh mesh = cairn::read_mesh(argv[1]);
  const double degree = std::numbers::pi / 180;
  const double yaw = (argc > 3 ? std::atof(argv[3]) : 25) * degree,
               pitch = (argc > 4 ? std::atof(argv[4]) : 42) * degree;
  const Eigen::Matrix3f turn =
      (Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitX()) * Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()))
          .toRotationMatrix()
          .cast<float>();
  Eigen::AlignedBox3f box;
  for (const auto& p : mesh.positions) box.extend(turn * p);
  const float scale = 0.96f * std::min(kWidth / box.sizes().x(), kHeight / box.sizes().y());
  const Eigen::Vector3f centre = box.center();
  cv::Mat image(kHeight, kWidth, CV_8UC3, cv::Scalar(255, 255, 255));
  cv::Mat nearest(kHeight, kWidth, CV_32F, cv::Scalar(std::numeric_limits<float>::max()));
  for (const auto& t : mesh.triangles) {
    Eigen::Vector3f v[3];
    for (std::size_t k = 0; k < 3; ++k) {
      v[k] = (turn * mesh.positions[t[k]] - centre) * scale;
      v[k].x() += kWidth / 2.0f;
      v[k].y() += kHeight / 2.0f;
    }
    const float area = (v[1].x() - v[0].x()) * (v[2].y() - v[0].y()) - (v[1].y() - v[0].y()) * (v[2].x() - v[0].x());
    if (area >= 0) continue;  // seen from behind: y is down, so that counter-clockwise is negative
    const Eigen::Vector3f low = v[0].cwiseMin(v[1]).cwiseMin(v[2]), high = v[0].cwiseMax(v[1]).cwiseMax(v[2]);
    for (int y = std::max(0, static_cast<int>(low.y())); y <= std::min(kHeight - 1, static_cast<int>(high.y()) + 1);
         ++y)
      for (int x = std::max(0, static_cast<int>(low.x())); x <= std::min(kWidth - 1, static_cast<int>(high.x()) + 1);
           ++x) {
        const auto edge = [&](const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
          return ((b.x() - a.x()) * (static_cast<float>(y) - a.y()) -
                  (b.y() - a.y()) * (static_cast<float>(x) - a.x())) /
                 area;
        };
        const float w0 = edge(v[1], v[2]), w1 = edge(v[2], v[0]), w2 = edge(v[0], v[1]);
        const float z = w0 * v[0].z() + w1 * v[1].z() + w2 * v[2].z();
        if (std::min({w0, w1, w2}) < -1e-3f || z >= nearest.at<float>(y, x)) continue;
        nearest.at<float>(y, x) = z;
        for (int c = 0; c < 3; ++c) {
          const auto k = static_cast<std::size_t>(2 - c);
          const float shade = mesh.colours.empty() ? 180.0f
                                                   : w0 * static_cast<float>(mesh.colours[t[0]][k]) +
                                                         w1 * static_cast<float>(mesh.colours[t[1]][k]) +
                                                         w2 * static_cast<float>(mesh.colours[t[2]][k]);
          image.at<cv::Vec3b>(y, x)[c] = cv::saturate_cast<unsigned char>(shade);
        }
      }
  }
  cv::resize(image, image, {kWidth / 2, kHeight / 2}, 0, 0, cv::INTER_AREA);
  return cv::imwrite(argv[2], image, {cv::IMWRITE_PNG_COMPRESSION, 9}) ? 0 : 1;
}
