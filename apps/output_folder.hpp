// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The folder that a new map goes to: nothing finished is overwritten unasked.
#pragma once
#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>

namespace cairn::apps {

/// Where a map goes, and what may become of one that is there.
struct OutputArguments {
  std::filesystem::path output;
  bool overwrite = false, auto_name = false;
};

/// `names`: of the option for the folder; `help` tells what that gets.
void add_output_options(CLI::App& command, OutputArguments& a, const std::string& names, const std::string& help);

/// The folder to write a new map to: `output`, or with --auto-name the first of OUT-2, OUT-3, ... that is free where
/// OUT holds a map, which is told. Throws std::runtime_error where OUT holds a map, or a run that was cut off, and
/// nothing says what is to become of it; `can_resume` tells whether --resume is an answer. Other people's files in a
/// folder are no map: they stay.
[[nodiscard]] std::filesystem::path choose_output(const OutputArguments& a, bool can_resume);

/// The cameras of a map whose depth was corrected: no recording has a file of this name.
inline constexpr const char* kMapCamera = "map_camera.yaml";

/// The file with the trajectory of a recording that was not the last; the last one's is trajectory.txt.
[[nodiscard]] std::string name_of_trajectory(int recording);
/// The same of any of so many recordings.
[[nodiscard]] std::string name_of_trajectory(int recording, int recordings);

/// Makes the folder, and removes what killed runs have left half written. Fails before the work, not after it.
void prepare_output(const std::filesystem::path& output);

}  // namespace cairn::apps
