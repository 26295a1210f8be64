// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Summary of a recording, as Cairn reads it.
#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cairn/io/source.hpp"
#include "cairn/mapping/frame.hpp"

namespace cairn {

/// Inertial sensors of the inspected frames.
struct InertialSummary {
  struct Sensor {
    int samples = 0;
    double rate = 0;         ///< Hz
    double longest_gap = 0;  ///< seconds
  };
  Sensor gyroscope, accelerometer;
  double norm = 0;  ///< median norm of the accelerometer, m/s^2: near 9.81
};

struct SourceSummary {
  std::string layout;  ///< see Source::layout()
  Rig rig;
  std::optional<int> frames;  ///< all frames of the source; nullopt if unknown
  int inspected = 0;          ///< number of inspected frames, from the first
  int unreadable = 0;         ///< unreadable frames among the inspected ones
  std::string first_problem;  ///< problem of the first unreadable frame
  double seconds = 0;         ///< from the first to the last inspected frame
  double rate = 0;            ///< Hz; 0: a single frame
  double nearest = 0;         ///< 1st percentile of depth, meters
  double median = 0;          ///< meters
  double farthest = 0;        ///< 99th percentile of depth, meters
  double measured_share = 0;  ///< fraction of depth pixels with a measurement
  int with_color = 0;         ///< frames
  double color_delay = 0;     ///< median time from a depth timestamp to its color timestamp, seconds
  int with_pose = 0;          ///< frames
  int with_acceleration = 0;  ///< frames
  int with_gyroscope = 0;     ///< frames
  int with_confidence = 0;    ///< frames
  InertialSummary inertial;
  std::vector<std::string> doubts;  ///< missing or implausible properties, one line each, with the remedy
};

/// Interpretation of one property of a recording: {"pairing", "by equal numbers; ..."}.
struct Interpretation {
  std::string what, words;
};
/// Interpretation of an image folder's files, one line each; empty for other recordings. Throws std::runtime_error as
/// open_source() does.
[[nodiscard]] std::vector<Interpretation> interpretation_of(const std::string& recording,
                                                            const SourceOptions& options = {});

/// Reads the first `frames` frames of a source, or all if there are fewer.
[[nodiscard]] SourceSummary inspect(Source& source, int frames = 100);

/// Writes a PNG of a frame's color image with its depth edges drawn on top: misaligned edges indicate a wrong
/// calibration. Throws std::runtime_error for a frame without color, and if the file cannot be written.
void write_edges_picture(const std::filesystem::path& file, const Rig& rig, const Frame& frame);

}  // namespace cairn
