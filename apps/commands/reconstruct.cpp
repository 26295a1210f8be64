// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <spdlog/spdlog.h>

#include <chrono>
#include <utility>

#include "cairn/eval/pose_check.hpp"
#include "cairn/io/layouts.hpp"
#include "cli/commands.hpp"
#include "cli/interrupt.hpp"
#include "cli/progress.hpp"
#include "cli/quantity.hpp"
#include "cli/quiet.hpp"
#include "cli/run.hpp"
#include "cli/sources.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr double kGuessDrift = 3;  // times the drift of visual-inertial odometry, for wheel slip
// Frames held out to judge --quality: every n-th, not in shorter recordings.
constexpr int kMinJudgedFrames = 60, kHeldOutFrames = 14, kMinHeldOutInterval = 8, kStreamHeldOutInterval = 40;

struct Arguments : RunArguments {
  fs::path poses, guess;
  std::string frames;
  std::optional<std::string> poses_convention;
  int read_ahead = 4;
  bool refine = false, adjust = false, reintegrate = false;
  Quality quality = Quality::good;

  [[nodiscard]] bool is_expert() const { return refine || adjust || reintegrate; }
  /// Quality of the stages after the last frame, if they are not chosen one by one.
  [[nodiscard]] Quality effective_quality() const { return is_expert() || !poses.empty() ? Quality::fast : quality; }
};

/// Interval of the frames held out to judge the quality; 0: none. `frames`: of the recording, if known.
int judging_interval(Quality quality, std::optional<int> frames) {
  if (quality == Quality::fast || (frames && *frames < kMinJudgedFrames)) return 0;
  return frames ? std::max(kMinHeldOutInterval, *frames / kHeldOutFrames) : kStreamHeldOutInterval;
}

/// Poses of --poses or --guess, world_from_camera; empty without either.
Trajectory given_poses(const Arguments& a) {
  const fs::path& file = a.poses.empty() ? a.guess : a.poses;
  if (a.poses_convention && file.empty())
    throw CLI::ValidationError("--poses-convention", "describes --poses or --guess: give one of them");
  if (file.empty()) return {};
  Trajectory poses = recorded_truth(file);
  if (poses.empty()) throw std::runtime_error(file.string() + ": is a recording without poses");
  return with_convention(std::move(poses), pose_convention(a.poses_convention.value_or("")));
}

/// Sources of the run: held-out frames marked, with poses or guesses, read ahead.
std::unique_ptr<Source> with_wrappers(std::unique_ptr<Source> source, const Arguments& a, const HoldOut& held_out,
                                      const Trajectory& given) {
  source = hold_out(std::move(source), held_out);
  if (!a.poses.empty()) source = with_poses(std::move(source), given);
  if (!a.guess.empty()) source = with_guesses(std::move(source), given);
  return a.read_ahead > 0 ? read_ahead(std::move(source), a.read_ahead) : std::move(source);
}

/// Checks the given poses against the depth of sampled frames. Returns nullopt without poses, and for a sensor, whose
/// frames cannot be read twice.
std::optional<PoseCheck> check_given_poses(const Arguments& a, SourceOptions options, const Trajectory& given) {
  if (given.empty() || is_sensor(a.sequence)) return std::nullopt;
  options.find_color_camera = false;
  options.depth_only = true;
  const Quiet quiet;
  const auto source = open_source(a.sequence, options);
  const auto frames = sampled_frames(*source);
  return check_poses(source->rig(), frames, given);
}

/// Adds the check of given poses to the verdict. Poses that are only a guess cannot harm the map, so they only get a
/// warning.
void report(const PoseCheck& check, Poses poses, Run& run) {
  if (poses == Poses::given)
    run.set_pose_check(check);
  else if (check.contradicts)
    spdlog::warn(to_string(check, "--guess"));
}

/// Upper triangles in row order.
nlohmann::json to_json(const std::vector<AdjustReport::KeyframeCovariance>& all) {
  nlohmann::json list = nlohmann::json::array();
  for (const auto& [timestamp, covariance] : all) {
    nlohmann::json triangle = nlohmann::json::array();
    for (int i = 0; i < 6; ++i)
      for (int j = i; j < 6; ++j) triangle.push_back(covariance(i, j));
    list.push_back({{"timestamp", timestamp}, {"covariance", std::move(triangle)}});
  }
  return list;
}

