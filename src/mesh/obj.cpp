// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Wavefront OBJ. Vertex colors follow the position, the convention of MeshLab and Blender.
#include <fmt/format.h>

#include <iterator>

#include "base/atomic_file.hpp"
#include "geometry/axes.hpp"
#include "mesh/formats.hpp"

namespace cairn {

std::vector<std::filesystem::path> write_obj(const std::filesystem::path& file, const std::vector<Mesh>& parts,
                                             const ObjOptions& options) {
  std::vector<std::filesystem::path> written{file};
  const std::string stem = file.stem().string();
  std::string materials, text;
  auto out = std::back_inserter(text);
  const Axes axes = resolved(options.axes, Axes::y_up);
  fmt::format_to(out, "# cairn, metres, {}\n", described(axes));
  bool has_textures = false;
  for (const Mesh& part : parts) has_textures = has_textures || !part.texture_coordinates.empty();
  if (has_textures) fmt::format_to(out, "mtllib {}.mtl\n", stem);
  std::size_t first = 1, first_texture_coordinate = 1, first_normal = 1;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const Mesh& mesh = parts[i];
    const bool is_textured = !mesh.texture_coordinates.empty(), has_normals = !mesh.normals.empty();
    fmt::format_to(out, "o part-{}\n", i);
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
      const Eigen::Vector3f p = from_world(mesh.positions[v], axes);
      fmt::format_to(out, "v {} {} {}", p.x(), p.y(), p.z());
      if (!mesh.colors.empty() && !is_textured)
        fmt::format_to(out, " {:.4f} {:.4f} {:.4f}", mesh.colors[v][0] / 255.0, mesh.colors[v][1] / 255.0,
                       mesh.colors[v][2] / 255.0);
      text += '\n';
    }
    for (const auto& p : mesh.texture_coordinates) fmt::format_to(out, "vt {:.6f} {:.6f}\n", p.x(), 1 - p.y());
    for (const auto& normal : mesh.normals) {
      const Eigen::Vector3f n = from_world(normal, axes);
      fmt::format_to(out, "vn {:.4f} {:.4f} {:.4f}\n", n.x(), n.y(), n.z());
    }
    if (is_textured) {
      const std::string image = fmt::format("{}-{}.{}", stem, i, options.png ? "png" : "jpg");
      written.push_back(file.parent_path() / image);
      write_whole(written.back(), encode_image(mesh.texture, options.png, options.jpeg_quality));
      materials += fmt::format("newmtl surface-{}\nKd 1 1 1\nKs 0 0 0\nillum 0\nmap_Kd {}\n", i, image);
      fmt::format_to(out, "usemtl surface-{}\n", i);
    }
    for (const auto& t : mesh.triangles) {
      text += 'f';
      for (const std::uint32_t v : t) {
        fmt::format_to(out, " {}", first + v);
        if (is_textured) fmt::format_to(out, "/{}", first_texture_coordinate + v);
        if (has_normals) fmt::format_to(out, "{}{}", is_textured ? "/" : "//", first_normal + v);
      }
      text += '\n';
    }
    first += mesh.positions.size();
    first_texture_coordinate += mesh.texture_coordinates.size();
    first_normal += mesh.normals.size();
  }
  if (has_textures) {
    written.push_back(file.parent_path() / (stem + ".mtl"));
    write_whole(written.back(), materials);
  }
  write_whole(file, text);
  return written;
}

}  // namespace cairn
