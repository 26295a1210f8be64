// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A part of a recording, as a plan's folder of it tells, see cairn/parts.hpp.
#pragma once
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "cairn/source.hpp"

namespace cairn {

inline constexpr const char* kPartFile = "part.json";
inline constexpr const char* kPartCamera = "camera.yaml";  // the plan's, beside it, where the recording has another
inline constexpr std::string_view kPartKind = "cairn part";
inline constexpr int kPlanFormat = 1;  // of a plan's files

/// Frames [begin, end) of a recording, counted from 0.
struct RecordingPart {
  std::string name;       // in its plan: digits
  std::string recording;  // as open_source takes it
  int begin = 0, end = 0;
  bool other_camera = false;  // its frames are turned into those of the plan's camera
};

/// The part that a folder is; nothing for what is none. Throws std::runtime_error where its part.json is damaged or
/// was made by another version.
[[nodiscard]] std::optional<RecordingPart> part_in(const std::filesystem::path& folder);

/// The frames of the recording that are these of the part.
[[nodiscard]] FrameRange in_recording(const RecordingPart& part, const FrameRange& range);

/// What a file of a plan holds, an object; nothing for one of another kind. Throws std::runtime_error that names the
/// file where it cannot be read, is no JSON, or has another format, and ends with `remedy` where it is damaged.
[[nodiscard]] std::optional<nlohmann::json> read_plan_file(const std::filesystem::path& file, std::string_view kind,
                                                           std::string_view remedy);
/// A field of it. Throws std::runtime_error that names the field.
[[nodiscard]] int whole_number_at(const nlohmann::json& object, const char* key, int least, int most);
[[nodiscard]] std::string text_at(const nlohmann::json& object, const char* key);

/// Calls `take`, whose std::runtime_error becomes one that says that `file` is damaged.
template <class Take>
auto told_as_damaged(const std::filesystem::path& file, std::string_view remedy, const Take& take) {
  try {
    return take();
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": is damaged: " + error.what() + "; " + std::string(remedy));
  }
}

}  // namespace cairn
