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

#include "base/file_name.hpp"
#include "base/json_text.hpp"
#include "base/quoted.hpp"
#include "base/read_json.hpp"
#include "base/read_whole.hpp"
#include "cairn/building/project.hpp"
#include "cairn/eval/verdict.hpp"
#include "net/file_below.hpp"
#include "view/downloads.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Files = std::map<std::string, Served>;

constexpr const char* kUrlPrefix = "tileset/";  // folder name in the page's addresses

struct Home {
  fs::path folder;  // canonical
  AddFiles add;
};

constexpr std::size_t kMaxTilesetBytes = std::size_t{1} << 28;  // bytes

/// `name`: relative to the folder.
Json read_tileset(const fs::path& folder, const fs::path& name) {
  const std::string bytes = FileBelow(folder, name).read(kMaxTilesetBytes);
  try {
    Json json = parsed_json(bytes);
    if (json.at("root").is_object()) return json;
    throw std::runtime_error("it has no root");
  } catch (const std::exception& error) {
    throw std::runtime_error((folder / name).string() + ": is not a tileset: " + plain(error.what()));
  }
}

/// URIs of all contents in a tileset.
std::vector<std::string> contents(const Json& tileset) {
  std::vector<std::string> uris;
  const auto add_uri = [&](const Json& content) {
    if (content.is_object() && content.contains("uri") && content["uri"].is_string()) uris.push_back(content["uri"]);
  };
  std::vector<const Json*> waiting{&tileset.at("root")};
  while (!waiting.empty()) {
    const Json& tile = *waiting.back();
    waiting.pop_back();
    if (!tile.is_object()) continue;
    if (const auto content = tile.find("content"); content != tile.end()) add_uri(*content);
    if (const auto several = tile.find("contents"); several != tile.end())
      for (const Json& content : *several) add_uri(content);
    if (const auto children = tile.find("children"); children != tile.end())
      for (const Json& child : *children) waiting.push_back(&child);
  }
  return uris;
}

Served tileset_file(const std::shared_ptr<const Home>& home, const std::string& name);

/// Files referenced by the tileset `name`, keyed by their names in the page's addresses.
Files referred(const std::shared_ptr<const Home>& home, const std::string& name, const Json& tileset) {
  Files files;
  for (const std::string& uri : contents(tileset)) {
    if (uri.find(':') != uri.npos) continue;  // absolute URL
    const std::string other =
        (fs::path(name).parent_path() / uri.substr(0, uri.find_first_of("?#"))).lexically_normal().generic_string();
    const fs::path file = from_uri(other);
    const std::string extension = extension_of(file);
    if ((extension != ".json" && extension != ".glb") || !is_below(home->folder, file))
      spdlog::warn(fmt::format(
          "view: {} refers to {}, which is not shown: only .glb and .json files in {} and its subfolders are", name,
          as_utf8(uri), home->folder.string()));
    else if (extension == ".json")
      files[kUrlPrefix + other] = tileset_file(home, other);
    else
      files[kUrlPrefix + other] = {
          .content_type = content_type_of(file), .body = home->folder / file, .root = home->folder};
  }
  return files;
}

Served tileset_file(const std::shared_ptr<const Home>& home, const std::string& name) {
  const fs::path file = from_uri(name);
  const auto read = [home, name, file]() -> Content {
    const Json tileset = read_tileset(home->folder, file);
    home->add(referred(home, name, tileset));
    return std::make_shared<const Text>(text_of(tileset));
  };
  return {.content_type = content_type_of(file), .body = Make{.make = read}, .is_packable = true};
}

/// Verdict of a plan on its joined parts; null before the parts are joined.
Json verdict_in_json(const fs::path& plan) {
  const auto parts = merged_segments(plan);
  if (!parts) return nullptr;
  const Verdict verdict = verdict_of(read_plan(plan), *parts);
  return {{"level", to_string(verdict.level)}, {"words", verdict.words}, {"reasons", verdict.reasons}};
}

}  // namespace

std::optional<fs::path> tileset_of(const fs::path& map) {
  if (!fs::is_directory(map)) return extension_of(map) == ".json" ? std::optional(map) : std::nullopt;
  if (!fs::exists(map / "plan.json")) return std::nullopt;
  if (is_below(map, "tileset.json")) return map / "tileset.json";
  throw std::runtime_error(
      fmt::format("{}: is a plan without tileset.json: make it with cairn tile {}, for each cell, and "
                  "cairn tileset {} -o {}",
                  map.string(), quoted(map), quoted(map), quoted(map / "tileset.json")));
}

Files served_tileset(const fs::path& tileset, AddFiles add) {
  const fs::path file = fs::canonical(tileset);
  (void)read_tileset(file.parent_path(), file.filename());
  const auto home = std::make_shared<const Home>(Home{file.parent_path(), std::move(add)});
  const std::string name = as_uri(file.filename().string());
  const bool is_plan = fs::exists(home->folder / "plan.json");
  Json data{{"mode", "finished"},
            {"name", (is_plan ? home->folder : file).filename().string()},
            {"report", nullptr},
            {"trajectory", Json::array()},
            {"tileset", kUrlPrefix + name}};
  if (is_plan) data["verdict"] = verdict_in_json(home->folder);
  Files files;
  files[kUrlPrefix + name] = tileset_file(home, name);
  files["data.json"] = {.content_type = content_type_of("data.json"), .body = text_of(data)};
  return files;
}

}  // namespace cairn
