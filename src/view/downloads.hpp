// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A map's files, for people who look at it in a browser.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "view/served.hpp"

namespace cairn {

struct Download {
  std::string name, what;              // what: in words
  std::optional<std::uint64_t> bytes;  // of what is there already
};

/// The finished files in a folder. `is_textured`: its mesh.
[[nodiscard]] std::vector<Download> finished_files(const std::filesystem::path& folder, bool is_textured);

/// Other forms of a mesh, made of it when somebody asks for them, in a temporary folder that is gone with this and all
/// that it gave.
class MadeDownloads {
 public:
  explicit MadeDownloads(std::filesystem::path mesh);
  [[nodiscard]] std::vector<Download> list() const;
  /// Of a name in the list.
  [[nodiscard]] Served served(const std::string& name) const;

 private:
  struct State;
  std::shared_ptr<State> state_;
};

/// The content type of a file of this name.
[[nodiscard]] std::string content_type_of(const std::filesystem::path& name);

}  // namespace cairn
