// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "base/file_name.hpp"
#include "base/json_text.hpp"
#include "base/quoted.hpp"
#include "base/read_json.hpp"
#include "base/read_whole.hpp"
#include "cairn/mapping/map.hpp"
#include "cairn/mapping/mesh.hpp"
#include "cairn/mapping/splats.hpp"
#include "mesh/gltf.hpp"
#include "net/file_below.hpp"
#include "view/downloads.hpp"
#include "view/fields.hpp"
#include "view/finished_map.hpp"
#include "view/first_mesh.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Files = std::map<std::string, Served>;

std::string glb_of(const std::vector<Mesh>& parts) {
  GltfWriter writer;
  for (const Mesh& part : parts) writer.add("mesh", part);
  std::ostringstream out;
  writer.put(out);
  return std::move(out).str();
}

Served glb(const std::vector<Mesh>& parts) {
  return {.content_type = content_type_of("mesh.glb"), .body = glb_of(parts)};
}

constexpr std::uintmax_t kMaxShownAtOnce = 6 << 20, kMaxCoarsened = 256 << 20;  // bytes of a .glb
constexpr std::size_t kMaxGltfBytes = std::size_t{1} << 30;                     // bytes of a .gltf without its buffers

/// A list of a glTF, with the allowed extensions of referenced files.
struct Resources {
  const char* list;
  std::initializer_list<const char*> extensions;
};
const Resources kResources[] = {{"buffers", {".bin"}}, {"images", {".png", ".jpg", ".jpeg", ".webp", ".ktx2"}}};

/// External files of a glTF by "uri", without "data:" and absolute URIs.
std::vector<std::string> uris_in(const Json& gltf, const char* list) {
  std::vector<std::string> uris;
  const auto found = gltf.find(list);
  if (found == gltf.end() || !found->is_array()) return uris;
  for (const Json& item : *found)
    if (item.is_object() && item.contains("uri") && item["uri"].is_string())
      if (std::string uri = item["uri"]; uri.find(':') == uri.npos) uris.push_back(std::move(uri));
  return uris;
}

/// Adds a .gltf with its buffers and images in the same folder or below.
void add_gltf(const fs::path& file, Files& files) {
  const fs::path folder = file.parent_path();
  const Json json = parsed_json_or_none(FileBelow(folder, file.filename()).read(kMaxGltfBytes));
  if (!json.is_object()) throw std::runtime_error(file.string() + ": is damaged, or not a glTF file");
  files["mesh.gltf"] = {.content_type = content_type_of(file), .body = file};
  for (const auto& [list, extensions] : kResources)
    for (const std::string& uri : uris_in(json, list)) {
      const fs::path name = fs::path(from_uri(uri)).lexically_normal();
      const std::string extension = extension_of(name);
      if (std::find(extensions.begin(), extensions.end(), extension) == extensions.end())
        spdlog::warn(fmt::format("view: {} refers to {}, which is not shown: the supported formats of {} are {}",
                                 file.string(), as_utf8(uri), list, fmt::join(extensions, ", ")));
      else if (is_below(folder, name))
        files[uri] = {.content_type = content_type_of(name), .body = folder / name, .root = folder};
    }
}

[[noreturn]] void refuse(const fs::path& file) {
  const std::string extension = extension_of(file);
  const bool is_written = extension == ".obj" || extension == ".stl";  // formats written by cairn export
  throw std::runtime_error(
      file.string() + ": '" + file.extension().string() + "' cannot be shown; " +
      (is_written ? "write the same map as .glb and view that: cairn export MAP -o " +
                        quoted(fs::path(file).replace_extension(".glb"))
                  : std::string("give an output folder of cairn, a .glb, .gltf, .ply, .spz, .vdb or a tileset.json")));
}

}  // namespace

Files served_file(const fs::path& given) {
  if (!fs::is_regular_file(given)) throw std::runtime_error(given.string() + ": there is no such file or folder");
  const fs::path file = fs::canonical(given);  // the user may give a link
  const std::string extension = extension_of(given);
  Files files;
  Json data{{"mode", "finished"},
            {"name", given.filename().string()},
            {"report", nullptr},
            {"trajectory", Json::array()},
            {"mesh", extension == ".gltf" ? "mesh.gltf" : "mesh.glb"}};
  if (has_splats(file)) {
    data.erase("mesh");
    data["splats"] = "splats.spz";
    files["splats.spz"] = served_splats(file);
  } else if (extension == ".glb") {
    const std::uintmax_t bytes = fs::file_size(file);
    files["mesh.glb"] = {.content_type = content_type_of("mesh.glb"), .body = file};
    data["mesh_bytes"] = bytes;
    if (bytes > kMaxShownAtOnce && bytes <= kMaxCoarsened) {
      data["first"] = kFirstMesh;
      files[kFirstMesh] = served_first_mesh(file);
    }
  } else if (extension == ".gltf") {
    add_gltf(file, files);
  } else if (extension == ".vdb") {
    files["mesh.glb"] = glb({Map::open(file).mesh()});
    data["fields"] = "fields.bin";
    files["fields.bin"] = {
        .content_type = content_type_of("fields.bin"),
        .body = once([file]() -> Content { return std::make_shared<const Text>(bytes_of(make_fields(file, {}, {}))); }),
        .is_packable = true};
  } else if (extension == ".ply") {
    files["mesh.glb"] = glb(read_mesh_parts(file));
  } else {
    refuse(given);
  }
  std::error_code error;
  const Download own{given.filename().string(), "the file itself", fs::file_size(file, error)};
  const std::string url = "files/file" + extension;
  data["files"] = {{{"name", own.name}, {"url", url}, {"what", own.what}, {"bytes", *own.bytes}}};
  files[url] = {.content_type = content_type_of(given), .body = file, .download = own.name};
  files["data.json"] = {.content_type = content_type_of("data.json"), .body = text_of(data)};
  return files;
}

}  // namespace cairn
