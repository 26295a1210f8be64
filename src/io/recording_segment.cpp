// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/recording_segment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "base/read_json.hpp"
#include "base/read_whole.hpp"
#include "synth/source.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr std::string_view kRemedy = "make it again with `cairn plan`";

std::optional<nlohmann::json> read_segment_file(const fs::path& folder) {
  std::error_code ignored;
  const fs::path file = folder / kPartFile;
  return fs::is_regular_file(file, ignored) ? read_plan_file(file, kPartKind, kRemedy) : std::nullopt;
}

}  // namespace

std::optional<nlohmann::json> read_plan_file(const fs::path& file, std::string_view kind, std::string_view remedy) {
  std::vector<std::uint8_t> bytes;
  try {
    bytes = read_whole(file);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
  const auto json = parsed_json_or_none({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  if (json.is_discarded())
    throw std::runtime_error(fmt::format("{}: is damaged: is not JSON; {}", file.string(), remedy));
  if (!json.is_object() || json.value("kind", nlohmann::json()) != kind) return std::nullopt;
  if (json.value("format", nlohmann::json()) != kPlanFormat)
    throw std::runtime_error(file.string() +
                             ": was made by another version of Cairn; make it again with `cairn plan`, in a new "
                             "folder");
  return json;
}

int integer_at(const nlohmann::json& object, const char* key, int min, int max) {
  const auto it = object.find(key);
  if (it == object.end()) throw std::runtime_error(fmt::format("`{}` is missing", key));
  const double value = it->is_number() ? it->get<double>() : std::numeric_limits<double>::quiet_NaN();
  if (!(value >= min && value <= max && value == std::floor(value)))
    throw std::runtime_error(fmt::format("`{}` is not an integer from {} to {}", key, min, max));
  return static_cast<int>(value);
}

std::string text_at(const nlohmann::json& object, const char* key) {
  const auto it = object.find(key);
  if (it == object.end()) throw std::runtime_error(fmt::format("`{}` is missing", key));
  if (!it->is_string()) throw std::runtime_error(fmt::format("`{}` is not a string", key));
  return it->get<std::string>();
}

std::optional<RecordingSegment> read_segment(const fs::path& folder) {
  const auto json = read_segment_file(folder);
  if (!json) return std::nullopt;
  return rethrow_as_damaged(folder / kPartFile, kRemedy, [&] {
    constexpr int kMaxFrame = std::numeric_limits<int>::max();
    RecordingSegment segment{.name = text_at(*json, "name"), .recording = text_at(*json, "recording")};
    segment.end = integer_at(*json, "end", 1, kMaxFrame);
    segment.begin = integer_at(*json, "begin", 0, segment.end - 1);
    segment.other_camera = json->contains("camera");
    if (!segment.recording.starts_with(kSynthetic) && !fs::path(segment.recording).is_absolute())
      throw std::runtime_error("`recording` is not an absolute path");
    if (read_segment_file(segment.recording)) throw std::runtime_error("`recording` is itself a part of a plan");
    return std::optional(segment);
  });
}

FrameRange to_recording_range(const RecordingSegment& segment, const FrameRange& range) {
  const auto of_recording = [&](int frame) {
    return frame < segment.end - segment.begin ? segment.begin + frame : segment.end;
  };
  return {.begin = of_recording(range.begin), .end = of_recording(range.end.value_or(segment.end)), .step = range.step};
}

int first_index(const std::string& name) {
  const auto segment = read_segment(name);
  return segment ? segment->begin : 0;
}

}  // namespace cairn