nlohmann::json to_json(const RefineReport& r) {
  return {{"keyframes", r.keyframes},       {"pairs_tried", r.pairs_tried}, {"pairs_aligned", r.pairs_aligned},
          {"pairs_inlier", r.pairs_inlier}, {"cost_before", r.cost_before}, {"cost", r.cost}};
}

nlohmann::json to_json(const AdjustReport& a) {
  return {{"keyframes", a.keyframes},
          {"surfels", a.surfels},
          {"observations", a.observations},
          {"clock_offset", a.clock_offset},
          {"readout", a.readout},
          {"readout_sigma", a.readout_sigma},
          {"predicts_better", a.error_reduction},
          {"has_readout", a.has_readout},
          {"corrected_predicts_better", a.corrected_error_reduction},
          {"has_correction", !a.correction.empty()},
          {"covariances", to_json(a.covariances)}};
}

void warn_of_errors(const AdjustReport& adjusted, bool is_used, Run& run) {
  if (adjusted.has_readout)
    run.warn(
        fmt::format("the camera has a rolling shutter with a readout of about {:.0f} ms: calibrate it with `cairn "
                    "calibrate --shutter` for more accurate tracking",
                    1000 * adjusted.readout));
  if (!adjusted.correction.empty() && !is_used)
    run.warn(
        "the depth error exceeds the sensor noise: `--reintegrate` corrects it, and `cairn calibrate --depth` "
        "calibrates it for later recordings");
}

/// Adds frames until the recording ends or a signal arrives. Returns the number of frames read.
int add_frames(const Arguments& a, Source& source, Run& run, Interrupt& interrupt) {
  int read = 0;
  Progress progress(source.size());
  auto waited = Clock::now();
  while (!interrupt.requested()) {
    const auto frame = source.next();
    if (!frame) break;
    ++read;
    const FrameReport report =
        run.add(*frame, std::chrono::duration<double, std::milli>(Clock::now() - waited).count());
    if (run.stopped()) break;
    if (report.state == FrameState::fused) interrupt.allow_graceful_exit();
    progress.step(to_string(report, a.verbose));
    waited = Clock::now();
  }
  return read;
}

/// Shows the stages after the last frame, measures their times, and ends them at a signal.
class Stages {
 public:
  Stages(Run& run, Interrupt& interrupt) : run_(run), interrupt_(interrupt) {}
  Stages(const Stages&) = delete;
  Stages& operator=(const Stages&) = delete;
  ~Stages() { end(); }

  /// FinishOptions::progress.
  bool operator()(FinishStage stage, double fraction) {
    if (stage != stage_) begin(stage);
    progress_->step(static_cast<int>(100 * fraction), 100, text_of(stage).running);
    if (!interrupt_.requested()) return true;
    run_.interrupted_in(std::string(to_string(stage)));
    return false;
  }

 private:
  struct Text {
    const char *running, *at_signal;
  };
  static Text text_of(FinishStage stage) {
    switch (stage) {
      case FinishStage::refine:
        return {"refining", "skipping the rest of the refinement; interrupt again to end at once"};
      case FinishStage::adjust:
        return {"adjusting", "keeping the adjustment so far; interrupt again to end at once"};
      case FinishStage::reintegrate:
        return {"reintegrating", "keeping the adjusted map; interrupt again to end at once"};
    }
    return {};
  }
  void begin(FinishStage stage) {
    end();
    stage_ = stage, start_ = Clock::now();
    interrupt_.set_message(text_of(stage).at_signal);
    progress_.emplace(std::nullopt, "");
  }
  void end() {
    if (stage_)
      run_.add_time(std::string(to_string(*stage_)),
                    std::chrono::duration<double, std::milli>(Clock::now() - start_).count());
    progress_.reset();
  }

  Run& run_;
  Interrupt& interrupt_;
  std::optional<FinishStage> stage_;
  std::optional<Progress> progress_;
  Clock::time_point start_;
};

/// Stages after the last frame, as requested one by one or by a quality.
FinishOptions stages_of(const Arguments& a, bool has_own_held_out, Source* again) {
  if (a.is_expert()) return {.refine = a.refine, .adjust = a.adjust, .reintegrate = a.reintegrate ? again : nullptr};
  FinishOptions options = finish_options(a.effective_quality(), again);
  options.fuses_held_out = has_own_held_out;
  return options;
}

