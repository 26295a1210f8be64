// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/building/project.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "base/changed_file.hpp"
#include "base/json_text.hpp"
#include "base/read_whole.hpp"
#include "cairn/io/source.hpp"
#include "io/camera_file.hpp"
#include "io/recording_segment.hpp"
#include "io/reproject_to.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kPlanFile = "plan.json";
constexpr std::string_view kPlanKind = "cairn plan";
constexpr std::string_view kRemedy = "remove it and run `cairn plan` again";
constexpr int kMaxInt = std::numeric_limits<int>::max();

/// Segment name, three digits or more.
std::string segment_name(std::size_t number) { return fmt::format("{:03}", number); }

/// Recording name as stored in a project.
std::string recording_name(const std::string& recording) {
  if (is_sensor(recording))
    throw std::runtime_error(recording +
                             ": is a sensor, an endless stream: record it with `cairn record` and plan the recording");
  if (is_synthetic(recording)) return recording;
  const fs::path path = fs::weakly_canonical(fs::absolute(recording));
  std::string name = (path.has_filename() ? path : path.parent_path()).string();
  if (as_utf8(name) != name) throw std::runtime_error(as_utf8(name) + ": its name is not UTF-8: rename it");
  if (const auto segment = read_segment(name))
    throw std::runtime_error(
        fmt::format("{}: is part {} of a plan: give its recording, {}", name, segment->name, segment->recording));
  return name;
}

/// Opens without color camera calibration, because its result differs between recordings.
std::unique_ptr<Source> open_uncalibrated(const std::string& recording) {
  return open_source(recording, {.find_color_camera = false});
}

int count_frames(Source& source) {
  if (const auto size = source.size()) return *size;
  int frames = 0;
  while (source.next()) ++frames;
  return frames;
}

/// Cameras of the project's map, and the recording that defines them.
struct Cameras {
  std::string recording;
  Rig rig;
};

/// Returns the project's cameras: from a recording among `names` with the project's camera, because the project's first
/// recording may be unavailable now, else from the first recording of the project, or of `names` for a new project.
Cameras cameras_of(const Project& plan, const std::vector<std::string>& names) {
  const auto has = [&](const std::string& name) {
    return std::ranges::any_of(plan.recordings,
                               [&](const auto& known) { return known.name == name && !known.other_camera; });
  };
  const auto known = std::ranges::find_if(names, has);
  const std::string& name = known != names.end()      ? *known
                            : plan.recordings.empty() ? names.front()
                                                      : plan.recordings.front().name;
  return {name, open_uncalibrated(name)->rig()};
}

/// Splits the last recording into segments of equal length, at most `frames_per_segment` plus the overlap.
void split_last(Project& plan) {
  const std::size_t recording = plan.recordings.size() - 1;
  const int frames = plan.recordings[recording].frames;
  const std::int64_t steps =
      std::max(0, frames - plan.overlap);  // from the start of the first segment to the end of the last
  const std::int64_t count = std::max<std::int64_t>(1, (steps + plan.frames_per_segment - 1) / plan.frames_per_segment);
  for (std::int64_t i = 0; i < count; ++i) {
    const auto begin = steps * i / count, end = steps * (i + 1) / count + plan.overlap;
    plan.segments.push_back({.name = segment_name(plan.segments.size()),
                             .recording = recording,
                             .begin = static_cast<int>(begin),
                             .end = static_cast<int>(std::min<std::int64_t>(end, frames))});
  }
}

/// Throws if the frames cannot be resampled into the project's cameras.
void check_reprojection(std::unique_ptr<Source> source, const std::string& name, const Cameras& cameras) {
  std::string reason = "its color camera has a slightly different pose";
  try {
    source = reproject_to(std::move(source), cameras.rig);
    if (source->rig().has_same_cameras(cameras.rig)) return;
  } catch (const std::runtime_error& error) {
    reason = error.what();
  }
  throw std::runtime_error(
      fmt::format("{}: has another camera than {}, and cannot be reprojected to it: {}; "
                  "make a plan for each camera",
                  name, cameras.recording, reason));
}

