// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/path_kind.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <vector>

#include "base/file_name.hpp"
#include "base/quoted.hpp"
#include "base/words.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using namespace std::string_view_literals;
using Kind = PathKind::Kind;

constexpr std::size_t kMaxNames = 3;  // maximum number of folder entries listed in a message
constexpr std::array kMeshes{".glb"sv, ".gltf"sv, ".ply"sv, ".obj"sv, ".stl"sv, ".drc"sv};
constexpr std::array kRecordings{".bag"sv, ".mcap"sv, ".db3"sv, ".oni"sv, ".mkv"sv, ".sens"sv, ".zip"sv, ".r3d"sv};
/// Files and folders found only in recordings.
constexpr std::array kRecordingFiles{"depth.txt"sv,
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
constexpr std::array kImageFolders{"depth"sv,  "rgb"sv,    "color"sv,     "colour"sv,
                                   "images"sv, "depths"sv, "depth_raw"sv, "confidence"sv};

template <class List>
bool contains(const List& list, std::string_view name) {
  return std::find(list.begin(), list.end(), name) != list.end();
}

bool is_present(const fs::path& path) {
  std::error_code ignored;
  return fs::exists(path, ignored);
}

PathKind kind_of_file(const fs::path& file) {
  const std::string name = quoted(file), extension = extension_of(file);
  if (file.filename() == "tileset.json")
    return {Kind::tiles, "is a tileset", fmt::format("`cairn view {}` shows it", name)};
  if (contains(kMeshes, extension)) return {Kind::mesh, "is a mesh", fmt::format("`cairn view {}` shows it", name)};
  if (extension == ".vdb")
    return {Kind::voxels, "is the voxel grid of a map",
            fmt::format("`cairn view {0}` shows them, `cairn export {0} -o mesh.glb` makes a mesh", name)};
  if (contains(kRecordings, extension))
    return {Kind::recording, "is a recording", fmt::format("`cairn reconstruct {}` makes a map of it", name)};
  if (extension == ".txt" || extension == ".tum")
    return {Kind::trajectory, "is a text file, perhaps a trajectory",
            "`cairn evaluate trajectory` compares trajectories"};
  return {Kind::other,
          extension.empty() ? "is a file without an extension" : fmt::format("is a {} file", shown(extension)), ""};
}

PathKind kind_of_folder(const fs::path& folder) {
  const std::string name = quoted(folder);
  if (is_present(folder / "plan.json"))
    return {Kind::plan, "is a plan of several recordings",
            fmt::format("`cairn reconstruct` of each folder in {1} makes its maps, then `cairn tile {0}` its tiles",
                        name, quoted(folder / "parts"))};
  if (is_present(folder / "part.json"))
    return {Kind::part, "is a part of a plan", fmt::format("`cairn reconstruct {}` makes its map", name)};
  if (is_present(folder / "session" / "state.cbor") ||
      (is_present(folder / "report.json") && is_present(folder / "trajectory.txt")))
    return {Kind::map, "is a map made by cairn",
            fmt::format("`cairn view {0}` shows it, `cairn info {0}` shows its quality", name)};
  if (is_present(folder / "state.cbor"))
    return {Kind::map, "is the session of a map", fmt::format("give {}", quoted((folder / "..").lexically_normal()))};
  if (is_present(folder / "tileset.json"))
    return {Kind::tiles, "is a folder of tiles",
            fmt::format("`cairn view {}` shows it", quoted(folder / "tileset.json"))};
  if (std::any_of(kRecordingFiles.begin(), kRecordingFiles.end(), [&](auto file) { return is_present(folder / file); }))
    return {Kind::recording, "is a recording", fmt::format("`cairn reconstruct {}` makes a map of it", name)};
  const fs::path absolute = fs::absolute(folder).lexically_normal(),
                 resolved = absolute.has_filename() ? absolute : absolute.parent_path();
  std::string last = resolved.filename().string();
  if (const fs::path parent = resolved.parent_path();
      contains(kImageFolders, last) && kind_of_path(parent).kind == Kind::recording && parent != resolved)
    return {Kind::images_of_recording, "is a subfolder of a recording", fmt::format("give {}", quoted(parent))};
  std::vector<std::string> names;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored))
    names.push_back(shown(entry.path().filename().string()));
  if (names.empty()) return {Kind::empty, "is an empty folder", ""};
  std::sort(names.begin(), names.end());
  const std::size_t count = names.size();
  names.resize(std::min(count, kMaxNames));
  return {Kind::other,
          fmt::format("is a folder with {}{}", fmt::join(names, ", "), count > kMaxNames ? " and others" : ""), ""};
}

}  // namespace

std::string PathKind::mismatch(const fs::path& path, const std::string& expected) const {
  return fmt::format("{}: {}, not a {}{}{}", path.string(), words, expected, remedy.empty() ? "" : ": ", remedy);
}

PathKind kind_of_path(const fs::path& path) {
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return {Kind::other, "does not exist", ""};
  return fs::is_directory(path, ignored) ? kind_of_folder(path) : kind_of_file(path);
}

}  // namespace cairn
