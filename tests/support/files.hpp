// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

namespace cairn {

/// Folder of recordings that are not part of the project, beside its folder.
[[nodiscard]] std::filesystem::path data_folder();
/// Copy of OpenNI2 with the virtual sensor of tests/support/sensor only.
[[nodiscard]] std::string openni_folder();
/// Stand-ins for librealsense2 and libk4a of tests/support/sensor, and for an old libk4a.
[[nodiscard]] std::string sensor_folder();
[[nodiscard]] std::string old_sensor_folder();
/// Vulkan layer with failures and missing features selected by CAIRN_FAULTS, see tests/support/faulty_device, and its
/// folder.
inline constexpr const char* kFaultyDevice = "VK_LAYER_CAIRN_faulty_device";
[[nodiscard]] std::string faulty_device_folder();
/// Environment of a program with these device faults.
[[nodiscard]] std::string faulty_device(const std::string& faults);
/// Program started by run_cairn.
[[nodiscard]] std::filesystem::path program_file();
/// Folder for data shared by the tests of this build: support/shared.hpp.
[[nodiscard]] std::filesystem::path shared_folder();
/// Library that causes disk errors, see tests/support/faults.
[[nodiscard]] std::string faults_library();
/// Environment of a program with a file size limit, as on a full disk: "File too large".
std::string with_files_of(std::size_t bytes);
/// Root folder of the project.
[[nodiscard]] std::filesystem::path source_folder();

/// New empty folder, removed by the destructor.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

void write_text(const std::filesystem::path& file, const std::string& text);
[[nodiscard]] std::string read_bytes(const std::filesystem::path& file);
/// Contents of a folder by relative path: bytes of files, empty for folders.
[[nodiscard]] std::map<std::string, std::string> bytes_below(const std::filesystem::path& folder);
/// Number from an environment variable, as set by campaigns.
[[nodiscard]] int number_from(const char* variable, int otherwise);

/// Runs the program; `err` is its stderr, `out` its stdout.
struct Ran {
  int exit_code;
  std::string out, err;
};
[[nodiscard]] Ran run_cairn(const std::vector<std::string>& arguments, const std::string& environment = "");

/// Expects this exit code and a single line on stderr that contains `what`.
void expect_one_line(const Ran& ran, int exit_code, const std::string& what);

/// The same for the last line, after progress.
void expect_last_line(const Ran& ran, int exit_code, const std::string& what);

/// Errors and warnings of Khronos' glTF validator, one per line; empty: valid. Fails the test if the validator is not
/// installed.
[[nodiscard]] std::string validate_gltf(const std::filesystem::path& file);

/// Message of the std::runtime_error thrown by `f`; fails the test without an exception.
template <class F>
std::string error_of(F&& f) {
  try {
    f();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  ADD_FAILURE() << "no exception was thrown";
  return {};
}

}  // namespace cairn

// Skips a test, with the name of the recording, if a recording outside of the project is absent.
#define CAIRN_REQUIRE_DATA(name)                               \
  if (!std::filesystem::exists(cairn::data_folder() / (name))) \
  GTEST_SKIP() << "recording " << (name) << " is not in " << cairn::data_folder()
