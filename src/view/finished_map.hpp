// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Data of a finished map for the web page; docs/outputs.md describes the JSON fields.
#pragma once
#include <cstddef>
#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "net/served.hpp"

namespace cairn {

/// Name of the coarser mesh shown first, if served.
inline constexpr const char* kFirstMesh = "first.glb";

/// Content of a page in a single file, as HTML elements: the JSON with the first mesh, for the first picture, and the
/// other files. A URL "#name" in the JSON refers to the base64 text of all elements with the attribute data-of="name".
struct PageContent {
  std::string first, rest;
};

/// Map in a folder written by `cairn reconstruct`, `live` or `merge`.
class FinishedMap {
 public:
  /// Reads report.json and trajectory.txt. Throws std::runtime_error with a remedy if the folder holds no map.
  explicit FinishedMap(const std::filesystem::path& folder);
  /// `data.json` and the files it names, for a server. The result may outlive this object.
  [[nodiscard]] std::map<std::string, Served> served() const;
  /// All data, of at most `max_bytes`, for a page in a file of the folder: with a smaller mesh if the mesh is too
  /// large, few, small pictures, and at most 2,048 frames, poses and loops. Skips failed parts with a warning.
  [[nodiscard]] PageContent inlined(std::size_t max_bytes) const;

 private:
  struct State;
  std::shared_ptr<const State> state_;
};

/// Gaussian splats as .spz, the only format of splats that the page reads.
[[nodiscard]] Served served_splats(const std::filesystem::path& file);

/// Data of a single file: .glb, .gltf, .ply, .vdb or splats. Formats unknown to browsers are converted to glTF first.
/// Throws std::runtime_error for a file that cannot be read.
[[nodiscard]] std::map<std::string, Served> served_file(const std::filesystem::path& file);

}  // namespace cairn
