// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/run.hpp"

#include <fmt/color.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <utility>

#include "base/quoted.hpp"
#include "cairn/building/project.hpp"
#include "cairn/mapping/mesh.hpp"
#include "cli/command_line.hpp"
#include "cli/command_tree.hpp"
#include "cli/console.hpp"
#include "cli/exit_codes.hpp"
#include "cli/flags.hpp"
#include "cli/json_text.hpp"
#include "cli/outputs.hpp"
#include "cli/quantity.hpp"
#include "cli/sources.hpp"
#include "options/option_ranges.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;
constexpr int kMaxColorlessFrames = 30;   // frames without color after which a recording counts as colorless
constexpr double kMinInlierRatio = 0.45;  // same limit as on the live page
constexpr std::uintmax_t kMaxComparedSize = std::uintmax_t{256}
                                            << 20;  // bytes; limit for comparing a mesh with the frames

constexpr double kMaxMebibytes = 1 << 24;       // 16 TiB
constexpr double kMaxCheckpointInterval = 1e6;  // seconds between two checkpoints

nlohmann::json to_json(const FrameReport& r) {
  nlohmann::json j{{"index", r.index}, {"timestamp", r.timestamp}, {"state", to_string(r.state)}};
  if (!r.reason.empty()) j["reason"] = r.reason;
  if (r.fit.iterations > 0)
    j.update({{"inlier_share", r.fit.inlier_share},
              {"overlap", r.fit.overlap},
              {"rmse", r.fit.rmse},
              {"iterations", r.fit.iterations},
              {"photometric_share", r.fit.photometric_share},
              {"photometric_rmse", r.fit.photometric_rmse},
              {"degenerate_directions", r.fit.degenerate_directions},
              {"unobserved", r.fit.unobserved},
              {"moving", r.moving},
              {"guess", to_string(r.guess)}});
  if (r.touched_bricks > 0) j.update({{"touched_bricks", r.touched_bricks}, {"new_bricks", r.new_bricks}});
  j["ms"] = r.stage_ms;
  return j;
}

/// Returns true if a run can be resumed.
bool has_state(const fs::path& output) { return fs::exists(output / "session" / "state.cbor"); }

nlohmann::json to_json(const PoseCheck& c) {
  nlohmann::json j{{"pairs", c.pairs}, {"contradicted", c.contradicts}};
  if (c.pairs > 0) j.update({{"agree", c.as_given}, {"agree_if_motionless", c.motionless}});
  if (c.contradicts && c.is_likely)
    j["likely"] = {{"convention", to_string(c.likely)}, {"agree", c.explained}, {"only", c.is_only}};
  return j;
}

/// Calibration found by the run in words; empty: none.
std::string calibration_words(const nlohmann::json& report) {
  std::vector<std::string> found;
  const nlohmann::json calibration = report.value("calibration", nlohmann::json::object());
  if (calibration.value("depth_corrected", false)) found.emplace_back("depth corrected");
  if (const double readout = calibration.value("readout", 0.0); readout > 0)
    found.push_back(fmt::format("readout {:.1f} ms", 1000 * readout));
  if (const double clock = report["clock_offset"]; clock != 0)
    found.push_back(fmt::format("clock {:+.1f} ms", 1000 * clock));
  return fmt::format("{}", fmt::join(found, ", "));
}

/// A resumed run keeps the previous log and writes X-2.mcap, X-3.mcap, ...
fs::path log_file(const RunArguments& a) {
  fs::path file = a.log;
  if (a.resume)
    for (int number = 2; fs::exists(file); ++number)
      file.replace_filename(fmt::format("{}-{}{}", a.log.stem().string(), number, a.log.extension().string()));
  if (file != a.log) fmt::print(stderr, "log         {} ({} exists)\n", file.string(), a.log.string());
  return file;
}

}  // namespace

