// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <vector>

#include "cairn/mesh.hpp"

// One file format each; see write_mesh and read_mesh for what they share.
namespace cairn {

void write_gltf(const std::filesystem::path& file, const Mesh& mesh);
void write_ply(const std::filesystem::path& file, Mesh mesh, Axes axes = Axes::automatic);
[[nodiscard]] Mesh read_ply(const std::filesystem::path& file);

/// Wavefront: X.obj, X.mtl and, for parts with textures, X-0.jpg or .png and so on beside it.
struct ObjOptions {
  bool png = false;
  int jpeg_quality = 90;
  Axes axes = Axes::automatic;
};
/// Returns what was written, the file itself first.
std::vector<std::filesystem::path> write_obj(const std::filesystem::path& file, const std::vector<Mesh>& parts,
                                             const ObjOptions& options = {});

/// Metres, without colours.
void write_stl(const std::filesystem::path& file, const std::vector<Mesh>& parts, Axes axes = Axes::automatic);

/// Encoded as JPEG or PNG.
[[nodiscard]] std::vector<std::uint8_t> encode_image(const Texture& texture, bool png, int jpeg_quality);

}  // namespace cairn