nlohmann::json to_json(const HeldOutError& e) {
  nlohmann::json j{
      {"frames", e.frames}, {"covered", e.covered}, {"depth_rmse_m", e.depth_rmse}, {"doubled", e.doubled}};
  if (e.brightness_rmse > 0) j["brightness_rmse"] = e.brightness_rmse;
  return j;
}

/// Gain of the stages in one line, by the held-out frames.
std::string gain(const FinishReport& finished) {
  if (!finished.error_before || !finished.error) return "too few frames held out to judge the adjusted map";
  const HeldOutError &before = *finished.error_before, &after = *finished.error;
  std::string text = fmt::format("depth error {:.1f} -> {:.1f} mm", 1000 * before.depth_rmse, 1000 * after.depth_rmse);
  if (before.brightness_rmse > 0)
    text += fmt::format(", brightness {:.1f} -> {:.1f} %", 100 * before.brightness_rmse, 100 * after.brightness_rmse);
  text += fmt::format(" in {} held-out frames", after.frames);
  if (!finished.is_kept) return "the map as tracked, since the adjusted map is worse: " + text;
  if (finished.adjusted && finished.adjusted->has_readout)
    text +=
        fmt::format("; a rolling shutter of about {:.0f} ms: `cairn calibrate --shutter` for more accurate tracking",
                    1000 * finished.adjusted->readout);
  return text;
}

/// Improves the complete map after the last frame. A signal ends the current stage and keeps its previous result; an
/// adjustment keeps its intermediate result.
nlohmann::json improve(const Arguments& a, const RunProgress& progressed, const Trajectory& given, Run& run,
                       Interrupt& interrupt) {
  interrupt.allow_graceful_exit();  // also if no frame was left
  const Quality quality = a.effective_quality();
  const bool is_long = static_cast<int>(run.mapper().trajectory().size()) >= kMinJudgedFrames;
  if (!a.is_expert() && (quality == Quality::fast || !is_long || run.mapper().recordings() > 1)) return {};
  if (interrupt.requested()) {
    run.interrupted_in(a.refine ? "refine" : "adjust");
    return {};
  }
  std::unique_ptr<Source> again;
  if (a.reintegrate || (!a.is_expert() && !is_sensor(a.sequence))) {
    SourceOptions options_again = source_options(a, parse_frames(a.frames));
    options_again.find_color_camera = false;  // already known to the mapper
    again = with_wrappers(open_source(a.sequence, options_again), a, progressed.hold_out, given);
  }
  FinishReport finished;
  {
    Stages stages(run, interrupt);
    FinishOptions options = stages_of(a, progressed.judges, again.get());
    options.progress = std::ref(stages);
    finished = run.mapper().finish(options);
  }
  if (finished.has_fused_held_out) run.fused_held_out();
  if (!a.is_expert() && !interrupt.requested()) run.improved();
  nlohmann::json results;
  if (!a.is_expert())
    results["quality"] = {{"requested", to_string(quality)}, {"kept", finished.is_kept}, {"words", gain(finished)}};
  if (finished.error_before) results["quality"]["before"] = to_json(*finished.error_before);
  if (finished.error) results["quality"]["after"] = to_json(*finished.error);
  if (finished.refined) results["refined"] = to_json(*finished.refined);
  if (finished.adjusted) {
    results["adjusted"] = to_json(*finished.adjusted);
    if (a.is_expert()) warn_of_errors(*finished.adjusted, finished.is_reintegrated, run);
  }
  return results;
}