std::string to_string(const FrameReport& r, bool verbose) {
  switch (r.state) {
    case FrameState::fused: {
      if (r.fit.iterations == 0) return "tracking starts";
      std::string text = "tracking well";
      if (r.fit.inlier_share < kMinInlierRatio)
        text = fmt::format("tracking is weak: only {:.0f} % of the view fits the map", 100 * r.fit.inlier_share);
      else if (r.fit.unobserved > 0)
        text = "tracking is weak: the view does not constrain all directions";
      if (!verbose) return text;
      return text + fmt::format(", {:.0f} % inliers within {:.1f} sigma", 100 * r.fit.inlier_share, r.fit.rmse) +
             (r.guess == InitialGuess::motion ? "" : fmt::format(", guess: {}", to_string(r.guess))) +
             (r.fit.degenerate_directions > 0
                  ? fmt::format(", color constrains {} of 6 directions", r.fit.degenerate_directions)
                  : "") +
             (r.fit.unobserved > 0 ? fmt::format(", {} follow the previous motion", r.fit.unobserved) : "");
    }
    case FrameState::held_out:
      return "held out";
    case FrameState::lost:
      return "LOST: " + r.reason;
    case FrameState::skipped:
      return "skipped: " + r.reason;
  }
  return {};
}

double peak_memory_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

std::string RunProgress::note() const {
  return format_json({{"recording", recording},
                      {"next", next},
                      {"hold_out", to_json(hold_out)},
                      {"judges", judges},
                      {"improved", improved},
                      {"frames", frames.save()},
                      {"evidence", evidence}});
}

RunProgress RunProgress::from(const std::string& note) {
  const auto j = parsed_json(note);
  return {.recording = j.at("recording"),
          .next = j.at("next"),
          .hold_out = j.contains("hold_out") ? hold_out_from(j["hold_out"]) : HoldOut{},
          .judges = j.value("judges", false),
          .improved = j.value("improved", false),
          .frames = FrameLog::from(j.at("frames")),
          .evidence = j.value("evidence", "")};
}

Inputs inputs_of(const RunArguments& a) { return Inputs().add_recording(a.sequence).add(a.config).add(a.camera); }

SourceOptions source_options(const RunArguments& a, const FrameRange& range) {
  SourceOptions options = source_options(a.sequence, a.camera, a.topics);
  options.range = range;
  if (a.sensor) options.sensor = sensor_model(*a.sensor);
  return options;
}

Options options_of(const RunArguments& a, const SensorModel& sensor, bool has_assumed_rate, int finest_level) {
  Options options = options_for(sensor);
  options.track.finest_level = finest_level;
  options.motion = motion_of(a.motion.value_or(has_assumed_rate ? "unknown" : "hand"));
  options.track.device_poses = device_poses_of(a.device_poses);
  if (!a.config.empty()) read_options(a.config, options);
  if (a.voxel_size) {
    options.fuse.voxel_size = *a.voxel_size;
    options.fuse.truncation = options_for(sensor, *a.voxel_size).fuse.truncation;
  }
  if (a.device_memory_mib) options.fuse.device_memory = *a.device_memory_mib << 20;
  if (a.host_memory_mib) options.map.host_memory = *a.host_memory_mib << 20;
  if (a.no_loops) options.map.loops = false;
  options.esdf.live = options.esdf.live || a.esdf;
  if (a.esdf_voxel_size) options.esdf.voxel_size = *a.esdf_voxel_size;
  if (a.max_distance) options.esdf.max_distance = *a.max_distance;
  if (a.robot_radius) options.esdf.robot_radius = *a.robot_radius;
  options.keep_keyframes = a.mesh.texture_requested;
  if (a.up) options.up = parse_up(*a.up);
  check(a.mesh.for_file("mesh.glb"), a.output / "mesh.glb");
  check(options);
  if (a.mesh.clean.min_weight > options.fuse.max_weight)
    throw std::runtime_error(fmt::format(
        "--min-weight is {}: this removes the full surface, since the weight of a voxel is at most fuse.max_weight, {}",
        a.mesh.clean.min_weight, options.fuse.max_weight));
  return options;
}

