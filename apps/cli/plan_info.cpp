// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/plan_info.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>

#include "base/quoted.hpp"
#include "cairn/building/project.hpp"
#include "cli/command_line.hpp"
#include "cli/console.hpp"
#include "cli/json_text.hpp"
#include "cli/outputs.hpp"
#include "cli/recording_names.hpp"
#include "cli/run.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// State of a project.
struct ProjectProgress {
  Project project;
  std::optional<std::vector<MergedSegment>> merged;
  std::vector<std::string> mapped, failed, unmapped;                  // segments
  std::vector<std::pair<std::string, std::string>> pairs, unmatched;  // of segments with maps
  std::vector<std::string> cells, untiled;                            // X,Y,Z
  bool is_stale = false;                                              // a map is newer than the result of optimize
};

fs::path loops_of(const fs::path& plan, const std::pair<std::string, std::string>& pair) {
  return plan / "loops" / (pair.first + "-" + pair.second + ".json");
}

/// Returns true if a file exists and is not older than its source.
bool is_up_to_date(const fs::path& file, const fs::path& source) {
  std::error_code none;
  const auto written = fs::last_write_time(file, none);
  if (none) return false;
  const auto source_written = fs::last_write_time(source, none);
  return none || written >= source_written;
}

void find_maps(const fs::path& folder, ProjectProgress& p) {
  for (const auto& segment : p.project.segments) {
    const fs::path map = folder / "maps" / segment.name;
    const bool has_map = fs::exists(map / "session" / "state.cbor");
    (fs::exists(map / "failed.txt") ? p.failed : has_map ? p.mapped : p.unmapped).push_back(segment.name);
  }
  for (std::size_t b = 0; b < p.mapped.size(); ++b)
    for (std::size_t a = 0; a < b; ++a) {
      p.pairs.emplace_back(p.mapped[a], p.mapped[b]);
      if (!fs::exists(loops_of(folder, p.pairs.back()))) p.unmatched.push_back(p.pairs.back());
    }
}

ProjectProgress progress_of(const fs::path& folder) {
  ProjectProgress p{.project = read_plan(folder), .merged = merged_segments(folder)};
  find_maps(folder, p);
  for (const auto& [x, y, z] : cells_of(folder)) {
    p.cells.push_back(fmt::format("{},{},{}", x, y, z));
    const std::string& cell = p.cells.back();
    if (!is_up_to_date(folder / "tiles" / cell / "tileset.json", folder / "cells" / (cell + ".json")))
      p.untiled.push_back(cell);
  }
  p.is_stale = !p.merged;
  for (const std::string& segment : p.mapped)
    p.is_stale =
        p.is_stale || !is_up_to_date(folder / "report.json", folder / "maps" / segment / "session" / "state.cbor");
  for (const auto& pair : p.pairs)
    p.is_stale = p.is_stale || !is_up_to_date(folder / "report.json", loops_of(folder, pair));
  return p;
}

std::string first_of(std::size_t count, const char* things) {
  return count > 1 ? fmt::format("  (the first of {} {})", format_count(count), things) : "";
}

std::string next_command(const fs::path& folder, const ProjectProgress& p) {
  const std::string plan = quoted(folder.string());
  const auto in = [&](const std::string& name) { return quoted((folder / name).string()); };
  if (!p.unmapped.empty())
    return fmt::format("cairn reconstruct {} -o {} --no-mesh --reintegrate{}", in("parts/" + p.unmapped[0]),
                       in("maps/" + p.unmapped[0]), first_of(p.unmapped.size(), "segments"));
  if (!p.unmatched.empty()) {
    const auto& [a, b] = p.unmatched[0];
    return fmt::format("cairn match {} {} -o {}{}", in("maps/" + a), in("maps/" + b),
                       in("loops/" + a + "-" + b + ".json"), first_of(p.unmatched.size(), "pairs"));
  }
  if (p.is_stale) return "cairn optimize " + plan;
  if (!p.untiled.empty())
    return fmt::format("cairn tile {} --cell={} -o {}{}", plan, p.untiled[0], in("tiles/" + p.untiled[0]),
                       first_of(p.untiled.size(), "cells"));
  if (!is_up_to_date(folder / "tileset.json", folder / "report.json"))
    return fmt::format("cairn tileset {} -o {}", plan, in("tileset.json"));
  return "cairn view " + plan;
}

std::string state_of(const ProjectProgress& p, const std::string& segment) {
  if (std::ranges::count(p.failed, segment) > 0) return "its run failed";
  if (std::ranges::count(p.unmapped, segment) > 0) return "has no map yet";
  if (!p.merged) return "has a map";
  const auto found = std::ranges::find(*p.merged, segment, &MergedSegment::name);
  if (found == p.merged->end()) return "has a map, not merged yet";
  return found->left_out.empty() ? "is in the map" : "is left out: " + found->left_out;
}

Json json_of(const fs::path& folder, const ProjectProgress& p) {
  Json recordings = Json::array(), parts = Json::array();
  std::int64_t frames = 0;
  for (const auto& r : p.project.recordings) {
    recordings.push_back({{"name", r.name}, {"frames", r.frames}});
    frames += r.frames;
  }
  for (const auto& segment : p.project.segments)
    parts.push_back({{"name", segment.name},
                     {"recording", segment.recording},
                     {"begin", segment.begin},
                     {"end", segment.end},
                     {"state", state_of(p, segment.name)}});
  Json json{{"plan", folder.string()},
            {"frames", frames},
            {"recordings", recordings},
            {"parts", parts},
            {"maps", {{"made", p.mapped.size()}, {"failed", p.failed.size()}, {"missing", p.unmapped.size()}}},
            {"pairs", {{"made", p.pairs.size() - p.unmatched.size()}, {"missing", p.unmatched.size()}}},
            {"cells", {{"count", p.cells.size()}, {"made", p.cells.size() - p.untiled.size()}}}};
  if (p.merged) json["verdict"] = to_json(verdict_of(p.project, *p.merged));
  json["next"] = next_command(folder, p);
  return json;
}

