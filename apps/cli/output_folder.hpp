// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Output folder of a new map. Finished results are never overwritten without an option.
#pragma once
#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>

namespace cairn::apps {

/// Output folder, with the options for an existing map in it.
struct OutputArguments {
  std::filesystem::path output;
  bool overwrite = false, auto_name = false;
};

/// `names`: spellings of the folder option; `help` describes the folder's contents.
void add_output_options(CLI::App& command, OutputArguments& a, const std::string& names, const std::string& help);

/// Returns the folder for a new map: `output`, or with --auto-name the first free folder of OUT-2, OUT-3, ... if OUT
/// holds a map (printed). Throws std::runtime_error if OUT holds a map or an interrupted run and no option allows
/// replacing or resuming; `can_resume` adds --resume to the remedies. Other files in a folder are not a map and remain.
[[nodiscard]] std::filesystem::path choose_output(const OutputArguments& a, bool can_resume);

/// Camera file of a map, with the calibration found by its run; recordings have no file of this name.
inline constexpr const char* kMapCamera = "map_camera.yaml";

/// Trajectory file of a recording other than the last; the last recording uses trajectory.txt.
[[nodiscard]] std::string name_of_trajectory(int recording);
/// Trajectory file of a recording, given the number of recordings.
[[nodiscard]] std::string name_of_trajectory(int recording, int recordings);

/// Creates the folder and removes partial files of killed runs. Reports a folder that is not writable before the work
/// starts.
void prepare_output(const std::filesystem::path& output);

}  // namespace cairn::apps