ResumePoint resume_point(const RunArguments& a, FrameRange range) {
  const int first = first_index(a.sequence);
  ResumePoint begin{.progressed = {.recording = identity(a.sequence, source_options(a.sequence, a.camera, a.topics)),
                                   .hold_out = {.every = a.hold_out.value_or(0), .range = range}},
                    .range = range};
  begin.progressed.hold_out.range.begin += first;
  if (!a.resume) return begin;
  RunProgress before;
  const std::string note = Session::info(a.output / "session").note;
  try {
    before = RunProgress::from(note);
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}: is damaged ({}); reconstruct again without --resume",
                                         (a.output / "session").string(), strip_json_prefix(error.what())));
  }
  begin.is_next_recording = before.recording != begin.progressed.recording || is_sensor(a.sequence);
  if (!begin.is_next_recording) {
    if (const int every = before.judges ? 0 : before.hold_out.every; a.hold_out && *a.hold_out != every)
      throw std::runtime_error(fmt::format(
          "--hold-out {}: {} was started with {}; resume without the option, or start again with --overwrite",
          *a.hold_out, (a.output / "session").string(),
          every == 0 ? "no held-out frames" : fmt::format("--hold-out {}", every)));
    begin.progressed = std::move(before);
    while (first + begin.range.begin < begin.progressed.next) begin.range.begin += begin.range.step;
  }
  return begin;
}

Run::Run(RunArguments arguments, const Options& options, Poses poses, const Rig& rig, RunProgress progressed,
         bool is_next_recording)
    : arguments_(std::move(arguments)),
      options_(options),
      poses_(poses),
      rig_(rig),
      previous_(std::move(progressed)),
      is_next_recording_(is_next_recording),
      progressed_(previous_),
      evidence_(rig_, options_) {
  evidence_.restore(previous_.evidence);
  prepare();
  if (poses_ == Poses::given) replaced_.emplace(arguments_.output / "session");
  create_map();
  evidence_.begin_recording(mapper_->recordings() - 1);
  if (!arguments_.resume) {  // another run may have finished in the folder since its name was chosen
    OutputArguments output_arguments = arguments_;
    output_arguments.auto_name = false;
    (void)choose_output(output_arguments, poses_ == Poses::tracked);
  }
  if (!arguments_.log.empty()) log_.emplace(log_file(arguments_), arguments_.overwrite);
  log([&](RunLog& log) { log.begin(*mapper_, rig_); });
}

void Run::create_map() {
  mapper_.reset();
  const fs::path session = arguments_.output / "session";
  if (poses_ == Poses::given) {
    mapper_.emplace(rig_, options_, poses_, arguments_.device);
    return;
  }
  if (!arguments_.resume) {
    session_.reset();
    session_.emplace(Session::create(session));
  } else if (session_) {
    session_->return_to_start();
  } else {
    session_.emplace(Session::resume(session, arguments_.may_be_reset));
  }
  mapper_.emplace(session_->mapper(rig_, options_, arguments_.device));
  if (arguments_.resume && is_next_recording_) mapper_->begin_recording();
}

void Run::reset() {
  create_map();
  log([&](RunLog& log) { log.begin(*mapper_, rig_); });
  printed_warnings_ = 0;
  progressed_.frames = previous_.frames;
  evidence_ = RunMonitor(rig_, options_);
  evidence_.restore(previous_.evidence);
  evidence_.begin_recording(mapper_->recordings() - 1);
  stages_.clear();
}

