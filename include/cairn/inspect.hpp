// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What a recording holds, as it was understood.
#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cairn/frame.hpp"
#include "cairn/source.hpp"

namespace cairn {

struct SourceSummary {
  std::string layout;  ///< see Source::layout()
  Rig rig;
  std::optional<int> frames;        ///< all of the source; nothing where it cannot tell
  int looked_at = 0;                ///< of these, from the first
  int unreadable = 0;               ///< of those looked at
  std::string first_problem;        ///< of the first unreadable one
  double seconds = 0;               ///< from the first to the last one looked at
  double rate = 0;                  ///< Hz; 0: a single frame
  double nearest = 0;               ///< metres; one measurement in a hundred is nearer
  double median = 0;                ///< metres
  double farthest = 0;              ///< metres; one measurement in a hundred is farther
  double measured_share = 0;        ///< of the depth pixels
  int with_colour = 0;              ///< frames
  double colour_delay = 0;          ///< seconds from a depth image's stamp to its colour image's, the median
  int with_pose = 0;                ///< frames
  int with_acceleration = 0;        ///< frames
  int with_gyroscope = 0;           ///< frames
  int with_confidence = 0;          ///< frames
  std::vector<std::string> doubts;  ///< what is missing or cannot be right, a line each, with what to do
};

/// How something of a recording was understood: {"pairing", "by equal numbers; ..."}.
struct Understood {
  std::string what, words;
};
/// How the files of a folder of images were understood, a line each; nothing for other recordings. Throws
/// std::runtime_error as open_source() does.
[[nodiscard]] std::vector<Understood> understanding_of(const std::string& recording, const SourceOptions& options = {});

/// Reads the first `frames` of a source, all where it has fewer.
[[nodiscard]] SourceSummary inspect(Source& source, int frames = 100);

/// A PNG of a frame's colour image with the edges of its depth drawn over it: where the two do not agree, the
/// calibration is wrong. Throws std::runtime_error for a frame without colour, and when the file cannot be written.
void write_edges_picture(const std::filesystem::path& file, const Rig& rig, const Frame& frame);

}  // namespace cairn
