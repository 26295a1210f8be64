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

#include "cairn/source.hpp"

namespace cairn::apps {

/// How SEQUENCE is explained to the user.
inline constexpr const char* kSequenceHelp =
    "Folder (TUM RGB-D, 7-Scenes, ICL-NUIM, nerfstudio and others, or your own images), .oni, .sens or .mkv "
    "file, .bag, .mcap, .db3 or folder of ROS, .zip of these, openni: or openni:URI for a sensor, or synthetic:NAME";

/// A path from the root, without `.`, `..` and a slash at its end; it need not exist.
[[nodiscard]] std::filesystem::path tidy(const std::filesystem::path& path);
/// How --frames is explained to the user.
inline constexpr const char* kFramesHelp =
    "N: the first N; A:B: frames A to B - 1, counted from 0; A: and :B; A:B:STEP: every STEP-th; for example 100, "
    "0:300, 300:, ::3 [all]";
/// `N`, or `A:B:STEP`, of which each part may be empty. Throws CLI::ValidationError.
[[nodiscard]] FrameRange parse_frames(const std::string& text);

/// As a session and a report hold it.
[[nodiscard]] nlohmann::json to_json(const HoldOut& hold_out);
/// Throws nlohmann::json::exception for what to_json() has not made.
[[nodiscard]] HoldOut hold_out_from(const nlohmann::json& j);

/// For options that take a recording: what is a file or folder, or is rendered.
[[nodiscard]] std::string is_recording(const std::string& name);

/// What a session remembers of it: what it shows, wherever it lies. A recording is known by the camera it tells and its
/// first frames.
[[nodiscard]] std::string identity(const std::string& sequence, SourceOptions options);

/// --camera: a file, or the name of a known camera. `in_place` says of what, after "camera.yaml or a name (...) ".
void add_camera(CLI::App& command, std::filesystem::path& camera, const std::string& in_place);
void add_topics(CLI::App& command, std::vector<std::string>& topics);
/// How the user wants SEQUENCE to be read: each of `topics` is depth's or colour's by what it holds. Throws
/// std::runtime_error for one that is neither, or two of a kind.
[[nodiscard]] SourceOptions source_options(const std::string& sequence, const std::filesystem::path& camera,
                                           const std::vector<std::string>& topics);

}  // namespace cairn::apps