FrameReport Run::add(const Frame& frame, double waited_ms) {
  if (arguments_.mesh.texture_requested && !arguments_.resume && !frame.problem && !has_color_) {
    has_color_ = !frame.color.empty();
    if (!has_color_ && ++colorless_ == kMaxColorlessFrames)
      throw std::runtime_error(
          fmt::format("{}: the first {} frames have no color, which a texture needs: omit --texture",
                      arguments_.sequence, kMaxColorlessFrames));
  }
  FrameReport report;
  try {
    report = mapper_->add(frame);
  } catch (const std::exception& error) {
    if (progressed_.frames.count("fused") == 0) throw;
    stopped_ = fmt::format("{}: frame {}: {}", arguments_.sequence, progressed_.next, error.what());
    return report;
  }
  print_warnings();
  timed("evidence", [&] { evidence_.add(frame, report); });
  log([&](RunLog& log) { timed("log", [&] { log.add(frame, report); }); });
  report.stage_ms["wait for decoding"] = waited_ms;
  for (const auto& [stage, ms] : report.stage_ms) stages_[stage].add(ms);
  progressed_.next = report.index + 1;
  progressed_.improved = false;
  progressed_.frames.add(to_json(report));
  if (std::chrono::duration<double>(Clock::now() - saved_).count() >= arguments_.checkpoint_seconds) {
    checkpoint();
  }
  return report;
}

void Run::prepare() {
  const fs::path& output = arguments_.output;
  const auto add_unfinished = [&](const fs::path& path, Unfinished::Kind kind) {
    if (!fs::exists(path)) unfinished_.emplace_back(path, kind);
  };
  add_unfinished(output, Unfinished::Kind::empty);
  prepare_output(output);
  add_unfinished(output / "session", Unfinished::Kind::all);  // with given poses, only for the lock
}

void Run::checkpoint() {
  progressed_.evidence = evidence_.save();
  if (session_) session_->checkpoint(*mapper_, progressed_.note());
  if (has_state(arguments_.output)) unfinished_.clear();
  saved_ = Clock::now();
}

void Run::timed(const char* stage, const std::function<void()>& work) {
  const auto begin = Clock::now();
  work();
  add_time(stage, milliseconds(Clock::now() - begin));
}

void Run::add_time(const std::string& stage, double milliseconds) { stages_[stage].add(milliseconds); }

void Run::warn(const std::string& message) {
  const std::string text = with_flag_names(message);
  spdlog::warn(text);
  warnings_.push_back(text);
  log([&](RunLog& log) { log.warn(text); });
}

void Run::log(const std::function<void(RunLog&)>& work) {
  if (!log_) return;
  work(*log_);
  if (const auto problem = log_->problem()) {
    log_.reset();
    warn(*problem);
  }
}

void Run::print_warnings() {
  while (printed_warnings_ < mapper_->warnings().size()) warn(mapper_->warnings()[printed_warnings_++]);
}

void Run::set_pose_check(const PoseCheck& check) {
  pose_check_ = check;
  if (!check.contradicts) return;
  const std::string text = to_string(check, "--poses");
  spdlog::warn(text);
  log([&](RunLog& log) { log.warn(text); });
}

void Run::interrupted(int left) { frames_left_ = left; }

void Run::interrupted_in(const std::string& stage) {
  if (frames_left_ || is_sensor(arguments_.sequence)) return;  // keep the first stage
  frames_left_ = 0;
  interrupted_stage_ = stage;
}

Verdict Run::judge(int components) const {
  const FrameLog& frames = progressed_.frames;
  const GravityAlignment upright = mapper_->upright();
  return evidence_.verdict({.total = frames.size() - held_out(),
                            .fused = frames.count("fused"),
                            .held_out = held_out(),
                            .components = components,
                            .focal = mapper_->statistics().focal,
                            .frame_rates = frame_rates_,
                            .upright_unknown = upright.source == GravityAlignment::Source::unknown
                                                   ? with_flag_names(upright.description)
                                                   : "",
                            .warnings = warnings_,
                            .poses = pose_check_});
}

