// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/served_tileset.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>
#include <vector>

#include "base/json_text.hpp"
#include "base/read_json.hpp"
#include "base/read_whole.hpp"
#include "cairn/file_name.hpp"
#include "cairn/quoted.hpp"
#include "view/downloads.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Files = std::map<std::string, Served>;

constexpr const char* kBelow = "tileset/";  // the folder's name in the page's addresses

struct Home {
  fs::path folder;  // canonical
  AddFiles add;
};

Json read_tileset(const fs::path& file) {
  try {
    const auto bytes = read_whole(file);
    Json json = parsed_json(bytes);
    if (json.at("root").is_object()) return json;
    throw std::runtime_error("it has no root");
  } catch (const std::exception& error) {
    throw std::runtime_error(file.string() + ": is no tileset: " + plain(error.what()));
  }
}

/// The addresses of all contents in a tileset.
std::vector<std::string> contents(const Json& tileset) {
  std::vector<std::string> uris;
  const auto note = [&](const Json& content) {
    if (content.is_object() && content.contains("uri") && content["uri"].is_string()) uris.push_back(content["uri"]);
  };
  std::vector<const Json*> waiting{&tileset.at("root")};
  while (!waiting.empty()) {
    const Json& tile = *waiting.back();
    waiting.pop_back();
    if (!tile.is_object()) continue;
    if (const auto content = tile.find("content"); content != tile.end()) note(*content);
    if (const auto several = tile.find("contents"); several != tile.end())
      for (const Json& content : *several) note(content);
    if (const auto children = tile.find("children"); children != tile.end())
      for (const Json& child : *children) waiting.push_back(&child);
  }
  return uris;
}

/// A file of the folder, or nothing for what is none, and for what lies elsewhere, also by a link.
std::optional<fs::path> inside(const Home& home, const std::string& name) {
  const std::string path = from_uri(name);
  if (path.find('\0') != path.npos) return std::nullopt;
  const fs::path file = fs::weakly_canonical(home.folder / path);
  const fs::path seen = file.lexically_relative(home.folder);
  if (seen.empty() || *seen.begin() == ".." || !fs::is_regular_file(file)) return std::nullopt;
  return file;
}

Served tileset_file(const std::shared_ptr<const Home>& home, const std::string& name, const fs::path& file);

/// What a tileset, `name`, refers to, by their names in the page's addresses.
Files referred(const std::shared_ptr<const Home>& home, const std::string& name, const Json& tileset) {
  Files files;
  for (const std::string& uri : contents(tileset)) {
    if (uri.find(':') != uri.npos) continue;  // somewhere else in the net
    const std::string other =
        (fs::path(name).parent_path() / uri.substr(0, uri.find_first_of("?#"))).lexically_normal().generic_string();
    const auto file = inside(*home, other);
    const std::string extension = file ? extension_of(*file) : std::string();
    if (extension != ".json" && extension != ".glb")
      spdlog::warn(fmt::format("view: {} refers to {}, which is not shown: only .glb and .json in {} and below are",
                               name, as_utf8(uri), home->folder.string()));
    else if (extension == ".json")
      files[kBelow + other] = tileset_file(home, other, *file);
    else
      files[kBelow + other] = {.content_type = content_type_of(*file), .body = *file};
  }
  return files;
}

Served tileset_file(const std::shared_ptr<const Home>& home, const std::string& name, const fs::path& file) {
  const auto read = [home, name, file]() -> Content {
    const Json tileset = read_tileset(file);
    home->add(referred(home, name, tileset));
    return std::make_shared<const Text>(text_of(tileset));
  };
  return {.content_type = content_type_of(file), .body = Make{.make = read}, .is_packable = true};
}

}  // namespace

std::optional<fs::path> tileset_of(const fs::path& map) {
  if (!fs::is_directory(map)) return extension_of(map) == ".json" ? std::optional(map) : std::nullopt;
  if (!fs::exists(map / "plan.json")) return std::nullopt;
  if (fs::exists(map / "tileset.json")) return map / "tileset.json";
  throw std::runtime_error(
      fmt::format("{}: is a plan without tileset.json: make it with cairn tile {}, for each cell, and "
                  "cairn tileset {} -o {}",
                  map.string(), quoted(map), quoted(map), quoted(map / "tileset.json")));
}

Files served_tileset(const fs::path& tileset, AddFiles add) {
  const fs::path file = fs::canonical(tileset);
  (void)read_tileset(file);
  const auto home = std::make_shared<const Home>(Home{file.parent_path(), std::move(add)});
  const std::string name = as_uri(file.filename().string());
  const bool is_plan = fs::exists(home->folder / "plan.json");
  const Json data{{"mode", "finished"},
                  {"name", (is_plan ? home->folder : file).filename().string()},
                  {"report", nullptr},
                  {"trajectory", Json::array()},
                  {"tileset", kBelow + name}};
  Files files;
  files[kBelow + name] = tileset_file(home, name, file);
  files["data.json"] = {.content_type = content_type_of("data.json"), .body = text_of(data)};
  return files;
}

}  // namespace cairn
