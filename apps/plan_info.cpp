// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "plan_info.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>

#include "cairn/parts.hpp"
#include "cairn/quoted.hpp"
#include "command_line.hpp"
#include "console.hpp"
#include "json_text.hpp"
#include "outputs.hpp"
#include "recording_names.hpp"
#include "run.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// State of a plan.
struct Progress {
  PartsPlan plan;
  std::optional<std::vector<JoinedPart>> joined;
  std::vector<std::string> mapped, failed, unmapped;                  // parts
  std::vector<std::pair<std::string, std::string>> pairs, unmatched;  // of parts with maps
  std::vector<std::string> cells, untiled;                            // X,Y,Z
  bool is_stale = false;                                              // a map is newer than the result of optimise
};

fs::path loops_of(const fs::path& plan, const std::pair<std::string, std::string>& pair) {
  return plan / "loops" / (pair.first + "-" + pair.second + ".json");
}

/// Returns true if a file exists and is not older than its source.
bool is_made(const fs::path& file, const fs::path& from) {
  std::error_code none;
  const auto made = fs::last_write_time(file, none);
  if (none) return false;
  const auto begun = fs::last_write_time(from, none);
  return none || made >= begun;
}

void find_maps(const fs::path& folder, Progress& p) {
  for (const auto& part : p.plan.parts) {
    const fs::path map = folder / "maps" / part.name;
    const bool has_map = fs::exists(map / "session" / "state.cbor");
    (fs::exists(map / "failed.txt") ? p.failed : has_map ? p.mapped : p.unmapped).push_back(part.name);
  }
  for (std::size_t b = 0; b < p.mapped.size(); ++b)
    for (std::size_t a = 0; a < b; ++a) {
      p.pairs.emplace_back(p.mapped[a], p.mapped[b]);
      if (!fs::exists(loops_of(folder, p.pairs.back()))) p.unmatched.push_back(p.pairs.back());
    }
}

Progress progress_of(const fs::path& folder) {
  Progress p{.plan = read_plan(folder), .joined = joined_parts(folder)};
  find_maps(folder, p);
  for (const auto& [x, y, z] : cells_of(folder)) {
    p.cells.push_back(fmt::format("{},{},{}", x, y, z));
    const std::string& cell = p.cells.back();
    if (!is_made(folder / "tiles" / cell / "tileset.json", folder / "cells" / (cell + ".json")))
      p.untiled.push_back(cell);
  }
  p.is_stale = !p.joined;
  for (const std::string& part : p.mapped)
    p.is_stale = p.is_stale || !is_made(folder / "report.json", folder / "maps" / part / "session" / "state.cbor");
  for (const auto& pair : p.pairs) p.is_stale = p.is_stale || !is_made(folder / "report.json", loops_of(folder, pair));
  return p;
}

std::string first_of(std::size_t count, const char* things) {
  return count > 1 ? fmt::format("  (the first of {} {})", count_in_words(count), things) : "";
}

std::string next_of(const fs::path& folder, const Progress& p) {
  const std::string plan = quoted(folder.string());
  const auto in = [&](const std::string& name) { return quoted((folder / name).string()); };
  if (!p.unmapped.empty())
    return fmt::format("cairn reconstruct {} -o {} --no-mesh --reintegrate{}", in("parts/" + p.unmapped[0]),
                       in("maps/" + p.unmapped[0]), first_of(p.unmapped.size(), "parts"));
  if (!p.unmatched.empty()) {
    const auto& [a, b] = p.unmatched[0];
    return fmt::format("cairn match {} {} -o {}{}", in("maps/" + a), in("maps/" + b),
                       in("loops/" + a + "-" + b + ".json"), first_of(p.unmatched.size(), "pairs"));
  }
  if (p.is_stale) return "cairn optimise " + plan;
  if (!p.untiled.empty())
    return fmt::format("cairn tile {} --cell={} -o {}{}", plan, p.untiled[0], in("tiles/" + p.untiled[0]),
                       first_of(p.untiled.size(), "cells"));
  if (!is_made(folder / "tileset.json", folder / "report.json"))
    return fmt::format("cairn tileset {} -o {}", plan, in("tileset.json"));
  return "cairn view " + plan;
}

std::string state_of(const Progress& p, const std::string& part) {
  if (std::ranges::count(p.failed, part) > 0) return "its run failed";
  if (std::ranges::count(p.unmapped, part) > 0) return "has no map yet";
  if (!p.joined) return "has a map";
  const auto found = std::ranges::find(*p.joined, part, &JoinedPart::name);
  if (found == p.joined->end()) return "has a map, which is not put together yet";
  return found->left_out.empty() ? "is in the map" : "is left out: " + found->left_out;
}

Json json_of(const fs::path& folder, const Progress& p) {
  Json recordings = Json::array(), parts = Json::array();
  std::int64_t frames = 0;
  for (const auto& r : p.plan.recordings) {
    recordings.push_back({{"name", r.name}, {"frames", r.frames}});
    frames += r.frames;
  }
  for (const auto& part : p.plan.parts)
    parts.push_back({{"name", part.name},
                     {"recording", part.recording},
                     {"begin", part.begin},
                     {"end", part.end},
                     {"state", state_of(p, part.name)}});
  Json told{{"plan", folder.string()},
            {"frames", frames},
            {"recordings", recordings},
            {"parts", parts},
            {"maps", {{"made", p.mapped.size()}, {"failed", p.failed.size()}, {"missing", p.unmapped.size()}}},
            {"pairs", {{"made", p.pairs.size() - p.unmatched.size()}, {"missing", p.unmatched.size()}}},
            {"cells", {{"count", p.cells.size()}, {"made", p.cells.size() - p.untiled.size()}}}};
  if (p.joined) told["verdict"] = to_json(verdict_of(p.plan, *p.joined));
  told["next"] = next_of(folder, p);
  return told;
}

