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

/// An image that is drawn on a mesh, row by row from the top; sRGB.
struct Texture {
  int width = 0, height = 0;
  std::vector<std::array<std::uint8_t, 3>> texels;
};

/// Triangles in the map's world frame (z forward of the first camera, y down, or the frame of the given poses).
/// All that goes by vertex is empty or of the size of `positions`. Triangles are counter-clockwise seen from outside.
struct Mesh {
  std::vector<Eigen::Vector3f> positions;            ///< metres
  std::vector<Eigen::Vector3f> normals;              ///< unit length, away from the solid
  std::vector<std::array<std::uint8_t, 4>> colours;  ///< R, G, B, 255 (sRGB)
  std::vector<float> weights;                        ///< observations at 1 m; only of a map's own mesh, never in a file
  std::vector<float> sigmas;                         ///< metres; see SurfaceSigma::at_each; of adjusted maps alone
  std::vector<Eigen::Vector2f> texture_coordinates;  ///< 0, 0 is the texture's upper left corner, 1, 1 its lower right
  std::vector<std::array<std::uint32_t, 3>> triangles;
  Texture texture;
};

/// The axes of what is written. The world has x to the right, y down and z forward.
enum class Axes : std::uint8_t {
  automatic,  ///< as programs expect them of a format: y_up for glTF and OBJ, z_up for STL and 3D Tiles, else the world
  world,
  y_up,  ///< (x, -y, -z): forward is -z
  z_up   ///< (x, z, -y): forward is y
};
/// `world`, `yup` or `zup`: as files tell their axes.
[[nodiscard]] std::string_view name_of(Axes axes);

/// Writes by extension: .glb, .gltf (with .bin and texture beside it), .ply (binary), .obj (with .mtl and texture) or
/// .stl (binary, neither colours nor texture). The axes are Axes::automatic, and glTF (in `asset.extras`), PLY and OBJ
/// (in a comment) tell them; PLY has no texture. Sigmas go into glTF and PLY. Whole or not at all. Throws
/// std::runtime_error for an unknown extension or an unwritable place.
void write_mesh(const std::filesystem::path& file, const Mesh& mesh);

/// Reads .glb, .gltf (also with KHR_mesh_quantization, EXT_meshopt_compression and KHR_draco_mesh_compression) and .ply
/// that write_mesh or others wrote, back in the world frame. A mesh of several parts becomes one, without texture.
[[nodiscard]] Mesh read_mesh(const std::filesystem::path& file);

/// The same, part by part, each with its own texture.
[[nodiscard]] std::vector<Mesh> read_mesh_parts(const std::filesystem::path& file);

}  // namespace cairn
