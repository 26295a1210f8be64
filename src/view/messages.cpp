// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/messages.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "base/image_file.hpp"

namespace cairn {
namespace {

constexpr int kThumbnailWidth = 320;  // pixels
constexpr float kNearest = 0.3f;      // meters, red

template <class... Values>
std::string packed(Values... values) {
  std::string bytes;
  const auto put = [&](auto value) {
    static_assert(sizeof value == 4);
    bytes.append(reinterpret_cast<const char*>(&value), 4);
  };
  (put(values), ...);
  return bytes;
}

template <class T>
void append(std::string& bytes, const std::vector<T>& values) {
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

std::string image_message(std::uint32_t kind, const cv::Mat& image) {
  cv::Mat small;
  cv::resize(image, small, {kThumbnailWidth, image.rows * kThumbnailWidth / image.cols}, 0, 0, cv::INTER_NEAREST);
  const std::vector<std::uint8_t> jpeg = encode_jpeg(small, {.quality = 75});
  std::string bytes = packed(std::uint32_t{2}, kind);
  append(bytes, jpeg);
  return bytes;
}

}  // namespace

std::string part_message(const SurfaceBlock& part, int epoch) {
  const Mesh& mesh = part.mesh;
  Eigen::Vector3f low = Eigen::Vector3f::Zero(), high = low;
  if (!mesh.positions.empty()) low = high = mesh.positions[0];
  for (const auto& p : mesh.positions) low = low.cwiseMin(p), high = high.cwiseMax(p);
  const float size = std::max((high - low).maxCoeff(), 1e-6f);
  std::vector<std::uint16_t> positions;
  std::vector<std::int8_t> normals;
  std::vector<std::uint32_t> wide;
  for (const auto& p : mesh.positions) {
    for (int k = 0; k < 3; ++k)
      positions.push_back(static_cast<std::uint16_t>(std::lround((p[k] - low[k]) / size * 65535)));
    positions.push_back(0);
  }
  for (const auto& n : mesh.normals)
    for (int k = 0; k < 4; ++k) normals.push_back(k < 3 ? static_cast<std::int8_t>(std::lround(n[k] * 127)) : 0);
  for (const auto& t : mesh.triangles) wide.insert(wide.end(), t.begin(), t.end());
  std::string bytes =
      packed(std::uint32_t{1}, epoch, part.submap, part.cell.x(), part.cell.y(), part.cell.z(), low.x(), low.y(),
             low.z(), size, static_cast<std::uint32_t>(mesh.positions.size()), static_cast<std::uint32_t>(wide.size()));
  append(bytes, positions);
  append(bytes, mesh.colors);
  append(bytes, normals);
  if (mesh.positions.size() <= 0xffff)
    append(bytes, std::vector<std::uint16_t>(wide.begin(), wide.end()));
  else
    append(bytes, wide);
  return bytes;
}

std::string color_message(const Frame& frame, const Camera& camera) {
  return image_message(0,
                       cv::Mat(camera.height, camera.width, CV_8UC4, const_cast<std::uint32_t*>(frame.color.data())));
}

std::string depth_message(const Frame& frame, const Camera& camera, float max_depth) {
  const cv::Mat depth(camera.height, camera.width, CV_32F, const_cast<float*>(frame.depth.data()));
  cv::Mat small, level, picture;
  cv::resize(depth, small, {kThumbnailWidth, depth.rows * kThumbnailWidth / depth.cols}, 0, 0, cv::INTER_NEAREST);
  small.convertTo(level, CV_8U, -255.0 / (max_depth - kNearest), 255.0 * max_depth / (max_depth - kNearest));
  cv::applyColorMap(level, picture, cv::COLORMAP_TURBO);
  cv::cvtColor(picture, picture, cv::COLOR_BGR2RGB);
  picture.setTo(cv::Scalar(0, 0, 0), small == 0);
  return image_message(1, picture);
}

std::string path_message(const Trajectory& trajectory, int epoch) {
  const std::size_t step = trajectory.size() / kMaxPath + 1;
  std::vector<float> points;
  for (std::size_t i = 0; i < trajectory.size(); i += step) {
    const Eigen::Vector3f place = trajectory[i].world_from_camera.translation().cast<float>();
    points.push_back(static_cast<float>(trajectory[i].timestamp - trajectory[0].timestamp));
    points.insert(points.end(), place.data(), place.data() + 3);
  }
  std::string bytes = packed(std::uint32_t{3}, epoch, static_cast<std::uint32_t>(points.size() / 4));
  append(bytes, points);
  return bytes;
}

}  // namespace cairn
