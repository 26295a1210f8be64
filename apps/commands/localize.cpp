// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>

#include "base/atomic_file.hpp"
#include "cairn/io/live_source.hpp"
#include "cairn/mapping/localizer.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/durations.hpp"
#include "cli/exit_codes.hpp"
#include "cli/inputs_and_outputs.hpp"
#include "cli/interrupt.hpp"
#include "cli/json_text.hpp"
#include "cli/output_folder.hpp"
#include "cli/progress.hpp"
#include "cli/quantity.hpp"
#include "cli/reasons.hpp"
#include "cli/sources.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr const char* kStdout = "-";

struct Arguments {
  fs::path map, output, covariances, changes, camera, config, mask;
  std::string sequence, frames;
  std::vector<std::string> topics;
  int device = -1;
  bool json = false;
};

/// Poses of a run, with their cost.
struct Localized {
  Trajectory poses;
  std::string covariances;  // lines of --covariances
  int frames = 0, skipped = 0, relocalizations = 0;
  double open_seconds = 0;
  std::optional<double> first_pose_seconds;  // from the first frame
  Durations times;                           // milliseconds of the frames with a pose
  Reasons reasons;                           // of frames without a pose
};

std::string tum_line(const LocalizedFrame& frame) {
  const Eigen::Vector3d t = frame.world_from_camera->translation();
  Eigen::Quaterniond q(frame.world_from_camera->linear());
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  return fmt::format("{:.6f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n", frame.timestamp, t.x(), t.y(), t.z(),
                     q.x(), q.y(), q.z(), q.w());
}

constexpr const char* kCovarianceHeader =
    "# timestamp, then the upper triangle of the covariance, row by row: rotation x y z, translation x y z in the "
    "camera's frame; rad^2, rad m, m^2\n";

std::string covariance_line(const LocalizedFrame& frame) {
  std::string line = fmt::format("{:.6f}", frame.timestamp);
  for (int row = 0; row < 6; ++row)
    for (int column = row; column < 6; ++column) line += fmt::format(",{:.6g}", (*frame.covariance)(row, column));
  return line + "\n";
}

void add(const Arguments& a, const LocalizedFrame& frame, Localized& to) {
  ++to.frames;
  if (!frame.world_from_camera) {
    const bool is_skipped = frame.fit.iterations == 0 && frame.guess == InitialGuess::none;
    to.skipped += is_skipped;
    to.reasons.add(frame.index, frame.reason);
    return;
  }
  to.relocalizations += frame.guess == InitialGuess::relocalized;
  to.times.add(frame.milliseconds);
  to.poses.push_back({frame.timestamp, *frame.world_from_camera});
  if (!a.covariances.empty()) to.covariances += covariance_line(frame);
  if (a.output == kStdout) {
    fmt::print("{}", tum_line(frame));
    std::fflush(stdout);
  }
}

/// Frames in order: of a sensor the newest, of a recording all.
std::unique_ptr<Source> with_pace(const Arguments& a, std::unique_ptr<Source> source) {
  if (is_sensor(a.sequence)) return std::make_unique<LiveSource>(std::move(source), Pace::as_it_comes);
  return read_ahead(std::move(source));
}

LocalizerOptions localizer_options(const Arguments& a, const Source& source) {
  Options options;
  if (source.has_assumed_rate()) options.motion = motion_of("unknown");
  if (!a.config.empty()) read_options(a.config, options);
  return {.track = options.track, .motion = options.motion, .changes = !a.changes.empty()};
}

void localize_frames(const Arguments& a, Source& source, Localizer& localizer, Localized& to) {
  Interrupt interrupt(Interrupt::Graceful::later);
  Progress progress(source.size());
  std::optional<Clock::time_point> first;
  while (!interrupt.requested()) {
    const auto frame = source.next();
    if (!frame) break;
    if (!first) first = Clock::now();
    const LocalizedFrame localized = localizer.add(*frame);
    if (localized.world_from_camera && !to.first_pose_seconds)
      to.first_pose_seconds = milliseconds(Clock::now() - *first) / 1000;
    add(a, localized, to);
    if (localized.world_from_camera) interrupt.allow_graceful_exit();
    progress.step(localized.world_from_camera ? "localized" : "LOST: " + localized.reason);
  }
}

nlohmann::json to_json(const ExportedChange& changes) {
  auto regions = nlohmann::json::array();
  for (const ChangedRegion& region : changes.regions)
    regions.push_back({{"kind", region.is_new ? "new" : "gone"},
                       {"area_m2", region.area},
                       {"middle_m", {region.middle.x(), region.middle.y(), region.middle.z()}}});
  return {{"new_m2", changes.new_area}, {"gone_m2", changes.gone_area}, {"regions", regions}};
}

