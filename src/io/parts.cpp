// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/parts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "base/changed_file.hpp"
#include "base/json_text.hpp"
#include "base/read_whole.hpp"
#include "cairn/source.hpp"
#include "io/as_taken_by.hpp"
#include "io/camera_file.hpp"
#include "io/part.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kPlanFile = "plan.json";
constexpr std::string_view kPlanKind = "cairn plan";
constexpr std::string_view kRemedy = "remove it, and make it again with `cairn plan`";
constexpr int kMost = std::numeric_limits<int>::max();

/// Segment name, three digits or more.
std::string name_of_part(std::size_t number) { return fmt::format("{:03}", number); }

/// Recording name as stored in a project.
std::string whole_name(const std::string& recording) {
  if (is_sensor(recording))
    throw std::runtime_error(recording +
                             ": is a sensor, which has no end: keep what it sees with `cairn record`, and plan that");
  if (is_synthetic(recording)) return recording;
  const fs::path path = fs::weakly_canonical(fs::absolute(recording));
  std::string whole = (path.has_filename() ? path : path.parent_path()).string();
  if (as_utf8(whole) != whole)
    throw std::runtime_error(as_utf8(whole) + ": its name is not UTF-8, and a plan cannot keep it: rename it");
  if (const auto part = part_in(whole))
    throw std::runtime_error(
        fmt::format("{}: is part {} of a plan: name its recording, {}", whole, part->name, part->recording));
  return whole;
}

/// Opens without color camera calibration, because its result differs between recordings.
std::unique_ptr<Source> opened(const std::string& recording) {
  return open_source(recording, {.find_colour_camera = false});
}

int frames_of(Source& source) {
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
Cameras cameras_of(const PartsPlan& plan, const std::vector<std::string>& names) {
  const auto has = [&](const std::string& name) {
    return std::ranges::any_of(plan.recordings,
                               [&](const auto& known) { return known.name == name && !known.other_camera; });
  };
  const auto known = std::ranges::find_if(names, has);
  const std::string& name = known != names.end()      ? *known
                            : plan.recordings.empty() ? names.front()
                                                      : plan.recordings.front().name;
  return {name, opened(name)->rig()};
}

/// Splits the last recording into segments of equal length, at most `frames_per_part` plus the overlap.
void cut_last(PartsPlan& plan) {
  const std::size_t recording = plan.recordings.size() - 1;
  const int frames = plan.recordings[recording].frames;
  const std::int64_t steps =
      std::max(0, frames - plan.overlap);  // from the start of the first segment to the end of the last
  const std::int64_t count = std::max<std::int64_t>(1, (steps + plan.frames_per_part - 1) / plan.frames_per_part);
  for (std::int64_t i = 0; i < count; ++i) {
    const auto begin = steps * i / count, end = steps * (i + 1) / count + plan.overlap;
    plan.parts.push_back({.name = name_of_part(plan.parts.size()),
                          .recording = recording,
                          .begin = static_cast<int>(begin),
                          .end = static_cast<int>(std::min<std::int64_t>(end, frames))});
  }
}

/// Throws if the frames cannot be resampled into the project's cameras.
void check_can_be_turned(std::unique_ptr<Source> source, const std::string& name, const Cameras& cameras) {
  std::string why = "its colour camera lies otherwise by less than can be told";
  try {
    source = as_taken_by(std::move(source), cameras.rig);
    if (source->rig().has_same_cameras(cameras.rig)) return;
  } catch (const std::runtime_error& error) {
    why = error.what();
  }
  throw std::runtime_error(
      fmt::format("{}: was taken by another camera than {}, and cannot be turned into what that would have taken: {}; "
                  "make a plan for each camera",
                  name, cameras.recording, why));
}

void add(PartsPlan& plan, const std::string& name, const Cameras& cameras) {
  auto source = opened(name);
  const bool is_other = !source->rig().has_same_cameras(cameras.rig);
  const int frames = frames_of(*source);
  if (is_other) check_can_be_turned(std::move(source), name, cameras);
  const auto known = std::ranges::find(plan.recordings, name, &PartsPlan::Recording::name);
  if (known == plan.recordings.end()) {
    if (frames < 1) throw std::runtime_error(name + ": holds no frame");
    plan.recordings.push_back({.name = name, .frames = frames, .other_camera = is_other});
    cut_last(plan);
  } else if (known->other_camera != is_other) {
    throw std::runtime_error(
        fmt::format("{}: tells another camera than when it was planned; bring back what it told", name));
  } else if (known->frames != frames) {
    throw std::runtime_error(
        fmt::format("{}: has {} frames, and had {} when it was planned: bring back what it was, or keep what it is now "
                    "under another name and plan that",
                    name, frames, known->frames));
  }
}

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error)
    throw std::runtime_error(
        fmt::format("cannot make the folder {}: {}; choose another", folder.string(), error.message()));
}

void write_json(const fs::path& file, const Json& json, Durable durable) {
  make_folder(file.parent_path());
  write_changed(file, json.dump(2) + "\n", durable);
}

/// Path of the project's camera file, next to segments of recordings with another camera.
fs::path camera_file(const fs::path& folder, const PartsPlan::Part& part) {
  return folder / "parts" / part.name / kPartCamera;
}

std::string text_of(Rig rig) {
  rig.depth_correction = {};
  return camera_file_text({.rig = rig, .depth_scale = {}});
}

/// Throws if the project had another camera before.
void check_stays(const PartsPlan& plan, const fs::path& folder, const Cameras& cameras) {
  for (const auto& part : plan.parts) {
    const fs::path file = camera_file(folder, part);
    if (!plan.recordings[part.recording].other_camera || !fs::exists(file)) continue;
    const auto bytes = read_whole(file);
    if (std::string(bytes.begin(), bytes.end()) != text_of(cameras.rig))
      throw std::runtime_error(fmt::format(
          "{}: tells another camera than when the plan was made; bring back what it told, or plan all in a new folder",
          cameras.recording));
  }
}