/// Compares the map with the frames. Optional: a mesh that cannot be read is judged without this comparison.
void Run::compare_with_frames() {
  const fs::path mesh = arguments_.output / "mesh.glb";
  const double clock_offset = mapper_->statistics().clock_offset;
  if (!arguments_.no_mesh && fs::exists(mesh) && fs::file_size(mesh) <= kMaxComparedSize) try {
      std::vector<Trajectory> trajectories;
      trajectories.reserve(static_cast<std::size_t>(mapper_->recordings()));
      for (int i = 0; i < mapper_->recordings(); ++i) trajectories.push_back(mapper_->trajectory(i));
      evidence_.compare_with_map(read_mesh_parts(mesh), trajectories, clock_offset, mapper_->rig().depth_correction);
    } catch (const std::exception& error) {
      warn(fmt::format("the map is not compared with the frames: {}", error.what()));
    }
  if (device_poses_.empty()) return;
  Trajectory tracked = mapper_->trajectory();
  for (StampedPose& pose : tracked) pose.timestamp -= clock_offset;
  evidence_.compare_with_device(tracked, device_poses_, device_drift_);
}

std::string Run::resume_instructions() const {
  if (!session_) return "a run with --poses cannot be resumed; start again with --overwrite";
  return "resume with: " + resume_command(own_arguments(), arguments_.asked_output, arguments_.output);
}

std::function<std::string()> Run::exit_message() const {
  const fs::path state = arguments_.output / "session" / "state.cbor";
  std::error_code none;
  std::optional<fs::file_time_type> old;  // of the session replaced by this run
  if (!arguments_.resume && fs::exists(state, none)) old = fs::last_write_time(state, none);
  return [=, go_on = resume_instructions(), output = arguments_.output, has_session = poses_ == Poses::tracked] {
    std::error_code error;
    if (!has_session || (fs::exists(state, error) && (!old || fs::last_write_time(state, error) != *old)))
      return "interrupted before all files were written; " + go_on;
    return fmt::format("cairn: interrupted before the first checkpoint; {} is unchanged", output.string());
  };
}

void Run::add_files(const MoreFiles& more_files, nlohmann::json& report) {
  try {
    Map map = mapper_->map();
    report.update(more_files(map));
  } catch (const std::exception& error) {
    warn(error.what());
  }
  report["warnings"] = warnings_;
}

Verdict Run::finish(const nlohmann::json& more, const MoreFiles& more_files) {
  const FrameLog& frames = progressed_.frames;
  const int total = frames.size();
  const std::string& sequence = arguments_.sequence;
  const fs::path& output = arguments_.output;
  if (frames.count("fused") == 0) {
    const Verdict verdict = judge(1);
    throw std::runtime_error(sequence + ": none of " + std::to_string(total) + " frames could be used" +
                             (total == 0 ? "" : "; the first: " + frames.first_reason().value_or("")) +
                             (total == 0 || verdict.reasons.empty() ? "" : "; " + verdict.reasons.front()));
  }
  // Printed with the verdict.
  for (const std::string& line : frames.skipped().lines(total, "skipped")) warnings_.push_back(with_flag_names(line));

  arguments_.mesh.source = (fs::exists(sequence) ? tidy(sequence) : fs::path(sequence)).filename().string();
  Outputs outputs(
      output, [this](const char* stage, const auto& work) { timed(stage, work); }, stopped_, !arguments_.no_mesh);
  unfinished_.clear();
  progressed_.evidence = evidence_.save();
  if (session_) session_->release_start();
  log([](RunLog& log) { log.finishing(); });
  nlohmann::json report = outputs.write(*mapper_, session_ ? &*session_ : nullptr, arguments_.mesh, progressed_.note());
  // With given poses there is no session; an earlier run's session belongs to another map.
  if (replaced_) replaced_->remove();
  if (arguments_.overwrite) outputs.remove_old(*mapper_, session_.has_value());

  print_warnings();
  for (const std::string& warning : outputs.warnings()) warn(warning);
  timed("evidence", [&] { compare_with_frames(); });
  Verdict verdict = judge(report["submaps"]["components"]);
  log([&](RunLog& log) { log.finish(verdict); });
  for (const std::string& reason : verdict.reasons)
    if (std::find(warnings_.begin(), warnings_.end(), reason) == warnings_.end()) warnings_.push_back(reason);
  complete(report, verdict);
  if (!more.is_null()) report.update(more);
  for (const auto& [stage, ms] : stages_)
    report["stages"][stage] = {
        {"count", ms.count()}, {"median_ms", ms.percentile(0.5)}, {"max_ms", ms.max()}, {"total_ms", ms.total()}};
  const auto write_report = [&] {
    nlohmann::json full_report = report;
    full_report["per_frame"] = frames.kept();
    outputs.write_report(full_report);
  };
  write_report();
  if (more_files) {
    add_files(more_files, report);
    write_report();
  }
  outputs.expect_all();
  if (arguments_.json) fmt::print("{}\n", format_json(report, 2));
  print_summary(report, verdict);
  return verdict;
}

