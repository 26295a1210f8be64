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

/// Recordings that are not part of the project, beside its folder.
[[nodiscard]] std::filesystem::path data_folder();
/// A copy of OpenNI2 whose only sensor is the virtual one of tests/sensor.
[[nodiscard]] std::string openni_folder();
/// A Vulkan layer that fails and lacks what CAIRN_FAULTS asks for, see tests/faulty_device, and its folder.
inline constexpr const char* kFaultyDevice = "VK_LAYER_CAIRN_faulty_device";
[[nodiscard]] std::string faulty_device_folder();
/// The environment of a program whose device has these faults.
[[nodiscard]] std::string faulty_device(const std::string& faults);
/// The program, as run_cairn runs it.
[[nodiscard]] std::filesystem::path program_file();
/// Where the tests of this build keep what they share: support/shared.hpp.
[[nodiscard]] std::filesystem::path shared_folder();
/// A library that makes the disk fail, see tests/faults.
[[nodiscard]] std::string faults_library();
/// The environment of a program whose files may have no more bytes, as on a full disk: "File too large".
std::string with_files_of(std::size_t bytes);
/// The project's own folder.
[[nodiscard]] std::filesystem::path source_folder();

/// A new empty folder that goes away with the object.
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
/// All that lies in a folder, by its name there: files' bytes, and nothing for folders.
[[nodiscard]] std::map<std::string, std::string> bytes_below(const std::filesystem::path& folder);
/// What the environment says, as campaigns do.
[[nodiscard]] int number_from(const char* variable, int otherwise);

/// Runs the program; `err` is what it printed to stderr, `out` to stdout.
struct Ran {
  int exit_code;
  std::string out, err;
};
[[nodiscard]] Ran run_cairn(const std::vector<std::string>& arguments, const std::string& environment = "");

/// The program ended with this exit code and one line on stderr that tells `what`.
void expect_one_line(const Ran& ran, int exit_code, const std::string& what);

/// The same where progress comes before it.
void expect_last_line(const Ran& ran, int exit_code, const std::string& what);

/// Errors and warnings of Khronos' glTF validator, one a line; empty: clean. Fails the test when it is not installed.
[[nodiscard]] std::string validate_gltf(const std::filesystem::path& file);

/// The message of the std::runtime_error that `f` throws; fails the test when it throws none.
template <class F>
std::string error_of(F&& f) {
  try {
    f();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return {};
}

}  // namespace cairn

// Recordings that are not part of the project: a test that needs one is skipped by name where it is absent.
#define CAIRN_REQUIRE_DATA(name)                               \
  if (!std::filesystem::exists(cairn::data_folder() / (name))) \
  GTEST_SKIP() << "recording " << (name) << " is not in " << cairn::data_folder()
