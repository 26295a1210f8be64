// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// OpenCV contrib's hash TSDF (its KinFu class is refused by Debian's build): fuses given poses and raycasts.
// Usage: opencv_peer LIST, with lines `depth.png tx ty tz qx qy qz qw`; first line: fx fy cx cy depth_scale frames
#include <sys/resource.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/rgbd/volume.hpp>
#include <vector>

int main(int, char** argv) {
  std::ifstream list(argv[1]);
  double fx, fy, cx, cy, scale;
  int frames;
  list >> fx >> fy >> cx >> cy >> scale >> frames;
  const auto median = [](std::vector<double> v) {
    std::nth_element(v.begin(), v.begin() + static_cast<long>(v.size() / 2), v.end());
    return v[v.size() / 2];
  };
  // The last argument is the side of a volume unit in voxels, as in the library's own defaults.
  const auto volume = cv::kinfu::makeVolume(cv::kinfu::VolumeType::HASHTSDF, 0.01f, cv::Matx44f::eye(), 0.75f, 0.04f,
                                            64, 5.0f, cv::Vec3i::all(16));
  const cv::Matx33f intrinsics(static_cast<float>(fx), 0, static_cast<float>(cx), 0, static_cast<float>(fy),
                               static_cast<float>(cy), 0, 0, 1);
  std::vector<double> integrate_ms, raycast_ms;
  std::string file;
  double v[7];
  for (int i = 0; i < frames && list >> file; ++i) {
    for (double& x : v) list >> x;
    Eigen::Isometry3d pose(Eigen::Quaterniond(v[6], v[3], v[4], v[5]));
    pose.translation() = Eigen::Vector3d(v[0], v[1], v[2]);
    cv::Matx44f m;
    for (int r = 0; r < 4; ++r)
      for (int c = 0; c < 4; ++c) m(r, c) = static_cast<float>(pose.matrix()(r, c));
    cv::Mat depth = cv::imread(file, cv::IMREAD_UNCHANGED), meters;
    depth.setTo(0, depth == 65535);
    depth.convertTo(meters, CV_32F);
    const auto start = std::chrono::steady_clock::now();
    volume->integrate(meters, static_cast<float>(scale), m, cv::kinfu::Intr(intrinsics), i);
    const auto middle = std::chrono::steady_clock::now();
    cv::Mat points, normals;
    volume->raycast(m, cv::kinfu::Intr(intrinsics), meters.size(), points, normals);
    const auto end = std::chrono::steady_clock::now();
    if (i < 5) continue;
    integrate_ms.push_back(std::chrono::duration<double, std::milli>(middle - start).count());
    raycast_ms.push_back(std::chrono::duration<double, std::milli>(end - middle).count());
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  std::printf("{\"integrate_ms\": %.2f, \"raycast_ms\": %.2f, \"peak_memory_mb\": %.0f}\n", median(integrate_ms),
              median(raycast_ms), static_cast<double>(usage.ru_maxrss) / 1024);
}
