// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/io/source.hpp"

namespace cairn::apps {

/// Help text for SEQUENCE.
inline constexpr const char* kSequenceHelp =
    "Folder (TUM RGB-D, 7-Scenes, ICL-NUIM, nerfstudio and others, or your own images), .oni, .sens or .mkv "
    "file, .bag, .mcap, .db3 or folder of ROS, .zip of these, a sensor (openni:, realsense: or k4a:, followed by its "
    "URI or serial number if there are several), ros2: for running ROS 2 topics, frames of a program that connects "
    "(tcp:PORT, ws:PORT), or synthetic:NAME";

/// Absolute path without `.`, `..` and a trailing slash; it need not exist.
[[nodiscard]] std::filesystem::path tidy(const std::filesystem::path& path);
/// Help text for --frames.
inline constexpr const char* kFramesHelp =
    "N: the first N; A:B: frames A to B - 1, counted from 0; A: and :B; A:B:STEP: every STEP-th; for example 100, "
    "0:300, 300:, ::3 [all]";
/// Parses `N` or `A:B:STEP` with optional parts. Throws CLI::ValidationError.
[[nodiscard]] FrameRange parse_frames(const std::string& text);

/// Representation in sessions and reports.
[[nodiscard]] nlohmann::json to_json(const HoldOut& hold_out);
/// Throws nlohmann::json::exception for input not produced by to_json().
[[nodiscard]] HoldOut hold_out_from(const nlohmann::json& j);

/// Check for options that take a recording: a file, a folder, or a rendered scene.
[[nodiscard]] std::string is_recording(const std::string& name);

/// Identity of a recording in a session, independent of its path: the camera and the first frames.
[[nodiscard]] std::string identity(const std::string& sequence, SourceOptions options);

/// Adds --camera: a file, or the name of a known camera. `in_place` completes the help text after "camera.yaml or a
/// name (...) ".
void add_camera(CLI::App& command, std::filesystem::path& camera, const std::string& in_place);
void add_topics(CLI::App& command, std::vector<std::string>& topics);
/// Adds --mask, a folder for with_masks.
void add_mask(CLI::App& command, std::filesystem::path& mask);
/// Source with the masks of --mask, or unchanged if `mask` is empty.
[[nodiscard]] std::unique_ptr<Source> masked(std::unique_ptr<Source> source, const std::filesystem::path& mask,
                                             const std::string& sequence);
/// Options for reading SEQUENCE: each of `topics` is assigned to depth or color by its type. Throws std::runtime_error
/// for a topic of another type, or for two of the same type.
[[nodiscard]] SourceOptions source_options(const std::string& sequence, const std::filesystem::path& camera,
                                           const std::vector<std::string>& topics);

}  // namespace cairn::apps