void print(const fs::path& folder, const ProjectProgress& p) {
  const auto line = [](const char* name, const std::string& text) { fmt::print("{:<16}{}\n", name, text); };
  std::uint64_t frames = 0;
  for (const auto& r : p.project.recordings) frames += static_cast<std::uint64_t>(r.frames);
  line("project", fmt::format("{} recordings, {} frames, {} segments", p.project.recordings.size(),
                              format_count(frames), p.project.segments.size()));
  const auto recording_names = short_names(recordings_in(folder));
  for (const auto& segment : p.project.segments)
    line(("segment " + segment.name).c_str(),
         fmt::format("{}, frames {} to {}: {}", recording_names.at(segment.recording), segment.begin, segment.end - 1,
                     state_of(p, segment.name)));
  line("maps", fmt::format("{} made, {} failed, {} missing", p.mapped.size(), p.failed.size(), p.unmapped.size()));
  line("pairs", fmt::format("{} matched, {} missing", p.pairs.size() - p.unmatched.size(), p.unmatched.size()));
  if (p.merged)
    line("cells",
         fmt::format("{}, {} made, {} missing", p.cells.size(), p.cells.size() - p.untiled.size(), p.untiled.size()));
  if (p.merged) apps::print(verdict_of(p.project, *p.merged), stdout);
  fmt::print("next: {}\n", next_command(folder, p));
}

struct InternalFile {
  std::string what, remedy;
};

/// Kind of the file or folder at `name` below `home`, a project.
std::optional<InternalFile> internal_file(const fs::path& home, const fs::path& name) {
  const std::string plan = quoted(home.string()), first = name.begin()->string(), filename = name.filename().string();
  const bool is_itself = std::next(name.begin()) == name.end();
  const std::string info = "cairn info " + plan + " reports on the project";
  if (first == "cells")
    return is_itself ? InternalFile{"is the folder of a project's cells", info}
                     : InternalFile{"is a cell of a project, a list of its sources",
                                    "build it with cairn tile, or use the project: " + info};
  if (first == "loops")
    return is_itself
               ? InternalFile{"is the folder of a project's matches", info}
               : InternalFile{"contains matches between two maps of a project", "cairn optimize " + plan + " uses it"};
  if (first == "tiles")
    return is_itself ? InternalFile{"is the folder of a project's tiles", "cairn view " + plan + " shows them"}
                     : InternalFile{
                           "is a cell of a project's map, as tiles and voxels",
                           fmt::format("cairn view {} shows it",
                                       quoted((home / "tiles" / *std::next(name.begin()) / "tileset.json").string()))};
  if ((first == "maps" || first == "parts") && is_itself)
    return InternalFile{"is the folder of a project's " + first, "use one of them, or the project: " + info};
  if (filename == "plan.json") return InternalFile{"is an internal file of a project", info};
  return std::nullopt;
}

}  // namespace

bool is_project_folder(const fs::path& folder) { return fs::exists(folder / "plan.json"); }

void print_project_info(const fs::path& plan, bool as_json) {
  const ProjectProgress progress = progress_of(plan);
  if (as_json)
    fmt::print("{}\n", format_json(json_of(plan, progress), 2));
  else
    print(plan, progress);
}

std::string next_project_command(const fs::path& plan) { return next_command(plan, progress_of(plan)); }

std::vector<std::string> missing_recordings(const fs::path& folder) {
  const Project project = read_plan(folder);
  const auto merged = merged_segments(folder);
  const auto recording_names = short_names(recordings_in(folder));
  std::set<std::size_t> missing;
  for (const auto& segment : project.segments) {
    if (!merged) continue;
    const auto found = std::ranges::find(*merged, segment.name, &MergedSegment::name);
    if (found == merged->end() || !found->left_out.empty()) missing.insert(segment.recording);
  }
  std::vector<std::string> names;
  names.reserve(missing.size());
  for (const std::size_t r : missing) names.push_back(recording_names.at(r));
  return names;
}

void refuse_internal_files(const fs::path& path) {
  std::error_code ignored;
  fs::path resolved = fs::weakly_canonical(path, ignored);
  if (ignored || !fs::exists(resolved) || is_project_folder(resolved)) return;
  for (fs::path home = resolved.parent_path(); home != home.parent_path(); home = home.parent_path())
    if (is_project_folder(home))
      if (const auto file = internal_file(home, resolved.lexically_relative(home)))
        throw std::runtime_error(fmt::format("{}: {}; {}", path.string(), file->what, file->remedy));
  if (resolved.filename() == "session" && fs::exists(resolved / "state.cbor"))
    throw std::runtime_error(fmt::format("{}: is the session of a map; use the map, {}", path.string(),
                                         quoted(resolved.parent_path().string())));
  if (resolved.extension() == ".g2o")
    throw std::runtime_error(fmt::format("{0}: is a pose graph; cairn graph optimize {1} reports on it", path.string(),
                                         quoted(path.string())));
}

}  // namespace cairn::apps
