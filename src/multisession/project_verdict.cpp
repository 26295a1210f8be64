// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <set>

#include "base/json_text.hpp"
#include "base/quoted.hpp"
#include "base/read_json.hpp"
#include "base/read_whole.hpp"
#include "cairn/building/project.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr double kMinSegmentShare = 0.8;  // of the frames, as for a single run

constexpr const char* kRecordMore =
    "record the space between it and the other parts, from one mapped place to another, and plan it into the same "
    "folder";

std::string reason_of(const Project& plan, const Project::Segment& segment, const std::string& reason) {
  const bool is_unjoined = reason == kUnjoined;
  return fmt::format("part {} ({}, frames {} to {}) is not in the map: {}{}", segment.name,
                     as_utf8(plan.recordings.at(segment.recording).name), segment.begin, segment.end - 1, reason,
                     is_unjoined ? fmt::format("; {}", kRecordMore) : std::string());
}

std::vector<MergedSegment> segments_in(const Json& report) {
  std::vector<MergedSegment> segments;
  for (const Json& segment_json : report.at("parts")) {
    MergedSegment segment{.name = segment_json.at("name"), .left_out = {}, .recording = segment_json.at("recording")};
    if (!segment_json.at("joined").get<bool>()) segment.left_out = segment_json.value("left_out", kUnjoined);
    segment.frames = segment_json.value("frames", 0);
    segments.push_back(std::move(segment));
  }
  return segments;
}

}  // namespace

Verdict verdict_of(const Project& plan, const std::vector<MergedSegment>& segments) {
  Verdict verdict;
  std::set<std::size_t> incomplete_recordings;
  std::size_t segment_count = 0;
  std::int64_t frames = 0, all = 0;
  for (const Project::Segment& segment : plan.segments) {
    const auto found = std::ranges::find(segments, segment.name, &MergedSegment::name);
    const std::string reason = found == segments.end() ? "it was added after the merge" : found->left_out;
    all += segment.end - segment.begin;
    if (reason.empty()) {
      ++segment_count;
      frames += segment.end - segment.begin;
      continue;
    }
    incomplete_recordings.insert(segment.recording);
    verdict.reasons.push_back(reason_of(plan, segment, reason));
  }
  const double share = all > 0 ? static_cast<double>(frames) / static_cast<double>(all) : 0;
  verdict.words = fmt::format("{} of {} parts are in the map, with {:.0f} % of the frames", segment_count,
                              plan.segments.size(), std::floor(100 * share));
  if (segment_count == plan.segments.size()) return verdict;
  verdict.level = share < kMinSegmentShare ? Verdict::Level::bad : Verdict::Level::weak;
  verdict.words += fmt::format("; {} of {} recordings {} partly or entirely missing", incomplete_recordings.size(),
                               plan.recordings.size(), incomplete_recordings.size() == 1 ? "is" : "are");
  return verdict;
}

std::optional<std::vector<MergedSegment>> merged_segments(const fs::path& plan) {
  const fs::path file = plan / "report.json";
  if (!fs::exists(file)) return std::nullopt;
  try {
    const auto bytes = read_whole(file);
    return segments_in(parsed_json(bytes));
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}: cannot be read ({}); make it again with cairn optimize {}", file.string(),
                                         plain(error.what()), quoted(plan)));
  }
}

}  // namespace cairn
