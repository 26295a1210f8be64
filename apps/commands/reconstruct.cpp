// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <optional>
#include <thread>
#include <utility>

#include "base/quoted.hpp"
#include "cairn/eval/pose_check.hpp"
#include "cairn/io/layouts.hpp"
#include "cli/commands.hpp"
#include "cli/final_stages.hpp"
#include "cli/interrupt.hpp"
#include "cli/open_with_cameras.hpp"
#include "cli/progress.hpp"
#include "cli/quantity.hpp"
#include "cli/quiet.hpp"
#include "cli/run.hpp"
#include "cli/run_view.hpp"
#include "cli/sources.hpp"
#include "cli/splat_training.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr auto kPollInterval = std::chrono::milliseconds(50);  // of the page's commands during a pause
constexpr double kMaxSplatSeconds = 1e6;
constexpr int kUnlimitedIterations = 10'000'000;
constexpr double kGuessDrift = 3;  // times the drift of visual-inertial odometry, for wheel slip

struct Arguments : RunArguments {
  fs::path poses, guess, mask;
  std::string frames;
  std::optional<std::string> poses_convention;
  int read_ahead = 4;
  double splat_seconds = 0;  // 0: no splats
  FinalStages stages;
  RunViewArguments view;
};

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
  source = masked(hold_out(std::move(source), held_out), a.mask, a.sequence);
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

struct ReadFrames {
  int count = 0;
  bool is_ended_by_user = false;  // by a signal or the page
};

/// Adds frames until the recording or the user ends the run; handles the page's commands between frames.
ReadFrames add_frames(const Arguments& a, Source& source, Run& run, Interrupt& interrupt, LiveViewer* view) {
  ReadFrames read;
  Progress progress(source.size(), "frames", relative_time(a.stages.quality, source.size()));
  bool is_paused = false;
  auto waited = Clock::now();
  while (!(read.is_ended_by_user = interrupt.requested())) {
    if (view) {
      const LiveViewer::ViewerCommands commands = view->commands();
      if ((read.is_ended_by_user = commands.finish)) break;
      is_paused = commands.pause.value_or(is_paused);
      view->update(is_paused, 0);
      if (is_paused) {
        std::this_thread::sleep_for(kPollInterval);
        waited = Clock::now();
        continue;
      }
    }
    const auto frame = source.next();
    if (!frame) break;
    ++read.count;
    const auto arrived = Clock::now();
    const FrameReport report = run.add(*frame, milliseconds(arrived - waited));
    if (run.stopped()) break;
    if (report.state == FrameState::fused) interrupt.allow_graceful_exit();
    progress.step(to_string(report, a.verbose));
    if (view) view->fused(*frame, report, milliseconds(Clock::now() - arrived));
    waited = Clock::now();
  }
  return read;
}

/// Runs the stages after the last frame and returns their results for report.json.
nlohmann::json improve(const Arguments& a, const RunProgress& progressed, const Trajectory& given,
                       const ReadFrames& read, Run& run, Interrupt& interrupt, LiveViewer* view) {
  interrupt.allow_graceful_exit();  // also if no frame was left
  const bool is_improved = read.count == 0 && progressed.improved;
  if (run.stopped() || (is_improved && !a.stages.is_expert()) || !a.stages.apply_to(run)) return {};
  if (read.is_ended_by_user) return skip(a.stages, run);
  std::unique_ptr<Source> again;
  if (!interrupt.requested()) again = open_again(a.stages, a, parse_frames(a.frames), run);
  if (again) again = with_wrappers(std::move(again), a, progressed.hold_out, given);
  return improve(a.stages, again.get(), progressed.judges, run, interrupt, view);
}

/// Trains OUT/splats.spz from the recording, or from the keyframes if it cannot be read again as it was. Returns the
/// entry of report.json.
nlohmann::json add_splats(const Arguments& a, Map& map, Run& run, Interrupt& interrupt) {
  const fs::path file = a.output / "splats.spz";
  const std::string remedy = fmt::format("; train them with: cairn splat {} -o {}", quoted(a.output), quoted(file));
  if (interrupt.requested()) throw std::runtime_error("interrupted before the splats" + remedy);
  interrupt.set_message(kWritingSplats);
  SplatOptions options{
      .iterations = kUnlimitedIterations, .max_seconds = a.splat_seconds, .mesh = a.output / "mesh.glb"};
  OpenRecording open;
  if (!is_sensor(a.sequence) && a.topics.empty())
    open = [&] { return read_ahead(open_with_cameras(a.sequence, a.output / kMapCamera)); };
  try {
    std::optional<TrainedSplats> trained;
    run.timed("splats", [&] { trained = train_and_write(map, options, open, file, interrupt); });
    if (!a.json) print(*trained, file, open ? "frames" : "keyframes");
    interrupt.set_message(kWriting);
    return {{"splats", to_json(*trained, file)}};
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("no splats: {}{}", error.what(), remedy));
  }
}