void print(const fs::path& folder, const Progress& p) {
  const auto line = [](const char* name, const std::string& text) { fmt::print("{:<16}{}\n", name, text); };
  std::uint64_t frames = 0;
  for (const auto& r : p.plan.recordings) frames += static_cast<std::uint64_t>(r.frames);
  line("plan of", fmt::format("{} recordings, {} frames, in {} parts", p.plan.recordings.size(), count_in_words(frames),
                              p.plan.parts.size()));
  const auto apart = told_apart(recordings_in(folder));
  for (const auto& part : p.plan.parts)
    line(("part " + part.name).c_str(), fmt::format("{}, frames {} to {}: {}", apart.at(part.recording), part.begin,
                                                    part.end - 1, state_of(p, part.name)));
  line("maps", fmt::format("{} made, {} failed, {} missing", p.mapped.size(), p.failed.size(), p.unmapped.size()));
  line("pairs", fmt::format("{} matched, {} missing", p.pairs.size() - p.unmatched.size(), p.unmatched.size()));
  if (p.joined)
    line("cells",
         fmt::format("{}, {} made, {} missing", p.cells.size(), p.cells.size() - p.untiled.size(), p.untiled.size()));
  if (p.joined) apps::print(verdict_of(p.plan, *p.joined), stdout);
  fmt::print("next: {}\n", next_of(folder, p));
}

struct Piece {
  std::string what, remedy;
};

/// Kind of the file or folder at `name` below `home`, a plan.
std::optional<Piece> piece_of_plan(const fs::path& home, const fs::path& name) {
  const std::string plan = quoted(home.string()), first = name.begin()->string(), own = name.filename().string();
  const bool is_itself = std::next(name.begin()) == name.end();
  const std::string info = "cairn info " + plan + " reports on the plan";
  if (first == "cells")
    return is_itself ? Piece{"is the folder of a plan's cells", info}
                     : Piece{"is a cell of a plan, a list of what it is made of",
                             "make it with cairn tile, or give the plan: " + info};
  if (first == "loops")
    return is_itself ? Piece{"is the folder of a plan's matches", info}
                     : Piece{"holds matches between two maps of a plan", "cairn optimise " + plan + " uses it"};
  if (first == "tiles")
    return is_itself
               ? Piece{"is the folder of a plan's tiles", "cairn view " + plan + " shows them"}
               : Piece{"is a cell of a plan's map, as tiles and voxels",
                       fmt::format("cairn view {} shows it",
                                   quoted((home / "tiles" / *std::next(name.begin()) / "tileset.json").string()))};
  if ((first == "maps" || first == "parts") && is_itself)
    return Piece{"is the folder of a plan's " + first, "give one of them, or the plan: " + info};
  if (own == "plan.json") return Piece{"is a plan's own file", info};
  return std::nullopt;
}

}  // namespace

bool holds_plan(const fs::path& folder) { return fs::exists(folder / "plan.json"); }

void print_plan_info(const fs::path& plan, bool as_json) {
  const Progress progress = progress_of(plan);
  if (as_json)
    fmt::print("{}\n", text_of(json_of(plan, progress), 2));
  else
    print(plan, progress);
}

std::string next_of_plan(const fs::path& plan) { return next_of(plan, progress_of(plan)); }

std::vector<std::string> missing_recordings(const fs::path& folder) {
  const PartsPlan plan = read_plan(folder);
  const auto joined = joined_parts(folder);
  const auto apart = told_apart(recordings_in(folder));
  std::set<std::size_t> missing;
  for (const auto& part : plan.parts) {
    if (!joined) continue;
    const auto found = std::ranges::find(*joined, part.name, &JoinedPart::name);
    if (found == joined->end() || !found->left_out.empty()) missing.insert(part.recording);
  }
  std::vector<std::string> names;
  names.reserve(missing.size());
  for (const std::size_t r : missing) names.push_back(apart.at(r));
  return names;
}

void refuse_pieces(const fs::path& path) {
  std::error_code ignored;
  fs::path whole = fs::weakly_canonical(path, ignored);
  if (ignored || !fs::exists(whole) || holds_plan(whole)) return;
  for (fs::path home = whole.parent_path(); home != home.parent_path(); home = home.parent_path())
    if (holds_plan(home))
      if (const auto piece = piece_of_plan(home, whole.lexically_relative(home)))
        throw std::runtime_error(fmt::format("{}: {}; {}", path.string(), piece->what, piece->remedy));
  if (whole.filename() == "session" && fs::exists(whole / "state.cbor"))
    throw std::runtime_error(fmt::format("{}: is the session of a map; give the map, {}", path.string(),
                                         quoted(whole.parent_path().string())));
  if (whole.extension() == ".g2o")
    throw std::runtime_error(fmt::format("{0}: is a pose graph; cairn graph optimise {1} reports on it", path.string(),
                                         quoted(path.string())));
}

}  // namespace cairn::apps
