// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What everybody else takes for granted in a session that was read: numbers of what exists, finite values.
#pragma once
#include <cstddef>
#include <optional>
#include <string>

#include "session/session_files.hpp"

namespace cairn {

/// Throws std::runtime_error with what is wrong. The session has its newest frames; `frames`: how many there are with
/// those of full chunks.
void validate(const SessionState& session, std::size_t frames);
/// The same for what a state names beside a map that is valid.
void validate(const NamedFiles& files, const BackEnd::Memory& map);
/// The same for frames of a session with so many keyframes.
void validate(const FusedFrames::Chunk& frames, std::size_t keyframes);

/// The number of a run by the name of its folder, run-N.
[[nodiscard]] std::optional<unsigned long> run_number(const std::string& name);

}  // namespace cairn
