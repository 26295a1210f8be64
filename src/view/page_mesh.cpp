// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/page_mesh.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <utility>
#include <vector>

#include "cairn/mapping/mesh.hpp"
#include "mesh/gltf.hpp"
#include "view/first_mesh.hpp"

namespace cairn {
namespace {

constexpr int kJpegQuality = 80;
constexpr double kMinScale = 1.0 / 16;        // of a texture's side
constexpr std::size_t kBytesPerTriangle = 8;  // of a compressed coarse mesh with colors: 6 to 8
constexpr std::size_t kMinTriangles = 100;    // fewer show no shape

Texture scaled(const Texture& texture, double scale) {
  if (texture.texels.empty() || scale >= 1) return texture;
  const auto side = [&](int size) { return std::max(1, static_cast<int>(std::lround(scale * size))); };
  Texture small{.width = side(texture.width), .height = side(texture.height), .texels = {}};
  small.texels.resize(static_cast<std::size_t>(small.width) * static_cast<std::size_t>(small.height));
  cv::Mat to(small.height, small.width, CV_8UC3, small.texels.data());
  const cv::Mat from(texture.height, texture.width, CV_8UC3,
                     const_cast<std::array<std::uint8_t, 3>*>(texture.texels.data()));
  cv::resize(from, to, to.size(), 0, 0, cv::INTER_AREA);
  return small;
}

std::string encoded(std::vector<Mesh>& parts, double scale) {
  GltfOptions options;
  options.compression = Compression::meshopt;
  options.jpeg_quality = kJpegQuality;
  GltfWriter writer(options);
  for (Mesh& part : parts) {
    part.normals.clear();  // computed by the page
    Texture full = std::exchange(part.texture, {});
    part.texture = scaled(full, scale);
    writer.add("map", part);
    part.texture = std::move(full);
  }
  std::ostringstream out;
  writer.put(out);
  return std::move(out).str();
}

}  // namespace

std::string page_mesh(const std::filesystem::path& file, std::size_t max_bytes) {
  std::vector<Mesh> parts = read_mesh_parts(file);
  const bool has_texture =
      std::any_of(parts.begin(), parts.end(), [](const Mesh& part) { return !part.texture.texels.empty(); });
  std::string glb = encoded(parts, 1);
  if (glb.size() <= max_bytes) return glb;
  if (has_texture && encoded(parts, kMinScale).size() <= max_bytes)
    for (double scale = 1;;) {
      // The bytes of a texture are proportional to its area; those of the triangles remain.
      const double ratio = static_cast<double>(max_bytes) / static_cast<double>(glb.size());
      scale = std::max(kMinScale, scale * std::clamp(0.9 * std::sqrt(ratio), 0.5, 0.9));
      glb = encoded(parts, scale);
      if (glb.size() <= max_bytes) return glb;
    }
  parts.clear();
  for (std::size_t triangles = max_bytes / kBytesPerTriangle; triangles >= kMinTriangles; triangles /= 2)
    if (glb = first_mesh(file, triangles); glb.size() <= max_bytes) return glb;
  return {};
}

}  // namespace cairn
