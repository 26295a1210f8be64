// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

namespace cairn {

/// File read sequentially, with its position and the remaining size.
class FileBytes {
 public:
  /// Throws std::runtime_error with the file if it cannot be read or is empty.
  explicit FileBytes(const std::filesystem::path& file) : name_(file.string()), in_(file, std::ios::binary) {
    std::error_code ignored;
    if (!std::filesystem::is_regular_file(file, ignored)) throw std::runtime_error(name_ + ": is not a readable file");
    size_ = std::filesystem::file_size(file);
    if (!in_) throw std::runtime_error(name_ + ": cannot be read");
    if (size_ == 0) throw std::runtime_error(name_ + ": is empty; copy or download it again");
  }
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] std::uint64_t size() const { return size_; }
  [[nodiscard]] std::uint64_t at() const { return at_; }
  [[nodiscard]] std::uint64_t left() const { return size_ - at_; }
  /// `position` is at most size().
  void seek(std::uint64_t position) {
    at_ = position;
    in_.clear();
    in_.seekg(static_cast<std::streamoff>(position));
  }
  /// Returns false if fewer bytes are left.
  [[nodiscard]] bool read(void* to, std::uint64_t count) {
    if (count > left() || !in_.read(static_cast<char*>(to), static_cast<std::streamsize>(count))) return false;
    at_ += count;
    return true;
  }

 private:
  std::string name_;
  std::ifstream in_;
  std::uint64_t size_ = 0, at_ = 0;
};

}  // namespace cairn
