// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Files of a map for download in a browser.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "net/served.hpp"

namespace cairn {

struct Download {
  std::string name, what;              // what: description
  std::optional<std::uint64_t> bytes;  // size of an existing file
};

/// The finished files in a folder. `is_textured`: the mesh has a texture.
[[nodiscard]] std::vector<Download> finished_files(const std::filesystem::path& folder, bool is_textured);

/// Conversions of a mesh, made on request in a temporary folder. The folder exists as long as this object or its
/// downloads.
class MadeDownloads {
 public:
  explicit MadeDownloads(std::filesystem::path mesh);
  [[nodiscard]] std::vector<Download> list() const;
  /// Download of a name in the list.
  [[nodiscard]] Served served(const std::string& name) const;

 private:
  struct State;
  std::shared_ptr<State> state_;
};

/// Content type for the file name.
[[nodiscard]] std::string content_type_of(const std::filesystem::path& name);

}  // namespace cairn
