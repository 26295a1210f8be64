// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/tiles_folder.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <boost/crc.hpp>
#include <stdexcept>
#include <utility>

#include "base/json_text.hpp"
#include "base/read_whole.hpp"
#include "cairn/atomic_file.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kDigits = 8;  // of a checksum

std::vector<fs::path> files_in(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

/// Of all names and bytes in a folder: programs that keep tiles by their address never take old ones for new ones.
std::string checksum_of(const fs::path& folder) {
  boost::crc_32_type sum;
  for (const fs::path& file : files_in(folder)) {
    const std::string name = file.filename().string();
    const auto bytes = read_whole(file, kAnySize);
    sum.process_bytes(name.data(), name.size());
    sum.process_bytes(bytes.data(), bytes.size());
  }
  return fmt::format("{:0{}x}", sum.checksum(), kDigits);
}

bool is_checksum(const std::string& name) {
  return name.size() == kDigits && name.find_first_not_of("0123456789abcdef") == std::string::npos;
}

void must(const std::error_code& error, const fs::path& folder) {
  if (error) throw std::runtime_error("cannot write " + folder.string() + ": " + error.message());
}

}  // namespace

TilesFolder::TilesFolder(const fs::path& tileset) : home_(tileset) {
  home_.replace_extension(".tiles");
  part_ = home_ / fmt::format(".part-{}", getpid());
  std::error_code error;
  fs::remove_all(part_, error);
  if (!error) fs::create_directories(part_, error);
  must(error, home_);
}

TilesFolder::~TilesFolder() {
  std::error_code ignored;
  if (is_mine_) fs::remove_all(part_, ignored);
  if (fs::is_empty(home_, ignored)) fs::remove(home_, ignored);
}

std::string TilesFolder::finish() {
  const fs::path named = home_ / checksum_of(part_);
  std::error_code error;
  const bool is_there = fs::exists(named);  // the same tiles were written before
  if (is_there)
    fs::remove_all(part_, error);
  else
    fs::rename(part_, named, error);
  must(error, named);
  part_ = named;
  is_mine_ = !is_there;
  sync_folder(home_);
  return as_uri(home_.filename().string()) + "/" + named.filename().string();
}

void TilesFolder::keep() {
  is_mine_ = false;
  std::error_code ignored;
  std::vector<fs::path> others;
  for (const auto& entry : fs::directory_iterator(home_, ignored))
    if (is_checksum(entry.path().filename().string()) && entry.path() != part_ && entry.is_directory(ignored))
      others.push_back(entry.path());
  for (const fs::path& other : others) fs::remove_all(other, ignored);
}

std::vector<fs::path> TilesFolder::files() const { return files_in(part_); }

}  // namespace cairn
