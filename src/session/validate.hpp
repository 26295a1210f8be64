// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Checks of a session read from disk, on which other code relies: valid indices, finite values.
#pragma once
#include <cstddef>
#include <optional>
#include <string>

#include "session/session_files.hpp"

namespace cairn {

/// Throws std::runtime_error with the defect. The session has its newest frames; `frames`: total count including full
/// chunks.
void validate(const SessionState& session, std::size_t frames);
/// As above for the file names of a state, given a valid map.
void validate(const NamedFiles& files, const BackEnd::State& map);
/// As above for frames of a session with `keyframes` keyframes.
void validate(const FusedFrames::Chunk& frames, std::size_t keyframes);

/// Number of a run from the name of its folder, run-N.
[[nodiscard]] std::optional<unsigned long> run_number(const std::string& name);

}  // namespace cairn