void reconstruct(const Arguments& requested) {
  const Inputs inputs = inputs_of(requested)
                            .add_recording(requested.poses.string())
                            .add_recording(requested.guess.string())
                            .add(requested.mask);
  Arguments a = with_output(requested, inputs, requested.poses.empty());
  if (a.stages.is_expert() || !a.poses.empty()) a.stages.quality = Quality::fast;
  const Poses poses = a.poses.empty() ? Poses::tracked : Poses::given;
  (void)options_of(a);  // reports wrong options before reading
  ResumePoint begin = resume_point(a, parse_frames(a.frames));
  const Trajectory given = given_poses(a);
  std::optional<RunView> page;
  if (a.view.view) page.emplace(a.view, "see the map, and pause and finish the run");
  LiveViewer* const view = page ? &page->viewer() : nullptr;
  const std::optional<PoseCheck> pose_check = check_given_poses(a, source_options(a, begin.range), given);
  auto recording = open_source(a.sequence, source_options(a, begin.range));
  hold_out_to_judge(a.stages.quality, a, *recording, begin.progressed);
  const auto source = with_wrappers(std::move(recording), a, begin.progressed.hold_out, given);
  const Options options = options_of(a, source->rig().sensor, source->has_assumed_rate());
  Run run(a, options, poses, source->rig(), begin.progressed, begin.is_next_recording);
  if (pose_check) report(*pose_check, poses, run);
  if (!a.guess.empty())
    run.compare_with(given, kGuessDrift);
  else if (poses == Poses::tracked)
    run.compare_with(device_poses(a.sequence, a.camera));
  if (view) view->begin(run.mapper(), source->rig(), options, run.frames_before(), false);
  std::optional<ExitMessage> exit_message(run.exit_message());
  std::optional<Interrupt> interrupt(Interrupt::Graceful::later);
  const std::optional<int> count = source->size();
  const ReadFrames read = add_frames(a, *source, run, *interrupt, view);
  if (read.is_ended_by_user && count && read.count < *count) run.interrupted(*count - read.count);
  if (view) view->finishing();
  const nlohmann::json results = improve(a, begin.progressed, given, read, run, *interrupt, view);
  interrupt->set_message(kWriting);
  if (view) view->finishing();
  if (const auto why = source->ended_early()) run.warn(*why);
  if (a.hold_out && !run.stopped() && run.held_out() == 0)
    run.warn(fmt::format("--hold-out {}: no frame was held out: give a smaller number", *a.hold_out));
  Run::MoreFiles splats;
  if (a.splat_seconds > 0) splats = [&](Map& map) { return add_splats(a, map, run, *interrupt); };
  const Verdict verdict = run.finish(results, splats);
  const bool is_interrupted = interrupt->requested();
  exit_message.reset();
  interrupt.reset();
  if (page) page->show_result(a.output, is_interrupted);
  exit_with(verdict);
}

/// Adds the options for the stages after the last frame.
void add_stages(CLI::App& command, const std::shared_ptr<Arguments>& a, CLI::Option* poses) {
  auto* quality = add_quality(command, a->stages.quality)->excludes(poses);
  command
      .add_flag("--refine", a->stages.refine,
                "Align keyframes with each other after the last frame and deform the map to the optimized pose graph")
      ->excludes(poses)
      ->excludes(quality);
  command
      .add_flag("--adjust", a->stages.adjust,
                "Jointly adjust keyframe poses, the surface, the readout time and the depth error after the last "
                "frame, by depth and brightness, and deform the map accordingly")
      ->excludes(poses)
      ->excludes(quality);
  command
      .add_flag("--reintegrate", a->stages.reintegrate,
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
  add_mask(*command, a->mask);
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
  add_run_view(*command, a->view);
  command
      ->add_flag("--no-mesh", a->no_mesh,
                 "Write only the session, the trajectory and report.json: for a segment of a project")
      ->excludes(poses)
      ->excludes("--view");
  add_number(*command, "--splat", a->splat_seconds, {1, kMaxSplatSeconds}, Unit::seconds,
             "Train Gaussian splats for this time after the run: OUT/splats.spz [none]")
      ->excludes(poses)
      ->excludes("--no-mesh");
  add_stages(*command, a, poses);
  command->callback([a] { reconstruct(*a); });
}

}  // namespace cairn::apps
