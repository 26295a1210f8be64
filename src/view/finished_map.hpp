// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Data of a finished map for the web page; docs/outputs.md describes the JSON fields.
#pragma once
#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "net/served.hpp"

namespace cairn {

/// Name of the coarser mesh shown first, if served.
inline constexpr const char* kFirstMesh = "first.glb";

/// Map in a folder written by `cairn reconstruct`, `live` or `merge`.
class FinishedMap {
 public:
  /// Reads report.json and trajectory.txt. Throws std::runtime_error with a remedy if the folder holds no map.
  explicit FinishedMap(const std::filesystem::path& folder);
  /// `data.json` and the files it names, for a server. The result may outlive this object.
  [[nodiscard]] std::map<std::string, Served> served() const;
  /// All data as one JSON, for a page in a file of the folder: with a smaller mesh if the mesh is too large, and with
  /// few, small pictures. Skips failed parts with a warning.
  [[nodiscard]] std::string inlined() const;

 private:
  struct State;
  std::shared_ptr<const State> state_;
};

/// Data of a single file: .glb, .gltf, .ply or .vdb. Formats unknown to browsers are converted to glTF first.
/// Throws std::runtime_error for a file that cannot be read.
[[nodiscard]] std::map<std::string, Served> served_file(const std::filesystem::path& file);

}  // namespace cairn