void add(Project& plan, const std::string& name, const Cameras& cameras) {
  auto source = open_uncalibrated(name);
  const bool is_other = !source->rig().has_same_cameras(cameras.rig);
  const int frames = count_frames(*source);
  if (is_other) check_reprojection(std::move(source), name, cameras);
  const auto known = std::ranges::find(plan.recordings, name, &Project::Recording::name);
  if (known == plan.recordings.end()) {
    if (frames < 1) throw std::runtime_error(name + ": has no frames");
    plan.recordings.push_back({.name = name, .frames = frames, .other_camera = is_other});
    split_last(plan);
  } else if (known->other_camera != is_other) {
    throw std::runtime_error(fmt::format("{}: its camera differs from the planned one; restore the camera file", name));
  } else if (known->frames != frames) {
    throw std::runtime_error(fmt::format(
        "{}: has {} frames, but had {} when it was planned: restore it, or plan the new version under another name",
        name, frames, known->frames));
  }
}

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error)
    throw std::runtime_error(
        fmt::format("cannot create the folder {}: {}; choose another", folder.string(), error.message()));
}

void write_json(const fs::path& file, const Json& json, Durable durable) {
  make_folder(file.parent_path());
  write_changed(file, json.dump(2) + "\n", durable);
}

/// Path of the project's camera file, next to segments of recordings with another camera.
fs::path camera_file(const fs::path& folder, const Project::Segment& segment) {
  return folder / "parts" / segment.name / kPartCamera;
}

std::string text_of(Rig rig) {
  rig.depth_correction = {};
  return camera_file_text({.rig = rig, .depth_scale = {}});
}

/// Throws if the project had another camera before.
void check_camera_unchanged(const Project& plan, const fs::path& folder, const Cameras& cameras) {
  for (const auto& segment : plan.segments) {
    const fs::path file = camera_file(folder, segment);
    if (!plan.recordings[segment.recording].other_camera || !fs::exists(file)) continue;
    const auto bytes = read_whole(file);
    if (std::string(bytes.begin(), bytes.end()) != text_of(cameras.rig))
      throw std::runtime_error(fmt::format(
          "{}: its camera differs from the plan's; restore the camera file, or plan all recordings in a new folder",
          cameras.recording));
  }
}

/// plan.json is written last, so every file it lists exists.
void write(const Project& plan, const fs::path& folder, const Rig& rig) {
  Json recordings = Json::array(), parts = Json::array();
  for (const auto& r : plan.recordings) {
    recordings.push_back({{"name", r.name}, {"frames", r.frames}});
    if (r.other_camera) recordings.back()["other_camera"] = true;
  }
  for (const auto& p : plan.segments) {
    parts.push_back({{"name", p.name}, {"recording", p.recording}, {"begin", p.begin}, {"end", p.end}});
    const Project::Recording& recording = plan.recordings[p.recording];
    Json segment{{"kind", kPartKind},           {"format", kPlanFormat}, {"name", p.name},
                 {"recording", recording.name}, {"begin", p.begin},      {"end", p.end}};
    if (recording.other_camera) {
      make_folder(folder / "parts" / p.name);
      write_changed(camera_file(folder, p), text_of(rig), Durable::some_time);
      segment["camera"] = kPartCamera;
    }
    write_json(folder / "parts" / p.name / kPartFile, segment, Durable::some_time);
  }
  write_json(folder / kPlanFile,
             {{"kind", kPlanKind},
              {"format", kPlanFormat},
              {"frames_per_part", plan.frames_per_segment},
              {"overlap", plan.overlap},
              {"recordings", std::move(recordings)},
              {"parts", std::move(parts)}},
             Durable::now);
}