void reconstruct(const Arguments& requested) {
  const Inputs inputs =
      inputs_of(requested).add_recording(requested.poses.string()).add_recording(requested.guess.string());
  const Arguments a = with_output(requested, inputs, requested.poses.empty());
  const Poses poses = a.poses.empty() ? Poses::tracked : Poses::given;
  (void)options_of(a);  // reports wrong options before reading
  ResumePoint begin = resume_point(a, parse_frames(a.frames));
  const Trajectory given = given_poses(a);
  const std::optional<PoseCheck> pose_check = check_given_poses(a, source_options(a, begin.range), given);
  auto recording = open_source(a.sequence, source_options(a, begin.range));
  if (!a.hold_out && !a.resume && !is_sensor(a.sequence)) {
    HoldOut& hold_out = begin.progressed.hold_out;
    hold_out.every = judging_interval(a.effective_quality(), recording->size());
    begin.progressed.judges = hold_out.every > 0;
  }
  const auto source = with_wrappers(std::move(recording), a, begin.progressed.hold_out, given);
  const Options options = options_of(a, source->rig().sensor);
  Run run(a, options, poses, source->rig(), begin.progressed, begin.is_next_recording);
  if (pose_check) report(*pose_check, poses, run);
  if (!a.guess.empty())
    run.compare_with(given, kGuessDrift);
  else if (poses == Poses::tracked)
    run.compare_with(device_poses(a.sequence, a.camera));
  const ExitMessage exit_message(run.exit_message());
  Interrupt interrupt(Interrupt::Graceful::later);
  const std::optional<int> count = source->size();
  const int read = add_frames(a, *source, run, interrupt);
  if (interrupt.requested() && count && read < *count) run.interrupted(*count - read);
  const bool is_improved = read == 0 && begin.progressed.improved;
  const bool is_final = run.stopped() || (is_improved && !a.is_expert());
  const nlohmann::json results = is_final ? nlohmann::json() : improve(a, begin.progressed, given, run, interrupt);
  interrupt.set_message(kWriting);
  if (const auto why = source->ended_early()) run.warn(*why);
  if (a.hold_out && !run.stopped() && run.held_out() == 0)
    run.warn(fmt::format("--hold-out {}: no frame was held out: give a smaller number", *a.hold_out));
  exit_with(run.finish(results));
}

/// Adds the options for the stages after the last frame.
void add_stages(CLI::App& command, const std::shared_ptr<Arguments>& a, CLI::Option* poses) {
  auto* quality = add_quality(command, a->quality)->excludes(poses);
  command
      .add_flag("--refine", a->refine,
                "Align keyframes with each other after the last frame and deform the map to the optimized pose graph")
      ->excludes(poses)
      ->excludes(quality);
  command
      .add_flag("--adjust", a->adjust,
                "Jointly adjust keyframe poses, the surface, the readout time and the depth error after the last "
                "frame, by depth and brightness, and deform the map accordingly")
      ->excludes(poses)
      ->excludes(quality);
  command
      .add_flag("--reintegrate", a->reintegrate,
                "Like --adjust, but then track the frames between keyframes again and fuse all frames with corrected "
                "depth instead of deforming the map")
      ->excludes(poses)
      ->excludes(quality);
}

}  // namespace

void add_reconstruct(CLI::App& program) {
  auto* command = program.add_subcommand("reconstruct", "Turn a recording into a mesh, a map and a trajectory");
  const auto a = std::make_shared<Arguments>();
  add_run_options(*command, *a);
  add_number(*command, "--read-ahead", a->read_ahead, {0, 1000},
             "Frames decoded ahead in a separate thread; 0: no thread")
      ->capture_default_str();
  command->add_option("--frames", a->frames, kFramesHelp)->type_name("RANGE");
  add_number(*command, "--hold-out", a->hold_out, {2, 1'000'000},
             "Track every N-th frame, but exclude it from the map, its colors and its adjustment; `cairn evaluate map` "
             "compares the map with these frames [none]");
  auto* poses =
      command
          ->add_option(
              "--poses", a->poses,
              "Fuse with these world_from_camera poses (TUM format, or a recording with true poses) and do not track")
          ->check(CLI::ExistingPath)
          ->excludes("--resume");
  command
      ->add_option("--guess", a->guess,
                   "Initial poses for each alignment from a phone's odometry, wheel odometry or another program (as "
                   "--poses), used while they are better than the camera's own motion")
      ->check(CLI::ExistingPath)
      ->excludes(poses);
  command
      ->add_option(
          "--poses-convention", a->poses_convention,
          "Convention of --poses or --guess: camera_from_world, wxyz (qw first), opengl, ros or unity axes of "
          "the camera or axes=RIGHT,DOWN,FORWARD (as x,-y,-z), mm, cm, ft or scale=METERS, clock=SECONDS to add; "
          "several are separated by commas [world_from_camera, x right, y down, z forward, meters]")
      ->check([](const std::string& text) -> std::string {
        try {
          (void)pose_convention(text);
          return {};
        } catch (const std::runtime_error& error) {
          return error.what();
        }
      });
  command
      ->add_flag("--no-mesh", a->no_mesh,
                 "Write only the session, the trajectory and report.json: for a segment of a project")
      ->excludes(poses);
  add_stages(*command, a, poses);
  command->callback([a] { reconstruct(*a); });
}

}  // namespace cairn::apps
