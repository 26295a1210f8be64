// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "support/shared.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <functional>
#include <stdexcept>

#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// File lock between processes, released even if a process is killed.
class Lock {
 public:
  explicit Lock(const fs::path& file) : file_(open(file.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0644)) {
    if (file_ < 0 || flock(file_, LOCK_EX) != 0) throw std::runtime_error("cannot lock " + file.string());
  }
  ~Lock() { close(file_); }
  Lock(const Lock&) = delete;
  Lock& operator=(const Lock&) = delete;

 private:
  int file_;
};

/// Folder for results of this build of the program; removes results of other builds.
const fs::path& folder_of_this_build() {
  static const fs::path folder = [] {
    const auto changed = fs::last_write_time(program_file()).time_since_epoch().count();
    const fs::path made = shared_folder() / std::to_string(changed);
    fs::create_directories(shared_folder());
    const Lock lock(shared_folder() / "lock");
    for (const auto& entry : fs::directory_iterator(shared_folder()))
      if (entry.is_directory() && entry.path() != made) fs::remove_all(entry.path());
    fs::create_directories(made);
    return made;
  }();
  return folder;
}

/// Path `name`, written by `make` on first use; concurrent callers wait.
fs::path made_once(const std::string& name, const std::function<Ran(const std::string&)>& make) {
  const fs::path made = folder_of_this_build() / name, half = folder_of_this_build() / (name + ".half");
  const Lock lock(folder_of_this_build() / (name + ".lock"));
  if (fs::exists(made)) return made;
  fs::remove_all(half);
  const Ran ran = make(half.string());
  if (ran.exit_code != 0) throw std::runtime_error(name + " cannot be made: " + ran.err);
  fs::rename(half, made);
  return made;
}

/// Name that encodes the arguments, independent of the location of the build's folder.
std::string joined(std::string name, const std::vector<std::string>& arguments) {
  const std::string here = folder_of_this_build().string();
  for (const std::string& a : arguments)
    for (const char c : "_" + (a.starts_with(here) ? fs::path(a).filename().string() : a))
      name += std::isalnum(static_cast<unsigned char>(c)) || c == '.' ? c : '_';
  return name;
}

}  // namespace

fs::path shared_recording(const std::vector<std::string>& arguments) {
  return made_once(joined("recording", arguments), [&](const std::string& output) {
    std::vector<std::string> all{"synth", "-o", output};
    all.insert(all.end(), arguments.begin(), arguments.end());
    return run_cairn(all);
  });
}

fs::path shared_map(const fs::path& recording, const std::vector<std::string>& arguments) {
  return made_once(joined("map_of_" + recording.filename().string(), arguments), [&](const std::string& output) {
    std::vector<std::string> all{"reconstruct", recording.string(), "-o", output, "--no-texture"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    const auto chooses_stages = [](const std::string& argument) {
      return std::ranges::count(std::array{"--refine", "--adjust", "--reintegrate", "--poses", "--quality"}, argument) >
             0;
    };
    if (std::ranges::none_of(arguments, chooses_stages)) all.insert(all.end(), {"--quality", "fast"});
    return run_cairn(all);
  });
}

}  // namespace cairn