void print(const Arguments& a, const Localized& l, const std::optional<ExportedChange>& changes) {
  const auto found = l.poses.size();
  const double rate = l.times.total() > 0 ? 1000 * static_cast<double>(l.times.count()) / l.times.total() : 0;
  if (a.json) {
    nlohmann::json json{{"frames", l.frames},
                        {"localized", found},
                        {"skipped", l.skipped},
                        {"relocalizations", l.relocalizations},
                        {"open_s", l.open_seconds},
                        {"frame_ms", {{"median", l.times.percentile(0.5)}, {"p95", l.times.percentile(0.95)}}},
                        {"rate_hz", rate}};
    json["first_pose_s"] = l.first_pose_seconds ? nlohmann::json(*l.first_pose_seconds) : nlohmann::json();
    if (changes) json["changes"] = to_json(*changes);
    fmt::print("{}\n", format_json(json, 2));
    return;
  }
  if (a.output == kStdout) return;
  if (changes)
    print_result("{}  new {:.2f} m2, gone {:.2f} m2\n", a.changes.string(), changes->new_area, changes->gone_area);
  print_result("{}  {} of {} frames localized ({:.0f} %){}, {:.0f} frames/s\n", a.output.string(), found, l.frames,
               100.0 * static_cast<double>(found) / std::max(1, l.frames),
               l.first_pose_seconds ? fmt::format(", the first after {:.2f} s", *l.first_pose_seconds) : "", rate);
}

/// Throws std::runtime_error if an output is an input, or has no folder.
void check_outputs(const Arguments& a) {
  if (a.json && a.output == kStdout)
    throw CLI::ValidationError("--json", "and -o - both print to stdout: name a file for the poses");
  Inputs inputs;
  inputs.add_map(a.map).add_recording(a.sequence).add(a.camera).add(a.config).add(a.mask);
  for (const fs::path* file : {&a.output, &a.covariances, &a.changes}) {
    if (file->empty() || *file == kStdout) continue;
    inputs.check_output_file(*file);
    if (fs::is_directory(*file)) throw std::runtime_error(file->string() + ": is a folder; name a file");
    if (const fs::path folder = file->parent_path(); !folder.empty()) prepare_output(folder);
  }
}

void localize(const Arguments& a) {
  check_outputs(a);
  SourceOptions source_of = source_options(a.sequence, a.camera, a.topics);
  source_of.range = parse_frames(a.frames);
  auto opened = masked(open_source(a.sequence, source_of), a.mask, a.sequence);
  const LocalizerOptions options = localizer_options(a, *opened);
  Localized l;
  const auto start = Clock::now();
  Localizer localizer(a.map, opened->rig(), options, a.device);
  l.open_seconds = milliseconds(Clock::now() - start) / 1000;
  const auto source = with_pace(a, std::move(opened));
  localize_frames(a, *source, localizer, l);
  for (const std::string& warning : localizer.warnings()) spdlog::warn(warning);
  for (const std::string& line : l.reasons.lines(l.frames, "without a pose")) spdlog::warn(line);
  const auto ended = source->ended_early();
  if (l.frames == 0) throw std::runtime_error(a.sequence + ": contains no frame" + (ended ? "; " + *ended : ""));
  std::optional<ExportedChange> changes;
  if (!l.poses.empty()) {
    if (a.output != kStdout) write_trajectory(a.output, l.poses);
    if (!a.covariances.empty()) write_whole(a.covariances, kCovarianceHeader + l.covariances);
    Progress progress(std::nullopt, "");
    if (!a.changes.empty()) changes = localizer.export_changes(a.changes, {}, export_progress(progress));
  }
  print(a, l, changes);
  if (ended) throw std::runtime_error(*ended + "; the frames before are localized");
  if (2 * l.poses.size() < static_cast<std::size_t>(l.frames)) throw CLI::RuntimeError(kNotInMap);
}

}  // namespace

void add_localize(CLI::App& program) {
  auto* command = program.add_subcommand("localize", "Find the camera in a map, which stays unchanged");
  const auto a = std::make_shared<Arguments>();
  command->add_option("MAP", a->map, "Folder of a map with its session")->required()->check(CLI::ExistingDirectory);
  command->add_option("SEQUENCE", a->sequence, kSequenceHelp)->required()->type_name(kPath);
  command
      ->add_option("-o,--output", a->output,
                   "Poses of the localized frames in the frame of MAP/trajectory.txt, in the TUM format; -: to stdout, "
                   "each at once")
      ->required()
      ->type_name(kFile);
  command->add_option("--covariances", a->covariances, "X.csv: covariance of each pose, relative to the map")
      ->type_name(kFile);
  command
      ->add_option("--changes", a->changes,
                   "X.glb, X.gltf: seen surface in gray, surface new since the map in blue, gone surface in orange")
      ->type_name(kFile);
  add_camera(*command, a->camera, "in place of the recording's own cameras");
  add_topics(*command, a->topics);
  command->add_option("--frames", a->frames, kFramesHelp)->type_name("RANGE");
  add_mask(*command, a->mask);
  command->add_option("--config", a->config, "YAML file with options of tracking and motion")->check(CLI::ExistingFile);
  add_device(*command, a->device);
  command->add_flag("--json", a->json, "Print a summary to stdout as JSON");
  command->callback([a] { localize(*a); });
}

}  // namespace cairn::apps
