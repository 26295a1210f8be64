// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>

#include "base/file_name.hpp"
#include "export/check_range.hpp"
#include "export/export_run.hpp"

namespace cairn {

namespace {

struct Named {
  std::string_view name;
  AllowedRange range;
};
constexpr double kMinHeight = -12000, kMaxHeight = 1e6;  // meters
constexpr Named kRanges[] = {
    {"SplatOptions::iterations", {0, 1e7}},
    {"SplatOptions::max_seconds", {0, 1e6}},
    {"SplatOptions::resolution", {0.05, 1}},
    {"SplatOptions::max_splats", {1000, 1e7}},
    {"SplatOptions::degree", {0, 3}},
    {"SplatOptions::images", {1, 1e6}},
    {"SplatOptions::hold_out", {0, 1e6}},
    {"ViewsOptions::images", {0, 1e6}},
    {"ViewsOptions::point_spacing", {0.001, 10}},
    {"SimplifyOptions::ratio", {0.0001, 1}},
    {"SimplifyOptions::triangles", {100, 4e9}},  // a room needs at least 100; indices have 32 bits
    {"SimplifyOptions::max_error", {0, 1}},
    {"CleanOptions::min_component", {0, 10}},
    {"CleanOptions::min_weight", {0, 255}},
    {"CleanOptions::fill_holes", {0, 2}},
    {"TextureOptions::texel", {0, 1}},
    {"TextureOptions::max_size", {64, 16384}},
    {"TextureOptions::jpeg_quality", {1, 100}},
    {"ExportOptions::cell_size", {0, 1000}},
    {"ExportOptions::point_spacing", {0, 10}},
    {"ExportOptions::levels", {1, 8}},
    {"ExportOptions::geo: the latitude", {-90, 90}},
    {"ExportOptions::geo: the longitude", {-180, 180}},
    {"ExportOptions::geo: the height", {kMinHeight, kMaxHeight}},
    {"ExportOptions::geo: the heading", {-360, 360}},
    {"PlanOptions::height", {0.3, 3}},
    {"PlanOptions::scale", {0, 5000}},
    {"ChangeOptions::distance", {0, 1.6}},
    {"ChangeOptions::min_area", {0, 10000}},
};

}  // namespace

AllowedRange export_range_of(std::string_view option) {
  const auto* found =
      std::find_if(std::begin(kRanges), std::end(kRanges), [&](const Named& n) { return n.name == option; });
  if (found == std::end(kRanges)) throw std::logic_error("there is no option " + std::string(option));
  return found->range;
}

void check(const ViewsOptions& o) {
  check_range("ViewsOptions::images", o.images);
  check_range("ViewsOptions::point_spacing", o.point_spacing);
}

void check(const ExportOptions& o, const std::filesystem::path& file) {
  const std::string extension = extension_of(file);
  if (extension != ".glb" && extension != ".gltf" && extension != ".ply" && extension != ".obj" &&
      extension != ".stl" && extension != ".usdz" && extension != ".las" && extension != ".json")
    throw std::runtime_error(
        fmt::format("{}: '{}' is not a supported output format; use .glb, .gltf, .ply, .obj, .stl, .usdz, "
                    ".las, or tileset.json for 3D Tiles",
                    file.string(), file.extension().string()));
  check_range("SimplifyOptions::ratio", o.simplify.ratio);
  if (o.simplify.triangles > 0) {
    check_range("SimplifyOptions::triangles", o.simplify.triangles);
    if (o.simplify.ratio != 1)
      throw std::runtime_error("SimplifyOptions::triangles and SimplifyOptions::ratio exclude each other: give one");
    if (o.simplify.max_error != 0)
      throw std::runtime_error(
          "SimplifyOptions::triangles and SimplifyOptions::max_error exclude each other: give one");
  }
  check_range("SimplifyOptions::max_error", o.simplify.max_error);
  check_range("CleanOptions::min_component", o.clean.min_component);
  check_range("CleanOptions::min_weight", o.clean.min_weight);
  check_range("CleanOptions::fill_holes", o.clean.fill_holes);
  check_range("TextureOptions::texel", o.texture.texel);
  check_range("TextureOptions::max_size", o.texture.max_size);
  check_range("TextureOptions::jpeg_quality", o.texture.jpeg_quality);
  check_range("ExportOptions::cell_size", o.cell_size);
  check_range("ExportOptions::point_spacing", o.point_spacing);
  check_range("ExportOptions::levels", o.levels);
  const auto refuse = [&](const char* what, const char* why) {
    throw std::runtime_error(fmt::format("{}: {} {}", file.string(), what, why));
  };
  if (o.texture.enabled && (extension == ".ply" || extension == ".stl" || extension == ".las"))
    refuse("TextureOptions::enabled",
           "needs .glb, .gltf, .obj, .usdz or tileset.json: PLY, STL and LAS have no textures");
  if (o.point_spacing > 0 && extension != ".ply" && extension != ".las")
    refuse("ExportOptions::point_spacing", "needs .ply or .las");
  if (o.point_spacing <= 0 && extension == ".las") refuse("ExportOptions::point_spacing", "is missing for .las");
  if (extension == ".usdz" && o.axes != Axes::automatic && o.axes != Axes::y_up)
    refuse("ExportOptions::axes", "must be yup for USDZ");
  if (o.compression != Compression::none && extension != ".glb" && extension != ".gltf" && extension != ".json")
    refuse("ExportOptions::compression", "needs .glb, .gltf or tileset.json");
  if (o.cameras && !is_gltf(file)) refuse("ExportOptions::cameras", "needs .glb or .gltf");
  if (o.lit && extension != ".glb" && extension != ".gltf" && extension != ".json")
    refuse("ExportOptions::lit", "needs .glb, .gltf or tileset.json");
  if (o.geo) {
    if (!is_tileset(file)) refuse("ExportOptions::geo", "needs tileset.json");
    check_range("ExportOptions::geo: the latitude", o.geo->latitude);
    check_range("ExportOptions::geo: the longitude", o.geo->longitude);
    check_range("ExportOptions::geo: the height", o.geo->height);
    check_range("ExportOptions::geo: the heading", o.geo->heading);
  }
  if (is_tileset(file) && o.axes != Axes::automatic && o.axes != Axes::z_up)
    refuse("ExportOptions::axes", "must be zup for 3D Tiles");
  if (o.levels > 1 && (is_tileset(file) || o.point_spacing > 0))
    refuse("ExportOptions::levels", "needs a single mesh file: tiles have levels anyway");
}

}  // namespace cairn
