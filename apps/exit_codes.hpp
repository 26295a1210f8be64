// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <array>
#include <utility>

namespace cairn::apps {

inline constexpr int kNotInMap = 3;

/// Exit codes of the program, with the texts of the manual.
inline constexpr std::array<std::pair<const char*, const char*>, 5> kExitCodes{{
    {"0", "It ended as asked; also when frames were lost, and after one Ctrl-C."},
    {"1", "The input or the run was at fault; one line says what, where and what to do."},
    {"2", "Wrong usage: an unknown option, options that exclude each other, or a file that does not exist."},
    {"3",
     "The run ended, but under 80 % of the frames are in the map, it is in pieces, depth contradicts the given poses, "
     "or "
     "a plan lacks a part."},
    {"130", "Ended at once: by a second Ctrl-C, or by the first where there was nothing to finish."},
}};

}  // namespace cairn::apps
