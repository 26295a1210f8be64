// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/path_kind.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <vector>

#include "base/words.hpp"
#include "cairn/file_name.hpp"
#include "cairn/quoted.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using namespace std::string_view_literals;
using Kind = PathKind::Kind;

constexpr std::size_t kNamed = 3;  // maximum number of folder entries listed in a message
constexpr std::array kMeshes{".glb"sv, ".gltf"sv, ".ply"sv, ".obj"sv, ".stl"sv, ".drc"sv};
constexpr std::array kRecordings{".bag"sv, ".mcap"sv, ".db3"sv, ".oni"sv, ".mkv"sv, ".sens"sv, ".zip"sv, ".r3d"sv};
/// Files and folders found only in recordings.
constexpr std::array kOfRecordings{"depth.txt"sv,
                                   "associations.txt"sv,
                                   "rgb.mp4"sv,
                                   "transforms.json"sv,
                                   "depth"sv,
                                   "keyframes/cameras"sv,
                                   "results"sv,
                                   "metadata.yaml"sv,
                                   "intrinsics.json"sv,
                                   "depths"sv,
                                   "depth_raw"sv,
                                   "rtabmap_depth"sv,
                                   "frame-000000.depth.png"sv};
/// Image folders of recordings.
constexpr std::array kImages{"depth"sv,  "rgb"sv,    "color"sv,     "colour"sv,
                             "images"sv, "depths"sv, "depth_raw"sv, "confidence"sv};

template <class List>
bool holds(const List& list, std::string_view name) {
  return std::find(list.begin(), list.end(), name) != list.end();
}

bool there(const fs::path& path) {
  std::error_code ignored;
  return fs::exists(path, ignored);
}

PathKind kind_of_file(const fs::path& file) {
  const std::string name = quoted(file), extension = extension_of(file);
  if (file.filename() == "tileset.json")
    return {Kind::tiles, "is a set of tiles", fmt::format("`cairn view {}` shows it", name)};
  if (holds(kMeshes, extension)) return {Kind::mesh, "is a mesh", fmt::format("`cairn view {}` shows it", name)};
  if (extension == ".vdb")
    return {Kind::voxels, "is a map's voxels",
            fmt::format("`cairn view {0}` shows them, `cairn export {0} -o mesh.glb` makes a mesh", name)};
  if (holds(kRecordings, extension))
    return {Kind::recording, "is a recording", fmt::format("`cairn reconstruct {}` makes a map of it", name)};
  if (extension == ".txt" || extension == ".tum")
    return {Kind::trajectory, "is a text file, perhaps a trajectory",
            "`cairn evaluate trajectory` compares trajectories"};
  return {Kind::other,
          extension.empty() ? "is a file without an extension" : fmt::format("is a {} file", shown(extension)), ""};
}

PathKind kind_of_folder(const fs::path& folder) {
  const std::string name = quoted(folder);
  if (there(folder / "plan.json"))
    return {Kind::plan, "is a plan of several recordings",
            fmt::format("`cairn reconstruct` of each folder in {1} makes its maps, then `cairn tile {0}` its tiles",
                        name, quoted(folder / "parts"))};
  if (there(folder / "part.json"))
    return {Kind::part, "is a part of a plan", fmt::format("`cairn reconstruct {}` makes its map", name)};
  if (there(folder / "session" / "state.cbor") || (there(folder / "report.json") && there(folder / "trajectory.txt")))
    return {Kind::map, "is a map that cairn has made",
            fmt::format("`cairn view {0}` shows it, `cairn info {0}` says how good it is", name)};
  if (there(folder / "state.cbor"))
    return {Kind::map, "is the session of a map", fmt::format("give {}", quoted((folder / "..").lexically_normal()))};
  if (there(folder / "tileset.json"))
    return {Kind::tiles, "is a folder of tiles",
            fmt::format("`cairn view {}` shows it", quoted(folder / "tileset.json"))};
  if (std::any_of(kOfRecordings.begin(), kOfRecordings.end(), [&](auto of) { return there(folder / of); }))
    return {Kind::recording, "is a recording", fmt::format("`cairn reconstruct {}` makes a map of it", name)};
  const fs::path whole = fs::absolute(folder).lexically_normal(),
                 self = whole.has_filename() ? whole : whole.parent_path();
  std::string last = self.filename().string();
  if (const fs::path above = self.parent_path();
      holds(kImages, last) && kind_of_path(above).kind == Kind::recording && above != self)
    return {Kind::images_of_recording, "is a part of the recording above it", fmt::format("give {}", quoted(above))};
  std::vector<std::string> names;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored))
    names.push_back(shown(entry.path().filename().string()));
  if (names.empty()) return {Kind::empty, "is an empty folder", ""};
  std::sort(names.begin(), names.end());
  const std::size_t all = names.size();
  names.resize(std::min(all, kNamed));
  return {Kind::other, fmt::format("is a folder with {}{}", fmt::join(names, ", "), all > kNamed ? " and others" : ""),
          ""};
}

}  // namespace

std::string PathKind::is_no(const fs::path& path, const std::string& wanted) const {
  return fmt::format("{}: {}, no {}{}{}", path.string(), words, wanted, remedy.empty() ? "" : ": ", remedy);
}

PathKind kind_of_path(const fs::path& path) {
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return {Kind::other, "is not there", ""};
  return fs::is_directory(path, ignored) ? kind_of_folder(path) : kind_of_file(path);
}

}  // namespace cairn
