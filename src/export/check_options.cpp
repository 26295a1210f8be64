// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <stdexcept>

#include "cairn/file_name.hpp"
#include "export/export_run.hpp"

namespace cairn {

namespace {

constexpr double kLeastTriangles = 100;  // of a room: fewer are no shape of it
constexpr double kMostTriangles = 4e9;   // as an index of 32 bits counts them

void range(const char* name, double value, double low, double high) {
  if (!(value >= low && value <= high))
    throw std::runtime_error(fmt::format("{} is {}: it must be between {} and {}", name, value, low, high));
}

}  // namespace

void check(const ViewsOptions& o) {
  range("ViewsOptions::images", o.images, 0, 1e6);
  range("ViewsOptions::point_spacing", static_cast<double>(o.point_spacing), 0.001, 10);
}

void check(const ExportOptions& o, const std::filesystem::path& file) {
  const std::string extension = extension_of(file);
  if (extension != ".glb" && extension != ".gltf" && extension != ".ply" && extension != ".obj" &&
      extension != ".stl" && extension != ".json")
    throw std::runtime_error(
        fmt::format("{}: '{}' is no format that is written; use .glb, .gltf, .ply, .obj, .stl, or "
                    "tileset.json for 3D Tiles",
                    file.string(), file.extension().string()));
  range("SimplifyOptions::ratio", static_cast<double>(o.simplify.ratio), 0.0001, 1);
  if (o.simplify.triangles > 0) {
    range("SimplifyOptions::triangles", static_cast<double>(o.simplify.triangles), kLeastTriangles, kMostTriangles);
    if (o.simplify.ratio != 1)
      throw std::runtime_error("SimplifyOptions::triangles and SimplifyOptions::ratio exclude each other: give one");
    if (o.simplify.max_error != 0)
      throw std::runtime_error(
          "SimplifyOptions::triangles and SimplifyOptions::max_error exclude each other: give one");
  }
  range("SimplifyOptions::max_error", static_cast<double>(o.simplify.max_error), 0, 1);
  range("CleanOptions::min_piece", static_cast<double>(o.clean.min_piece), 0, 10);
  range("CleanOptions::min_weight", static_cast<double>(o.clean.min_weight), 0, 255);
  range("CleanOptions::fill_holes", static_cast<double>(o.clean.fill_holes), 0, 2);
  range("TextureOptions::texel", static_cast<double>(o.texture.texel), 0, 1);
  range("TextureOptions::max_size", o.texture.max_size, 64, 16384);
  range("TextureOptions::jpeg_quality", o.texture.jpeg_quality, 1, 100);
  range("ExportOptions::cell_size", static_cast<double>(o.cell_size), 0, 1000);
  range("ExportOptions::point_spacing", static_cast<double>(o.point_spacing), 0, 10);
  range("ExportOptions::levels", o.levels, 1, 8);
  const auto refuse = [&](const char* what, const char* why) {
    throw std::runtime_error(fmt::format("{}: {} {}", file.string(), what, why));
  };
  if (o.texture.enabled && (extension == ".ply" || extension == ".stl"))
    refuse("TextureOptions::enabled", "needs .glb, .gltf, .obj or tileset.json: PLY and STL have none");
  if (o.point_spacing > 0 && extension != ".ply") refuse("ExportOptions::point_spacing", "needs .ply");
  if (o.compression != Compression::none && extension != ".glb" && extension != ".gltf" && extension != ".json")
    refuse("ExportOptions::compression", "needs .glb, .gltf or tileset.json");
  if (o.cameras && !is_gltf(file)) refuse("ExportOptions::cameras", "needs .glb or .gltf");
  if (o.lit && extension != ".glb" && extension != ".gltf" && extension != ".json")
    refuse("ExportOptions::lit", "needs .glb, .gltf or tileset.json");
  if (o.geo) {
    if (!is_tileset(file)) refuse("ExportOptions::geo", "needs tileset.json");
    constexpr double kDeepest = -12000, kHighest = 1e6;  // metres
    range("ExportOptions::geo: the latitude", o.geo->latitude, -90, 90);
    range("ExportOptions::geo: the longitude", o.geo->longitude, -180, 180);
    range("ExportOptions::geo: the height", o.geo->height, kDeepest, kHighest);
    range("ExportOptions::geo: the heading", o.geo->heading, -360, 360);
  }
  if (is_tileset(file) && o.axes != Axes::automatic && o.axes != Axes::z_up)
    refuse("ExportOptions::axes", "is zup for 3D Tiles, which have no other");
  if (o.levels > 1 && (is_tileset(file) || o.point_spacing > 0))
    refuse("ExportOptions::levels", "needs a single mesh file: tiles have levels anyway");
}

}  // namespace cairn
