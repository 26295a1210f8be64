// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <algorithm>
#include <fstream>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "base/json_text.hpp"
#include "base/read_json.hpp"
#include "base/read_whole.hpp"
#include "cairn/file_name.hpp"
#include "cairn/map.hpp"
#include "cairn/mesh.hpp"
#include "cairn/quoted.hpp"
#include "mesh/gltf.hpp"
#include "view/downloads.hpp"
#include "view/fields.hpp"
#include "view/finished_map.hpp"

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

/// Whether a name that a file tells is one of a file beside it.
bool is_beside(const std::string& uri) {
  return !uri.empty() && uri.find(':') == uri.npos && uri[0] != '/' && uri[0] != '\\' && uri.find("..") == uri.npos &&
         uri.find('%') == uri.npos;
}

/// A .gltf and the buffers and images that it names beside it.
void add_gltf(const fs::path& file, Files& files) {
  const auto bytes = read_whole(file);
  const Json json = parsed_json_or_none({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  if (!json.is_object()) throw std::runtime_error(file.string() + ": is damaged, or no glTF");
  files["mesh.gltf"] = {.content_type = content_type_of(file), .body = file};
  for (const char* list : {"buffers", "images"}) {
    const auto found = json.find(list);
    if (found == json.end() || !found->is_array()) continue;
    for (const Json& item : *found)
      if (item.is_object() && item.contains("uri") && item["uri"].is_string())
        if (const std::string uri = item["uri"]; is_beside(uri))
          files[uri] = {.content_type = content_type_of(uri), .body = file.parent_path() / uri};
  }
}

[[noreturn]] void refuse(const fs::path& file) {
  const std::string extension = extension_of(file);
  const bool is_written = extension == ".obj" || extension == ".stl";  // by cairn export
  throw std::runtime_error(
      file.string() + ": '" + file.extension().string() + "' cannot be shown; " +
      (is_written ? "write the same map as .glb and view that: cairn export MAP -o " +
                        quoted(fs::path(file).replace_extension(".glb"))
                  : std::string("give a folder that cairn has made, a .glb, .gltf, .ply, .vdb or a tileset.json")));
}

}  // namespace

Files served_file(const fs::path& file) {
  const std::string extension = extension_of(file);
  Files files;
  Json data{{"mode", "finished"},
            {"name", file.filename().string()},
            {"report", nullptr},
            {"trajectory", Json::array()},
            {"mesh", extension == ".gltf" ? "mesh.gltf" : "mesh.glb"}};
  if (!fs::is_regular_file(file)) throw std::runtime_error(file.string() + ": there is no such file or folder");
  if (extension == ".glb") {
    files["mesh.glb"] = {.content_type = content_type_of("mesh.glb"), .body = file};
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
    refuse(file);
  }
  std::error_code error;
  const Download own{file.filename().string(), "the file itself", fs::file_size(file, error)};
  const std::string url = "files/" + fs::path("file").replace_extension(file.extension()).string();
  data["files"] = {{{"name", own.name}, {"url", url}, {"what", own.what}, {"bytes", *own.bytes}}};
  files[url] = {.content_type = content_type_of(file), .body = file, .download = own.name};
  files["data.json"] = {.content_type = content_type_of("data.json"), .body = text_of(data)};
  return files;
}

}  // namespace cairn