/// plan.json is written last, so every file it lists exists.
void write(const PartsPlan& plan, const fs::path& folder, const Rig& rig) {
  Json recordings = Json::array(), parts = Json::array();
  for (const auto& r : plan.recordings) {
    recordings.push_back({{"name", r.name}, {"frames", r.frames}});
    if (r.other_camera) recordings.back()["other_camera"] = true;
  }
  for (const auto& p : plan.parts) {
    parts.push_back({{"name", p.name}, {"recording", p.recording}, {"begin", p.begin}, {"end", p.end}});
    const PartsPlan::Recording& recording = plan.recordings[p.recording];
    Json part{{"kind", kPartKind},           {"format", kPlanFormat}, {"name", p.name},
              {"recording", recording.name}, {"begin", p.begin},      {"end", p.end}};
    if (recording.other_camera) {
      make_folder(folder / "parts" / p.name);
      write_changed(camera_file(folder, p), text_of(rig), Durable::some_time);
      part["camera"] = kPartCamera;
    }
    write_json(folder / "parts" / p.name / kPartFile, part, Durable::some_time);
  }
  write_json(folder / kPlanFile,
             {{"kind", kPlanKind},
              {"format", kPlanFormat},
              {"frames_per_part", plan.frames_per_part},
              {"overlap", plan.overlap},
              {"recordings", std::move(recordings)},
              {"parts", std::move(parts)}},
             Durable::now);
}

void check(const PartsPlan& options) {
  if (options.frames_per_part < 1)
    throw std::runtime_error(fmt::format("PartsPlan::frames_per_part is {}: take 1 or more", options.frames_per_part));
  if (options.overlap < 0 || options.overlap >= options.frames_per_part)
    throw std::runtime_error(
        fmt::format("PartsPlan::overlap is {}: take 0 or more, and less than PartsPlan::frames_per_part, {}",
                    options.overlap, options.frames_per_part));
}

/// Returns the existing project, or an empty one.
PartsPlan begun(const fs::path& folder, const PartsPlan& options) {
  if (fs::exists(folder / kPlanFile)) {
    PartsPlan plan = read_plan(folder);
    if (plan.frames_per_part != options.frames_per_part || plan.overlap != options.overlap)
      throw std::runtime_error(fmt::format(
          "{}: was made with PartsPlan::frames_per_part {} and PartsPlan::overlap {}: plan with these, or in "
          "a new folder",
          folder.string(), plan.frames_per_part, plan.overlap));
    return plan;
  }
  for (const char* name : {"session", "report.json"})
    if (fs::exists(folder / name))
      throw std::runtime_error(fmt::format("{}: holds a map ({}); choose another folder", folder.string(), name));
  return {.frames_per_part = options.frames_per_part, .overlap = options.overlap};
}

const nlohmann::json& list_at(const nlohmann::json& object, const char* key) {
  const auto it = object.find(key);
  if (it == object.end() || !it->is_array()) throw std::runtime_error(fmt::format("`{}` is no list", key));
  return *it;
}

PartsPlan plan_from(const nlohmann::json& json) {
  PartsPlan plan{.frames_per_part = whole_number_at(json, "frames_per_part", 1, kMost)};
  plan.overlap = whole_number_at(json, "overlap", 0, plan.frames_per_part - 1);
  for (const auto& r : list_at(json, "recordings"))
    plan.recordings.push_back({.name = text_at(r, "name"),
                               .frames = whole_number_at(r, "frames", 1, kMost),
                               .other_camera = r.contains("other_camera")});
  for (const auto& p : list_at(json, "parts")) {
    PartsPlan::Part part{.name = text_at(p, "name")};
    if (part.name != name_of_part(plan.parts.size()))
      throw std::runtime_error(fmt::format("part {} has another name", name_of_part(plan.parts.size())));
    const int recordings = static_cast<int>(plan.recordings.size());
    part.recording = static_cast<std::size_t>(whole_number_at(p, "recording", 0, recordings - 1));
    part.end = whole_number_at(p, "end", 1, plan.recordings[part.recording].frames);
    part.begin = whole_number_at(p, "begin", 0, part.end - 1);
    plan.parts.push_back(std::move(part));
  }
  return plan;
}

}  // namespace

PartsPlan read_plan(const fs::path& folder) {
  const fs::path file = folder / kPlanFile;
  if (!fs::exists(file))
    throw std::runtime_error(folder.string() +
                             ": holds no plan.json: give the folder that `cairn plan` has made, or make it");
  const auto json = read_plan_file(file, kPlanKind, kRemedy);
  if (!json) throw std::runtime_error(file.string() + ": is no plan of `cairn plan`: choose another folder");
  return told_as_damaged(file, kRemedy, [&] { return plan_from(*json); });
}

PartsPlan plan_parts(const std::vector<std::string>& recordings, const fs::path& folder, const PartsPlan& options) {
  check(options);
  PartsPlan plan = begun(folder, options);
  std::vector<std::string> names;  // without duplicates
  for (const std::string& recording : recordings)
    if (std::string name = whole_name(recording); std::ranges::find(names, name) == names.end())
      names.push_back(std::move(name));
  if (names.empty()) throw std::runtime_error(folder.string() + ": no recording is given to plan");
  const Cameras cameras = cameras_of(plan, names);
  check_stays(plan, folder, cameras);
  for (const std::string& name : names) add(plan, name, cameras);
  write(plan, folder, cameras.rig);
  return plan;
}

}  // namespace cairn
