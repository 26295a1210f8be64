// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// One export on its way: what its steps share.
#pragma once
#include <algorithm>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>

#include "base/mesh_vertices.hpp"
#include "base/stopwatch.hpp"
#include "export/cells.hpp"
#include "export/export.hpp"
#include "mesh/gltf.hpp"

namespace cairn {

[[nodiscard]] inline bool is_gltf(const std::filesystem::path& file) {
  return file.extension() == ".glb" || file.extension() == ".gltf";
}
[[nodiscard]] inline bool is_tileset(const std::filesystem::path& file) { return file.extension() == ".json"; }

[[nodiscard]] inline std::runtime_error not_written(const std::filesystem::path& file, const std::string& why) {
  return std::runtime_error(file.string() + ": is not written, " + why);
}

struct ExportRun {
  const ExportInput& input;
  const std::filesystem::path& file;
  const ExportOptions& options;
  const ExportProgress& progress;
  Cells cells;
  Exported exported;
  int done = 0, count = 0;  // steps

  void step(const char* next) {
    if (progress) progress(std::min(++done, count), count, next);
  }
  template <class Work>
  decltype(auto) timed(const char* stage, const Work& work) {
    return cairn::timed(exported.stage_ms, stage, work);
  }
  void moved_by(float error) { exported.error = std::max(exported.error, error); }
  void add(const GltfWriter::Added& added) {
    exported.parts += added.triangles > 0;
    exported.triangles += added.triangles;
    exported.vertices += added.vertices;
  }
  /// `left`: triangles, points or tiles.
  void refuse_empty(std::size_t left) const {
    if (left == 0)
      throw not_written(file,
                        "nothing of the surface is left: it is empty, or CleanOptions::min_piece or "
                        "CleanOptions::min_weight removed all of it");
  }
  [[nodiscard]] GltfOptions gltf_options() const {
    return {.compression = options.compression,
            .png = options.texture.png,
            .jpeg_quality = options.texture.jpeg_quality,
            .source = options.source,
            .upright = input.upright};
  }
  /// A mesh of the map as it is written.
  [[nodiscard]] Mesh upright(Mesh mesh) const { return turned(std::move(mesh), input.upright.world_from_tracked); }
};

}  // namespace cairn
