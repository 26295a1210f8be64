// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "support/files.hpp"

#include <fmt/format.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <sstream>

namespace cairn {

namespace fs = std::filesystem;

// Only this file contains the paths, so that another checkout compiles the same tests.
fs::path data_folder() { return CAIRN_DATA; }
std::string openni_folder() { return CAIRN_OPENNI; }
std::string sensor_folder() { return CAIRN_SENSORS; }
std::string old_sensor_folder() { return CAIRN_OLD_SENSORS; }
std::string faulty_device_folder() { return CAIRN_FAULTY_DEVICE; }
std::string faulty_device(const std::string& faults) {
  return fmt::format("VK_LAYER_PATH='{}' VK_INSTANCE_LAYERS={} CAIRN_VALIDATION=0 CAIRN_FAULTS='{}'",
                     faulty_device_folder(), kFaultyDevice, faults);
}
fs::path program_file() { return CAIRN_PROGRAM; }
fs::path shared_folder() { return CAIRN_SHARED; }
std::string faults_library() { return CAIRN_FAULTS; }
std::string with_files_of(std::size_t bytes) {
  return "CAIRN_FAULTS_FOLDER=/ CAIRN_FAULTS_LIMIT=" + std::to_string(bytes) + " LD_PRELOAD=\"$LD_PRELOAD:\"'" +
         faults_library() + "'";
}
fs::path source_folder() { return CAIRN_SOURCE_DIR; }

TemporaryFolder::TemporaryFolder() {
  std::string name = (fs::temp_directory_path() / "cairn-test-XXXXXX").string();
  path_ = mkdtemp(name.data());
}
TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

void write_text(const fs::path& file, const std::string& text) { std::ofstream(file, std::ios::binary) << text; }

std::string read_bytes(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::map<std::string, std::string> bytes_below(const fs::path& folder) {
  std::map<std::string, std::string> bytes;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    bytes[fs::relative(entry.path(), folder).string()] = entry.is_regular_file() ? read_bytes(entry.path()) : "";
  return bytes;
}

int number_from(const char* variable, int otherwise) {
  const char* value = std::getenv(variable);
  return value == nullptr ? otherwise : std::atoi(value);
}

Ran run_cairn(const std::vector<std::string>& arguments, const std::string& environment) {
  const TemporaryFolder folder;
  std::string command = environment + " '" CAIRN_PROGRAM "'";
  for (const auto& a : arguments) command += " '" + a + "'";
  command += " >'" + (folder / "out").string() + "' 2>'" + (folder / "err").string() + "'";
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + status, read_bytes(folder / "out"),
          read_bytes(folder / "err")};
}

void expect_one_line(const Ran& ran, int exit_code, const std::string& what) {
  EXPECT_EQ(ran.exit_code, exit_code) << ran.err;
  EXPECT_NE(ran.err.find(what), std::string::npos) << ran.err;
  EXPECT_EQ(std::count(ran.err.begin(), ran.err.end(), '\n'), 1) << ran.err;
}

void expect_last_line(const Ran& ran, int exit_code, const std::string& what) {
  EXPECT_EQ(ran.exit_code, exit_code) << ran.err;
  const auto end = ran.err.find_last_not_of('\n');
  const auto begin = ran.err.rfind('\n', end);
  EXPECT_NE(ran.err.substr(begin == ran.err.npos ? 0 : begin).find(what), std::string::npos) << ran.err;
}

std::string validate_gltf(const fs::path& file) {
  const std::string support = (source_folder() / "tests/support").string();
  if (!fs::exists(support + "/node_modules/gltf-validator"))
    return "the validator is missing: run npm ci --prefix tests/support";
  const TemporaryFolder folder;
  const std::string out = (folder / "out").string();
  const int status =
      std::system(("node '" + support + "/validate_gltf.mjs' '" + file.string() + "' >'" + out + "' 2>&1").c_str());
  return read_bytes(out) + (status == 0 ? "" : "the validator failed");
}

}  // namespace cairn
