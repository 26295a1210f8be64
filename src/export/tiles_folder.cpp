// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/tiles_folder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/crc.hpp>
#include <stdexcept>
#include <utility>

#include "base/atomic_file.hpp"
#include "base/json_text.hpp"
#include "base/read_whole.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kChecksumDigits = 8;  // of a checksum

std::vector<fs::path> files_in(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

/// Checksum of all names and bytes in a folder: clients that cache tiles by URL never mix old and new tiles.
std::string checksum_of(const fs::path& folder) {
  boost::crc_32_type sum;
  for (const fs::path& file : files_in(folder)) {
    const std::string name = file.filename().string();
    const auto bytes = read_whole(file, kAnySize);
    sum.process_bytes(name.data(), name.size());
    sum.process_bytes(bytes.data(), bytes.size());
  }
  return fmt::format("{:0{}x}", sum.checksum(), kChecksumDigits);
}

/// True for a folder of tiles left by finish(), whose name is the checksum of its files. No other folder is removed.
bool is_tiles(const fs::path& folder) {
  const std::string name = folder.filename().string();
  if (name.size() != kChecksumDigits || name.find_first_not_of("0123456789abcdef") != std::string::npos) return false;
  try {
    if (!fs::is_directory(fs::symlink_status(folder))) return false;
    const auto files = files_in(folder);
    return std::all_of(files.begin(), files.end(), [](const auto& file) { return fs::is_regular_file(file); }) &&
           checksum_of(folder) == name;
  } catch (const std::exception&) {
    return false;  // unreadable
  }
}

void throw_if(const std::error_code& error, const fs::path& folder) {
  if (error) throw std::runtime_error("cannot write " + folder.string() + ": " + error.message());
}

}  // namespace

TilesFolder::TilesFolder(const fs::path& tileset) : home_(tileset) {
  home_.replace_extension(".tiles");
  std::error_code error;
  created_home_ = fs::create_directories(home_, error);
  throw_if(error, home_);
  remove_leftovers(home_);
  try {
    staging_ = std::make_unique<StagingFolder>(home_ / "tiles");
  } catch (const SystemError& failed) {
    throw_if(std::error_code(failed.number, std::generic_category()), home_);
  }
  part_ = staging_->content();
}

TilesFolder::~TilesFolder() {
  std::error_code ignored;
  staging_.reset();
  if (owns_part_) fs::remove_all(part_, ignored);
  if (created_home_ && fs::is_empty(home_, ignored)) fs::remove(home_, ignored);
}

std::string TilesFolder::finish() {
  const fs::path named = home_ / checksum_of(part_);
  const bool exists_already = fs::exists(named);
  if (exists_already && !is_tiles(named))  // else the same tiles were written before
    throw std::runtime_error(named.string() + ": contains files that are not tiles; move them away");
  try {
    if (!exists_already) staging_->replace_folder(named);
  } catch (const SystemError& error) {
    throw_if(std::error_code(error.number, std::generic_category()), named);
  }
  staging_.reset();
  part_ = named;
  owns_part_ = !exists_already;
  sync_folder(home_);
  return as_uri(home_.filename().string()) + "/" + named.filename().string();
}

void TilesFolder::keep() {
  owns_part_ = false;
  std::error_code ignored;
  std::vector<fs::path> others;
  for (const auto& entry : fs::directory_iterator(home_, ignored))
    if (entry.path() != part_ && is_tiles(entry.path())) others.push_back(entry.path());
  for (const fs::path& other : others) fs::remove_all(other, ignored);
}

std::vector<fs::path> TilesFolder::files() const { return files_in(part_); }

}  // namespace cairn
