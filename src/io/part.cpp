// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/part.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "base/read_json.hpp"
#include "base/read_whole.hpp"
#include "cairn/parts.hpp"
#include "synth/source.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr std::string_view kRemedy = "make it again with `cairn plan`";

std::optional<nlohmann::json> read_part(const fs::path& folder) {
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
    throw std::runtime_error(fmt::format("{}: is damaged: is no JSON; {}", file.string(), remedy));
  if (!json.is_object() || json.value("kind", nlohmann::json()) != kind) return std::nullopt;
  if (json.value("format", nlohmann::json()) != kPlanFormat)
    throw std::runtime_error(file.string() +
                             ": was made by another version of Cairn; make it again with `cairn plan`, in a new "
                             "folder");
  return json;
}

int whole_number_at(const nlohmann::json& object, const char* key, int least, int most) {
  const auto it = object.find(key);
  if (it == object.end()) throw std::runtime_error(fmt::format("`{}` is missing", key));
  const double value = it->is_number() ? it->get<double>() : std::numeric_limits<double>::quiet_NaN();
  if (!(value >= least && value <= most && value == std::floor(value)))
    throw std::runtime_error(fmt::format("`{}` is no whole number from {} to {}", key, least, most));
  return static_cast<int>(value);
}

std::string text_at(const nlohmann::json& object, const char* key) {
  const auto it = object.find(key);
  if (it == object.end()) throw std::runtime_error(fmt::format("`{}` is missing", key));
  if (!it->is_string()) throw std::runtime_error(fmt::format("`{}` is no text", key));
  return it->get<std::string>();
}

std::optional<RecordingPart> part_in(const fs::path& folder) {
  const auto json = read_part(folder);
  if (!json) return std::nullopt;
  return told_as_damaged(folder / kPartFile, kRemedy, [&] {
    constexpr int kMost = std::numeric_limits<int>::max();
    RecordingPart part{.name = text_at(*json, "name"), .recording = text_at(*json, "recording")};
    part.end = whole_number_at(*json, "end", 1, kMost);
    part.begin = whole_number_at(*json, "begin", 0, part.end - 1);
    part.other_camera = json->contains("camera");
    if (!part.recording.starts_with(kSynthetic) && !fs::path(part.recording).is_absolute())
      throw std::runtime_error("`recording` is no whole path");
    if (read_part(part.recording)) throw std::runtime_error("`recording` is itself a part of a plan");
    return std::optional(part);
  });
}

FrameRange in_recording(const RecordingPart& part, const FrameRange& range) {
  const auto of_recording = [&](int frame) { return frame < part.end - part.begin ? part.begin + frame : part.end; };
  return {.begin = of_recording(range.begin), .end = of_recording(range.end.value_or(part.end)), .step = range.step};
}

int first_index(const std::string& name) {
  const auto part = part_in(name);
  return part ? part->begin : 0;
}

}  // namespace cairn
