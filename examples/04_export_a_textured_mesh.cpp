// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Exports an existing map as a small textured mesh for a web page or Blender.
// Usage: 04_export_a_textured_mesh MAP [FILE]: a folder made by reconstruct; FILE: .glb, .gltf, .obj, .ply
#include <cairn/mapping/map.hpp>
#include <cstdio>
#include <exception>

int main(int argc, char** argv) try {
  if (argc < 2) {
    std::fprintf(stderr, "usage: %s MAP [FILE]\n", argv[0]);
    return 2;
  }
  cairn::Map map = cairn::Map::open(argv[1]);
  cairn::ExportOptions options;
  options.simplify.ratio = 0.1f;
  options.texture.enabled = true;
  options.compression = cairn::Compression::meshopt;
  const char* file = argc > 2 ? argv[2] : "textured.glb";
  const cairn::ExportReport done = map.export_mesh(file, options, [](int step, int steps, const std::string& name) {
    std::printf("%d %%: %s\n", 100 * step / steps, name.c_str());
  });
  std::printf("%s: %zu of %zu triangles, texels of %.1f mm\n", file, done.triangles, done.full_triangles,
              1e3 * static_cast<double>(done.texel));
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