void Run::complete(nlohmann::json& report, const Verdict& verdict) const {
  const FrameLog& frames = progressed_.frames;
  const int total = frames.size(), in_this_run = total - frames_before();
  const double seconds = std::chrono::duration<double>(Clock::now() - start_).count();
  report.update({{"sequence", arguments_.sequence},
                 {"options",
                  {{"voxel_size", options_.fuse.voxel_size},
                   {"truncation", options_.fuse.truncation},
                   {"max_depth", options_.surface.max_depth},
                   {"track_finest_level", options_.track.finest_level}}},
                 {"frames",
                  {{"total", total},
                   {"fused", frames.count("fused")},
                   {"lost", frames.count("lost")},
                   {"skipped", frames.count("skipped")},
                   {"held_out", held_out()}}},
                 {"frames_of_this_run", in_this_run},
                 {"seconds", seconds},
                 {"frames_per_second", in_this_run / seconds},
                 {"peak_memory_mb", peak_memory_mb()},
                 {"verdict", to_json(verdict)},
                 {"warnings", warnings_}});
  if (pose_check_) report["poses"] = to_json(*pose_check_);
  if (held_out() > 0) report["hold_out"] = to_json(progressed_.hold_out);
  if (frames_left_) report["interrupted"] = {{"frames_left", *frames_left_}, {"remedy", resume_instructions()}};
  if (!interrupted_stage_.empty()) report["interrupted"]["stage"] = interrupted_stage_;
}

