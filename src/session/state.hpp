// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Conversion between a session's state and the contents of state.cbor and the files of keyframes, loops and frames.
#pragma once
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "session/session_files.hpp"

namespace cairn {

/// Contents of state.cbor: a session with its newest keyframes, loops and frames, and the names of files.
struct StateFile {
  SessionState session;
  NamedFiles files;
};

/// Stores only keyframes and loops absent from the named files.
[[nodiscard]] nlohmann::json json_of(const SessionState& session, const NamedFiles& files);
/// Throws for input that json_of() has not written in a readable format. Does not validate the values.
[[nodiscard]] StateFile state_of(const nlohmann::json& json, int format);

[[nodiscard]] nlohmann::json json_of(const FusedFrames::Chunk& frames);
/// As state_of().
[[nodiscard]] FusedFrames::Chunk frames_of(const nlohmann::json& json, int format);

[[nodiscard]] nlohmann::json json_of(std::span<const Keyframe> keyframes);
[[nodiscard]] std::vector<Keyframe> keyframes_of(const nlohmann::json& json, int format);

[[nodiscard]] nlohmann::json json_of(std::span<const Loop> loops);
[[nodiscard]] std::vector<Loop> loops_of(const nlohmann::json& json, int format);

}  // namespace cairn
