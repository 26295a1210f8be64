// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <opencv2/core.hpp>
#include <stdexcept>

#include "base/file_name.hpp"
#include "base/image_file.hpp"
#include "mesh/formats.hpp"
#include "mesh/gltf.hpp"
#include "mesh/topology.hpp"

namespace cairn {
namespace {

[[noreturn]] void unknown(const std::filesystem::path& file) {
  throw std::runtime_error(file.string() + ": '" + file.extension().string() +
                           "' is not a supported mesh format; use .glb, .gltf or .ply");
}

}  // namespace

std::vector<std::uint8_t> encode_image(const Texture& texture, bool png, int jpeg_quality) {
  const cv::Mat rgb(texture.height, texture.width, CV_8UC3, const_cast<std::uint8_t*>(texture.texels[0].data()));
  return png ? encode_png(rgb, 6) : encode_jpeg(rgb, {.quality = jpeg_quality, .smallest = true});
}

void write_mesh(const std::filesystem::path& file, const Mesh& mesh) {
  const std::string extension = extension_of(file);
  if (extension == ".glb" || extension == ".gltf") return write_gltf(file, mesh);
  if (extension == ".ply") return write_ply(file, mesh);
  if (extension == ".obj") return static_cast<void>(write_obj(file, {mesh}));
  if (extension == ".stl") return write_stl(file, {mesh});
  unknown(file);
}

std::vector<Mesh> read_mesh_parts(const std::filesystem::path& file) {
  const std::string extension = extension_of(file);
  std::vector<Mesh> parts;
  if (extension == ".glb" || extension == ".gltf")
    parts = read_gltf_parts(file);
  else if (extension == ".ply")
    parts.push_back(read_ply(file));
  else
    unknown(file);
  for (const Mesh& part : parts)
    for (std::size_t v = 0; v < part.positions.size(); ++v)
      if (!part.positions[v].allFinite())
        throw std::runtime_error(file.string() + ": vertex " + std::to_string(v) +
                                 " has a coordinate that is not finite");
  return parts;
}

Mesh read_mesh(const std::filesystem::path& file) {
  std::vector<Mesh> parts = read_mesh_parts(file);
  return parts.size() == 1 ? std::move(parts[0]) : joined(parts);
}

}  // namespace cairn
