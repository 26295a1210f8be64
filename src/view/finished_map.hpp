// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What a page shows of a finished map: docs/formats.md has the fields of its JSON.
#pragma once
#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "view/served.hpp"

namespace cairn {

/// The name of the coarser mesh that is shown first, where one is served.
inline constexpr const char* kFirstMesh = "first.glb";

/// The map in a folder that `cairn reconstruct`, `live` or `merge` has made.
class FinishedMap {
 public:
  /// Reads report.json and trajectory.txt. Throws std::runtime_error when the folder holds no map, with what to do.
  explicit FinishedMap(const std::filesystem::path& folder);
  /// `data.json` and all that it names, for a server. They may outlive this.
  [[nodiscard]] std::map<std::string, Served> served() const;
  /// The same as one JSON, for a page in a file of the folder: with a smaller mesh where it is too large, and few,
  /// small pictures. What cannot be made is left out with a warning.
  [[nodiscard]] std::string inlined() const;

 private:
  struct State;
  std::shared_ptr<const State> state_;
};

/// The same of a single file: .glb, .gltf, .ply, .obj or .vdb. What pages cannot read is turned into
/// glTF first. Throws std::runtime_error for a file that cannot be read.
[[nodiscard]] std::map<std::string, Served> served_file(const std::filesystem::path& file);

}  // namespace cairn