void check(const Project& options) {
  if (options.frames_per_segment < 1)
    throw std::runtime_error(
        fmt::format("Project::frames_per_segment is {}: take 1 or more", options.frames_per_segment));
  if (options.overlap < 0 || options.overlap >= options.frames_per_segment)
    throw std::runtime_error(
        fmt::format("Project::overlap is {}: take 0 or more, and less than Project::frames_per_segment, {}",
                    options.overlap, options.frames_per_segment));
}

/// Returns the existing project, or an empty one.
Project load_or_create(const fs::path& folder, const Project& options) {
  if (fs::exists(folder / kPlanFile)) {
    Project plan = read_plan(folder);
    if (plan.frames_per_segment != options.frames_per_segment || plan.overlap != options.overlap)
      throw std::runtime_error(fmt::format(
          "{}: was made with Project::frames_per_segment {} and Project::overlap {}: plan with these, or in "
          "a new folder",
          folder.string(), plan.frames_per_segment, plan.overlap));
    return plan;
  }
  for (const char* name : {"session", "report.json"})
    if (fs::exists(folder / name))
      throw std::runtime_error(fmt::format("{}: contains a map ({}); choose another folder", folder.string(), name));
  return {.frames_per_segment = options.frames_per_segment, .overlap = options.overlap};
}

const nlohmann::json& list_at(const nlohmann::json& object, const char* key) {
  const auto it = object.find(key);
  if (it == object.end() || !it->is_array()) throw std::runtime_error(fmt::format("`{}` is not a list", key));
  return *it;
}

Project plan_from(const nlohmann::json& json) {
  Project plan{.frames_per_segment = integer_at(json, "frames_per_part", 1, kMaxInt)};
  plan.overlap = integer_at(json, "overlap", 0, plan.frames_per_segment - 1);
  for (const auto& r : list_at(json, "recordings"))
    plan.recordings.push_back({.name = text_at(r, "name"),
                               .frames = integer_at(r, "frames", 1, kMaxInt),
                               .other_camera = r.contains("other_camera")});
  for (const auto& p : list_at(json, "parts")) {
    Project::Segment segment{.name = text_at(p, "name")};
    if (segment.name != segment_name(plan.segments.size()))
      throw std::runtime_error(fmt::format("part {} has a wrong name", segment_name(plan.segments.size())));
    const int recordings = static_cast<int>(plan.recordings.size());
    segment.recording = static_cast<std::size_t>(integer_at(p, "recording", 0, recordings - 1));
    segment.end = integer_at(p, "end", 1, plan.recordings[segment.recording].frames);
    segment.begin = integer_at(p, "begin", 0, segment.end - 1);
    plan.segments.push_back(std::move(segment));
  }
  return plan;
}

}  // namespace

Project read_plan(const fs::path& folder) {
  const fs::path file = folder / kPlanFile;
  if (!fs::exists(file))
    throw std::runtime_error(folder.string() + ": has no plan.json: give a folder made by `cairn plan`");
  const auto json = read_plan_file(file, kPlanKind, kRemedy);
  if (!json) throw std::runtime_error(file.string() + ": is not a plan of `cairn plan`: choose another folder");
  return rethrow_as_damaged(file, kRemedy, [&] { return plan_from(*json); });
}

Project plan_project(const std::vector<std::string>& recordings, const fs::path& folder, const Project& options) {
  check(options);
  Project plan = load_or_create(folder, options);
  std::vector<std::string> names;  // without duplicates
  for (const std::string& recording : recordings)
    if (std::string name = recording_name(recording); std::ranges::find(names, name) == names.end())
      names.push_back(std::move(name));
  if (names.empty()) throw std::runtime_error(folder.string() + ": no recording given");
  const Cameras cameras = cameras_of(plan, names);
  check_camera_unchanged(plan, folder, cameras);
  for (const std::string& name : names) add(plan, name, cameras);
  write(plan, folder, cameras.rig);
  return plan;
}

}  // namespace cairn
