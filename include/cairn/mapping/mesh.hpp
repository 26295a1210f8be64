// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

namespace cairn {

/// Texture image of a mesh, row-major from the top; sRGB.
struct Texture {
  int width = 0, height = 0;
  std::vector<std::array<std::uint8_t, 3>> texels;
};

/// Triangle mesh in the map's world frame (z forward of the first camera, y down, or the frame of the given poses).
/// Vertex attributes are empty or have the size of `positions`. Triangles are counter-clockwise seen from outside.
struct Mesh {
  std::vector<Eigen::Vector3f> positions;            ///< meters
  std::vector<Eigen::Vector3f> normals;              ///< unit length, away from the solid
  std::vector<std::array<std::uint8_t, 4>> colors;   ///< R, G, B, 255 (sRGB)
  std::vector<float> weights;                        ///< observations at 1 m; only for meshes of a map, never stored in
                                                     ///< files
  std::vector<float> sigmas;                         ///< meters; see SurfaceSigma::at_each; for adjusted maps only
  std::vector<Eigen::Vector2f> texture_coordinates;  ///< (0, 0) is the texture's upper left corner, (1, 1) its lower
                                                     ///< right
  std::vector<std::array<std::uint32_t, 3>> triangles;
  Texture texture;
};

/// Axes of exported files. World frame: x right, y down, z forward.
enum class Axes : std::uint8_t {
  automatic,  ///< format convention: y_up for glTF and OBJ, z_up for STL and 3D Tiles, else the world
  world,
  y_up,  ///< (x, -y, -z): forward is -z
  z_up   ///< (x, z, -y): forward is y
};
/// `world`, `yup` or `zup`: the name written into files.
[[nodiscard]] std::string to_string(Axes axes);

/// Writes a mesh. The extension selects the format: .glb, .gltf (with .bin and texture beside it), .ply (binary), .obj
/// (with .mtl and texture) or .stl (binary, neither colors nor texture). Uses Axes::automatic; glTF (in
/// `asset.extras`), PLY and OBJ (in a comment) record the axes; PLY has no texture. glTF and PLY store sigmas. Atomic.
/// Throws std::runtime_error for an unknown extension or an unwritable path.
void write_mesh(const std::filesystem::path& file, const Mesh& mesh);

/// Reads .glb, .gltf (also with KHR_mesh_quantization, EXT_meshopt_compression and KHR_draco_mesh_compression) and .ply
/// from write_mesh or other programs, converted to the world frame. Merges several parts into one mesh without texture.
[[nodiscard]] Mesh read_mesh(const std::filesystem::path& file);

/// Same as read_mesh, with each part and its texture separate.
[[nodiscard]] std::vector<Mesh> read_mesh_parts(const std::filesystem::path& file);

}  // namespace cairn
