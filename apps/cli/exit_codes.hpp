// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <array>
#include <utility>

namespace cairn::apps {

inline constexpr int kNotInMap = 3;

/// Exit codes of the program, with the texts of the manual.
inline constexpr std::array<std::pair<const char*, const char*>, 5> kExitCodes{{
    {"0", "Success, also if frames were lost, and after one Ctrl-C."},
    {"1", "Error in the input or the run; one line names the cause, the place and the remedy."},
    {"2", "Wrong usage: an unknown option, options that exclude each other, or a file that does not exist."},
    {"3",
     "The run ended, but less than 80 % of the frames are in the map, the map has unconnected components, depth "
     "contradicts the given poses, a segment of a project is missing in its map, or most frames were not localized."},
    {"130", "Interrupted at once: by a second Ctrl-C, or by the first if there was nothing to finish."},
}};

}  // namespace cairn::apps
