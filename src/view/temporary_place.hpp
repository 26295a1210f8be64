// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>

#include "base/unfinished.hpp"

namespace cairn {

/// A temporary folder, removed with this object.
class TemporaryPlace {
 public:
  /// Throws std::runtime_error if the folder cannot be created.
  TemporaryPlace() {
    std::string name = (std::filesystem::temp_directory_path() / "cairn-view-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr)
      throw std::runtime_error("cannot create the folder " + name + ": " + std::strerror(errno) +
                               "; set TMPDIR to another folder");
    path_ = name;
    unfinished_.emplace(path_);
  }
  ~TemporaryPlace() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryPlace(const TemporaryPlace&) = delete;
  TemporaryPlace& operator=(const TemporaryPlace&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  std::optional<Unfinished> unfinished_;
};

}  // namespace cairn
