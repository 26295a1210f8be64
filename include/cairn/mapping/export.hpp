// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "cairn/mapping/export_options.hpp"

namespace cairn {

/// Throws std::runtime_error naming the option, its value and the allowed range, or the feature unsupported by the
/// format of `file`.
void check(const ExportOptions& options, const std::filesystem::path& file);

/// Statistics of an export.
struct ExportReport {
  std::size_t full_triangles = 0;  ///< triangles of the map before cleaning and simplification
  std::size_t triangles = 0, vertices = 0, points = 0;
  std::size_t components_removed = 0, holes_filled = 0;
  float error = 0;                           ///< meters; largest surface deviation reported by simplification
  std::vector<std::filesystem::path> files;  ///< written files, the requested one first
  int parts = 0, textures = 0, charts = 0, tiles = 0;
  float texel = 0;  ///< meters; median texel, of the coarsest texture
  std::size_t texels = 0;
  double textured_share = 0;  ///< fraction of texels seen by a keyframe; the rest have voxel colors
  int keyframes = 0;
  std::map<std::string, double> stage_ms;  ///< mesh, clean, simplify, charts, texture, write
};

/// Throws std::runtime_error naming the option, its value and the allowed range.
void check(const ViewsOptions& options);

struct ExportViewsReport {
  int images = 0, keyframes = 0;  ///< written images; keyframes of the map
  std::size_t points = 0;
};

/// Progress callback after each step: about `done` of `count` equal parts of the time have passed; `what` names the
/// next step. `done` never decreases and ends at `count`.
using ExportProgress = std::function<void(int done, int count, const std::string& what)>;

}  // namespace cairn
