// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A session's state as what state.cbor and the files of keyframes, loops and frames hold, and back.
#pragma once
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "session/session_files.hpp"

namespace cairn {

/// What state.cbor holds: a session with its newest keyframes, loops and frames, and the names of files.
struct StateFile {
  SessionState session;
  NamedFiles files;
};

/// Of keyframes and loops, those that the files leave.
[[nodiscard]] nlohmann::json json_of(const SessionState& session, const NamedFiles& files);
/// Throws for what json_of() has not made, of this version or, in an older format, of the one before. What it says is
/// not validated.
[[nodiscard]] StateFile state_of(const nlohmann::json& json, int format);

[[nodiscard]] nlohmann::json json_of(const FusedFrames::Chunk& frames);
/// As state_of().
[[nodiscard]] FusedFrames::Chunk frames_of(const nlohmann::json& json, int format);

[[nodiscard]] nlohmann::json json_of(std::span<const Keyframe> keyframes);
[[nodiscard]] std::vector<Keyframe> keyframes_of(const nlohmann::json& json, int format);

[[nodiscard]] nlohmann::json json_of(std::span<const Loop> loops);
[[nodiscard]] std::vector<Loop> loops_of(const nlohmann::json& json, int format);

}  // namespace cairn
