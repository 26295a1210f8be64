// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/downloads.hpp"

#include <algorithm>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "base/file_name.hpp"
#include "cairn/mapping/mesh.hpp"
#include "mesh/colored_parts.hpp"
#include "mesh/formats.hpp"
#include "mesh/points.hpp"
#include "mesh/topology.hpp"
#include "net/file_below.hpp"
#include "view/temporary_place.hpp"
#include "view/zip_folder.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr float kPointSpacing = 0.01f;  // meters
constexpr const char *kPly = "mesh.ply", *kObj = "mesh-obj.zip", *kPoints = "points.ply";

void write_points(const fs::path& mesh, const fs::path& file) {
  SurfacePoints points(kPointSpacing);
  for (const Mesh& part : colored_parts(mesh)) points.add(part);
  write_ply(file, points.points());
}

/// Zips the mesh as OBJ with its material and textures.
void write_obj_zip(const fs::path& mesh, const fs::path& file) {
  const TemporaryPlace place;
  write_obj(place.path() / "mesh.obj", read_mesh_parts(mesh));
  zip_folder(place.path(), file);
}

}  // namespace

std::string content_type_of(const fs::path& name) {
  const std::string extension = extension_of(name);
  for (const auto& [end, type] :
       std::initializer_list<std::pair<const char*, const char*>>{{".glb", "model/gltf-binary"},
                                                                  {".gltf", "model/gltf+json"},
                                                                  {".json", "application/json"},
                                                                  {".html", "text/html; charset=utf-8"},
                                                                  {".txt", "text/plain; charset=utf-8"},
                                                                  {".g2o", "text/plain; charset=utf-8"},
                                                                  {".svg", "image/svg+xml"},
                                                                  {".jpg", "image/jpeg"},
                                                                  {".jpeg", "image/jpeg"},
                                                                  {".webp", "image/webp"},
                                                                  {".ktx2", "image/ktx2"},
                                                                  {".png", "image/png"},
                                                                  {".zip", "application/zip"}})
    if (extension == end) return type;
  return "application/octet-stream";
}

std::vector<Download> finished_files(const fs::path& folder, bool is_textured) {
  const std::pair<const char*, const char*> kFiles[] = {
      {"mesh.glb", is_textured ? "textured mesh, for Blender and viewers" : "mesh, for Blender and viewers"},
      {"preview.glb", "smaller mesh, for web pages"},
      {"map.vdb", "distances, observations and colors, for OpenVDB and cairn"},
      {"splats.spz", "Gaussian splats, for viewers of splats"},
      {"splats.ply", "Gaussian splats, without quantization"},
      {"trajectory.txt", "the camera's path, in the TUM format"},
      {"graph.g2o", "keyframes and loops, for pose graph programs"},
      {"graph.svg", "a drawing of the path from above"},
      {"report.json", "all numbers of the run"},
      {"report.html", "this page in one file"}};
  std::vector<Download> files;
  for (const auto& [name, what] : kFiles) {
    std::error_code error;
    if (!is_below(folder, name)) continue;
    if (const std::uintmax_t bytes = fs::file_size(folder / name, error); !error) files.push_back({name, what, bytes});
  }
  return files;
}

struct MadeDownloads::State {
  fs::path mesh;
  std::optional<TemporaryPlace> place;  // owned by the converting thread
};

MadeDownloads::MadeDownloads(fs::path mesh) : state_(std::make_shared<State>()) { state_->mesh = std::move(mesh); }

std::vector<Download> MadeDownloads::list() const {
  return {{kPly, "mesh with colors, for MeshLab and CloudCompare", {}},
          {kObj, "mesh as Wavefront OBJ with its texture", {}},
          {kPoints, "points 1 cm apart", {}}};
}

Served MadeDownloads::served(const std::string& name) const {
  const auto write = [state = state_, name](const fs::path& file) {
    if (name == kPly) return write_ply(file, joined(colored_parts(state->mesh)));
    if (name == kObj) return write_obj_zip(state->mesh, file);
    if (name == kPoints) return write_points(state->mesh, file);
    throw std::logic_error(name + ": is not offered");
  };
  const auto make = [state = state_, name, write]() -> Content {
    if (!state->place) state->place.emplace();
    const fs::path file = state->place->path() / name;
    write(file);
    return file;
  };
  return {.content_type = content_type_of(name), .body = once(make, true), .download = name};
}

}  // namespace cairn