/// Prints the summary, with the verdict at the end, where it is seen first.
void Run::print_summary(const nlohmann::json& report, const Verdict& verdict) const {
  if (is_quiet() && verdict.level == Verdict::Level::good) return;
  std::FILE* const out = arguments_.json || is_quiet() ? stderr : stdout;
  const fs::path& output = arguments_.output;
  const int total = progressed_.frames.size(), in_this_run = report["frames_of_this_run"];
  const fs::path page = output / "report.html";  // missing if the library is built without the viewer
  if (out == stdout) {
    // Unusable frames and frames dropped to keep up are counted separately.
    const int skipped = progressed_.frames.count("skipped"), left_out = frame_rates_.dropped;
    fmt::print(out, "{} of {} frames fused ({} lost{}{}{}){} in {:.1f} s, {:.1f} frames/s, {:.0f} MB peak\n",
               progressed_.frames.count("fused"), total, progressed_.frames.count("lost"),
               left_out == 0 ? fmt::format(", {} skipped", skipped)
               : skipped > 0 ? fmt::format(", {} unusable", skipped)
                             : "",
               held_out() > 0 ? fmt::format(", {} held out", held_out()) : "",
               left_out > 0 ? fmt::format("; {} more dropped to keep up", left_out) : "",
               frames_before() > 0 ? fmt::format(", {} of them in this run", in_this_run) : "",
               report["seconds"].get<double>(), report["frames_per_second"].get<double>(),
               report["peak_memory_mb"].get<double>());
    if (!arguments_.no_mesh) {
      fmt::print(out, "mesh        {} ({} triangles, {})\n", (output / "mesh.glb").string(),
                 report["mesh"]["triangles"].get<std::size_t>(),
                 report["mesh"].contains("textures") ? "textured" : "the voxels' colors");
      fmt::print(out, "map         {}\n", (output / "map.vdb").string());
    }
    fmt::print(out, "trajectory  {}\n", (output / "trajectory.txt").string());
    print_upright(report["upright"]);
    if (report.contains("inertial")) print_inertial(report["inertial"]);
    if (report.contains("quality"))
      fmt::print(out, "quality     {}: {}\n", report["quality"]["requested"].get<std::string>(),
                 report["quality"]["words"].get<std::string>());
    if (const std::string words = calibration_words(report); !words.empty())
      fmt::print(out, "calibration {}; in {}\n", words, (output / kMapCamera).string());
    fmt::print(out, "report      {}\n", (fs::exists(page) ? page : output / "report.json").string());
    if (fs::exists(page)) fmt::print(out, "next: cairn view {}\n", quoted(output));
  }
  if (!arguments_.json || verdict.level != Verdict::Level::good) print(verdict, out);
  if (!interrupted_stage_.empty())
    fmt::print(out, "interrupted in the stage {}; {}\n", interrupted_stage_, resume_instructions());
  else if (frames_left_)
    fmt::print(out, "{} of {} frames; {}\n", total, total + *frames_left_, resume_instructions());
}

void print(const Verdict& verdict, std::FILE* out) {
  std::string level = to_string(verdict.level);
  if (verdict.level == Verdict::Level::bad) level = "BAD";
  const Terminal terminal = terminal_of(fileno(out));
  const auto color = verdict.level == Verdict::Level::bad    ? fmt::terminal_color::red
                     : verdict.level == Verdict::Level::weak ? fmt::terminal_color::yellow
                                                             : fmt::terminal_color::green;
  if (terminal.has_colors) level = fmt::format(fmt::fg(color) | fmt::emphasis::bold, "{}", level);
  fmt::print(out, "{}: {}\n", level, verdict.words);
  for (const std::string& reason : verdict.reasons) fmt::print(out, "  - {}\n", reason);
}

void exit_with(const Verdict& verdict) {
  if (verdict.level == Verdict::Level::bad) throw CLI::RuntimeError(kNotInMap);
}

namespace {

/// Adds options for output other than the map.
void add_report_options(CLI::App& command, RunArguments& a) {
  command
      .add_option(
          "--log", a.log,
          "New file X.mcap with poses, images, the growing surface and events, for replay in Foxglove and Rerun")
      ->type_name(kFile);
  command.add_flag("--json", a.json, "Print the report to stdout as JSON");
  command.add_flag("--verbose", a.verbose, "Print how well each frame is aligned, in numbers");
}

}  // namespace

CLI::Option* add_quality(CLI::App& command, Quality& quality) {
  static constexpr std::array kQualities{Quality::fast, Quality::good, Quality::best};
  return command
      .add_option_function<std::string>(
          "--quality",
          [&quality](const std::string& name) {
            quality = *std::find_if(kQualities.begin(), kQualities.end(),
                                    [&](Quality one) { return to_string(one) == name; });
          },
          "Effort after the last frame: fast (none), good (keyframes adjusted jointly, and all frames fused again) or "
          "best (the same, with every frame tracked again); kept if frames held out until the end confirm it [good]")
      ->check(CLI::IsMember({"fast", "good", "best"}))
      ->type_name("NAME");
}

