// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <vector>

#include "cairn/mapping/mesh.hpp"

// One function per file format; for common behavior see write_mesh and read_mesh.
namespace cairn {

void write_gltf(const std::filesystem::path& file, const Mesh& mesh);
void write_ply(const std::filesystem::path& file, Mesh mesh, Axes axes = Axes::automatic);
[[nodiscard]] Mesh read_ply(const std::filesystem::path& file);

/// Wavefront: X.obj, X.mtl and, for parts with textures, X-0.jpg or .png etc. in the same folder.
struct ObjOptions {
  bool png = false;
  int jpeg_quality = 90;
  Axes axes = Axes::automatic;
};
/// Returns the written files, the .obj first.
std::vector<std::filesystem::path> write_obj(const std::filesystem::path& file, const std::vector<Mesh>& parts,
                                             const ObjOptions& options = {});

/// Meters, without colors.
void write_stl(const std::filesystem::path& file, const std::vector<Mesh>& parts, Axes axes = Axes::automatic);

/// Points with colors, as LAS.
void write_las(const std::filesystem::path& file, const Mesh& points, Axes axes = Axes::automatic);

/// Textures, or colors of parts without a texture; y up, meters.
void write_usdz(const std::filesystem::path& file, const std::vector<Mesh>& parts, int jpeg_quality = 90);

/// Encoded as JPEG or PNG.
[[nodiscard]] std::vector<std::uint8_t> encode_image(const Texture& texture, bool png, int jpeg_quality);

}  // namespace cairn
