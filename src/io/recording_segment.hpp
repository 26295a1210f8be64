// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Segment of a recording, read from its folder in a project; see cairn/building/project.hpp.
#pragma once
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "cairn/io/source.hpp"

namespace cairn {

inline constexpr const char* kPartFile = "part.json";
inline constexpr const char* kPartCamera = "camera.yaml";  // the project's, if the recording's differs
inline constexpr std::string_view kPartKind = "cairn part";
inline constexpr int kPlanFormat = 1;  // version of a project's files

/// Frames [begin, end) of a recording, counted from 0.
struct RecordingSegment {
  std::string name;       // in its project: digits
  std::string recording;  // name for open_source
  int begin = 0, end = 0;
  bool other_camera = false;  // frames are resampled into the project's camera
};

/// Reads the segment in a folder; empty if the folder holds none. Throws std::runtime_error if its part.json is damaged
/// or has another version.
[[nodiscard]] std::optional<RecordingSegment> read_segment(const std::filesystem::path& folder);

/// Converts a frame range of the segment to frames of the recording.
[[nodiscard]] FrameRange to_recording_range(const RecordingSegment& segment, const FrameRange& range);

/// Reads a project file, a JSON object; empty for a file of another kind. Throws std::runtime_error with the file name
/// if the file is unreadable, not JSON, or of another format version; damage errors end with `remedy`.
[[nodiscard]] std::optional<nlohmann::json> read_plan_file(const std::filesystem::path& file, std::string_view kind,
                                                           std::string_view remedy);
/// Returns a field of the object. Throws std::runtime_error with the field name.
[[nodiscard]] int integer_at(const nlohmann::json& object, const char* key, int min, int max);
[[nodiscard]] std::string text_at(const nlohmann::json& object, const char* key);

/// Calls `take` and rethrows its std::runtime_error as "`file` is damaged".
template <class Take>
auto rethrow_as_damaged(const std::filesystem::path& file, std::string_view remedy, const Take& take) {
  try {
    return take();
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": is damaged: " + error.what() + "; " + std::string(remedy));
  }
}

}  // namespace cairn