namespace {

void add_tracking_options(CLI::App& command, RunArguments& a) {
  command
      .add_option(
          "--sensor", a.sensor,
          "Noise model of the depth: structured_light, time_of_flight, stereo, phone_lidar or exact [from the input]")
      ->check([](const std::string& name) -> std::string {
        try {
          (void)sensor_model(name);
          return {};
        } catch (const std::runtime_error& error) {
          return error.what();
        }
      });
  command
      .add_option("--motion", a.motion,
                  "What carries the camera: hand, robot or drone; limits its speed [hand; no limit if the frame rate "
                  "is assumed]")
      ->check(CLI::IsMember({"hand", "robot", "drone"}));
  command
      .add_option("--device-poses", a.device_poses,
                  "Use of the poses of the device's own tracking, from the recording or --guess: off, guess (start of "
                  "each alignment) or prior (also a measurement of the motion, as long as it agrees)")
      ->check(CLI::IsMember({"off", "guess", "prior"}))
      ->capture_default_str();
}

}  // namespace

void add_run_options(CLI::App& command, RunArguments& a) {
  command.add_option("SEQUENCE", a.sequence, kSequenceHelp)->required();
  add_output_options(command, a, "-o,--output,OUT",
                     "Folder for mesh.glb, map.vdb, trajectory.txt, graph.svg, report.html and the session");
  command.add_option("--config", a.config, "YAML file that overrides options")->check(CLI::ExistingFile);
  add_camera(command, a.camera, "in place of the cameras of the recording or sensor");
  add_tracking_options(command, a);
  command
      .add_option("--up", a.up,
                  "Up axis of the map: auto (from an accelerometer, or from floors and walls), camera (up in the first "
                  "image), or an axis of the first camera's frame or the given poses: x, y, z, -x, -y, -z [auto; "
                  "with --poses: unchanged]")
      ->check(CLI::IsMember({"auto", "camera", "x", "y", "z", "-x", "-y", "-z"}));
  add_number(command, "--voxel-size", a.voxel_size, range_of("fuse.voxel_size"), Unit::meters,
             "Side of a voxel; the truncation is four voxels, or more for noisy sensors [0.01]");
  add_topics(command, a.topics);
  add_device(command, a.device);
  add_number(command, "--device-memory", a.device_memory_mib, {1, kMaxMebibytes}, Unit::mebibytes,
             "Device memory for the map [half of it, at most 2048]");
  add_number(command, "--host-memory", a.host_memory_mib, {1, kMaxMebibytes}, Unit::mebibytes,
             "Host memory for completed submaps; the rest is on the disk [16]");
  auto* live = command.add_flag("--esdf", a.esdf,
                                "Update a distance field while frames are fused; map.vdb contains it as grid `esdf`");
  add_number(command, "--esdf-voxel-size", a.esdf_voxel_size, range_of("esdf.voxel_size"), Unit::meters,
             "Voxel of the distance field: 1, 2, 4 or 8 voxels of the map; 0: two [two]")
      ->needs(live);
  add_number(command, "--max-distance", a.max_distance, range_of("esdf.max_distance"), Unit::meters,
             "Maximum distance of the distance field; larger distances are clamped [2]")
      ->needs(live);
  add_number(command, "--robot-radius", a.robot_radius, range_of("esdf.robot_radius"), Unit::meters,
             "Radius of the free space around each camera position, in map.vdb and distance fields [0.1]");
  command.add_flag("--no-loops", a.no_loops, "No loop closures");
  command
      .add_flag("--resume", a.resume,
                "Resume the session in OUT: an interrupted run, or another recording of the same place")
      ->excludes("--overwrite")
      ->excludes("--auto-name");
  add_number(command, "--checkpoint", a.checkpoint_seconds, {0, kMaxCheckpointInterval}, Unit::seconds,
             "Time between two checkpoints of the session; a killed run loses at most this much work")
      ->capture_default_str();
  add_report_options(command, a);
  add_export_options(command, a.mesh);
}

}  // namespace cairn::apps
