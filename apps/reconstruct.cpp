// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <spdlog/spdlog.h>

#include <chrono>
#include <utility>

#include "cairn/layouts.hpp"
#include "cairn/pose_check.hpp"
#include "commands.hpp"
#include "interrupt.hpp"
#include "progress.hpp"
#include "quantity.hpp"
#include "quiet.hpp"
#include "run.hpp"
#include "sources.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr double kGuessDrift = 3;  // times the drift of visual-inertial odometry, for wheel slip

struct Arguments : RunArguments {
  fs::path poses, guess;
  std::string frames;
  std::optional<std::string> poses_convention;
  int read_ahead = 4;
  bool refine = false, adjust = false, reintegrate = false;
};

/// Poses of --poses or --guess, world_from_camera; empty without either.
Trajectory given_poses(const Arguments& a) {
  const fs::path& file = a.poses.empty() ? a.guess : a.poses;
  if (a.poses_convention && file.empty())
    throw CLI::ValidationError("--poses-convention", "says how --poses or --guess are meant: give one of them");
  if (file.empty()) return {};
  Trajectory poses = recorded_truth(file);
  if (poses.empty()) throw std::runtime_error(file.string() + ": is a recording without poses");
  return with_convention(std::move(poses), pose_convention(a.poses_convention.value_or("")));
}

std::unique_ptr<Source> open_frames(const Arguments& a, const SourceOptions& options, const HoldOut& held_out,
                                    const Trajectory& given) {
  auto source = hold_out(open_source(a.sequence, options), held_out);
  if (!a.poses.empty()) source = with_poses(std::move(source), given);
  if (!a.guess.empty()) source = with_guesses(std::move(source), given);
  return a.read_ahead > 0 ? read_ahead(std::move(source), a.read_ahead) : std::move(source);
}

/// Checks the given poses against the depth of sampled frames. Returns nullopt without poses, and for a sensor, whose
/// frames cannot be read twice.
std::optional<PoseCheck> check_given_poses(const Arguments& a, SourceOptions options, const Trajectory& given) {
  if (given.empty() || is_sensor(a.sequence)) return std::nullopt;
  options.find_colour_camera = false;
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
    spdlog::warn(text_of(check, "--guess"));
}

/// Upper triangles in row order.
nlohmann::json to_json(const std::vector<Adjusted::KeyframeCovariance>& all) {
  nlohmann::json list = nlohmann::json::array();
  for (const auto& [timestamp, covariance] : all) {
    nlohmann::json triangle = nlohmann::json::array();
    for (int i = 0; i < 6; ++i)
      for (int j = i; j < 6; ++j) triangle.push_back(covariance(i, j));
    list.push_back({{"timestamp", timestamp}, {"covariance", std::move(triangle)}});
  }
  return list;
}

nlohmann::json to_json(const Adjusted& a) {
  return {{"keyframes", a.keyframes},
          {"surfels", a.surfels},
          {"observations", a.observations},
          {"clock_offset", a.clock_offset},
          {"readout", a.readout},
          {"readout_sigma", a.readout_sigma},
          {"predicts_better", a.predicts_better},
          {"has_readout", a.has_readout},
          {"corrected_predicts_better", a.corrected_predicts_better},
          {"has_correction", !a.correction.empty()},
          {"covariances", to_json(a.covariances)}};
}

void tell(const Adjusted& adjusted, bool is_used, Run& run) {
  if (adjusted.has_readout)
    run.warn(
        fmt::format("the camera reads its rows within about {:.0f} ms: `cairn calibrate --shutter` finds it, "
                    "and tracking with it is more accurate",
                    1000 * adjusted.readout));
  if (!adjusted.correction.empty() && !is_used)
    run.warn(
        "the depth camera errs by more than its noise: `--reintegrate` corrects it, and `cairn calibrate --depth` "
        "finds it for later recordings");
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
    if (report.state == FrameState::fused) interrupt.is_worth_finishing();
    progress.step(words(report, a.verbose));
    waited = Clock::now();
  }
  return read;
}

/// Improves the complete map after the last frame. A signal ends the current stage and keeps its previous result; an
/// adjustment keeps its intermediate result.
nlohmann::json improve(const Arguments& a, const HoldOut& held_out, const Trajectory& given, Run& run,
                       Interrupt& interrupt) {
  nlohmann::json more;
  interrupt.is_worth_finishing();  // also if no frame was left
  const auto shown = [&](Progress& progress, const char* words) {
    return [&interrupt, &progress, words](double share) {
      progress.step(static_cast<int>(100 * share), 100, words);
      return !interrupt.requested();
    };
  };
  const auto stage = [&](bool is_asked, const char* name, const std::function<void()>& work) {
    if (is_asked && !interrupt.requested()) run.timed(name, work);
    if (is_asked && interrupt.requested()) run.interrupted_in(name);
  };
  stage(a.refine || a.reintegrate, "refine", [&] {
    interrupt.say("leaving out what is not refined yet; once more ends at once");
    Progress progress(std::nullopt, "");
    const Refined refined = run.mapper().refine(shown(progress, "refining"));
    more["refined"] = {{"keyframes", refined.keyframes},         {"pairs_tried", refined.pairs_tried},
                       {"pairs_aligned", refined.pairs_aligned}, {"pairs_inlier", refined.pairs_inlier},
                       {"cost_before", refined.cost_before},     {"cost", refined.cost}};
  });
  Adjusted adjusted;
  stage(a.adjust || a.reintegrate, "adjust", [&] {
    interrupt.say("keeping what is adjusted so far; once more ends at once");
    {
      Progress progress(std::nullopt, "");
      adjusted = run.mapper().adjust(shown(progress, "adjusting"));
    }
    more["adjusted"] = to_json(adjusted);
    tell(adjusted, a.reintegrate, run);
  });
  stage(a.reintegrate, "reintegrate", [&] {
    interrupt.say("keeping the map as it was adjusted; once more ends at once");
    SourceOptions options_again = source_options(a, parse_frames(a.frames));
    options_again.find_colour_camera = false;  // already known to the mapper
    const auto again = open_frames(a, options_again, held_out, given);
    Progress progress(again->size());
    int done = 0;
    run.mapper().reintegrate(*again, adjusted.correction, [&](int frames) {
      if (frames > std::exchange(done, frames)) progress.step("reintegrating");
      return !interrupt.requested();
    });
  });
  return more;
}

void reconstruct(const Arguments& asked) {
  const Inputs inputs = inputs_of(asked).add_recording(asked.poses.string()).add_recording(asked.guess.string());
  const Arguments a = with_output(asked, inputs, asked.poses.empty());
  const Poses poses = a.poses.empty() ? Poses::tracked : Poses::given;
  (void)options_of(a);  // reports wrong options before reading
  const Beginning begin = beginning(a, parse_frames(a.frames));
  const HoldOut& held_out = begin.progressed.hold_out;
  const Trajectory given = given_poses(a);
  const std::optional<PoseCheck> pose_check = check_given_poses(a, source_options(a, begin.range), given);
  const auto source = open_frames(a, source_options(a, begin.range), held_out, given);
  const Options options = options_of(a, source->rig().sensor);
  Run run(a, options, poses, source->rig(), begin.progressed, begin.is_next_recording);
  if (pose_check) report(*pose_check, poses, run);
  if (!a.guess.empty())
    run.compare_with(given, kGuessDrift);
  else if (poses == Poses::tracked)
    run.compare_with(device_poses(a.sequence, a.camera));
  const LastWords ending(run.said_when_ended());
  Interrupt interrupt(Interrupt::Worth::later);
  const std::optional<int> count = source->size();
  const int read = add_frames(a, *source, run, interrupt);
  if (interrupt.requested() && count && read < *count) run.interrupted(*count - read);
  const nlohmann::json more = run.stopped() ? nlohmann::json() : improve(a, held_out, given, run, interrupt);
  interrupt.say(kWriting);
  if (const auto why = source->ended_early()) run.warn(*why);
  if (a.hold_out && !run.stopped() && run.held_out() == 0)
    run.warn(fmt::format("--hold-out {}: no frame was held out: give a smaller number", *a.hold_out));
  end_with(run.finish(more));
}

}  // namespace

void add_reconstruct(CLI::App& program) {
  auto* command = program.add_subcommand("reconstruct", "Turn a recording into a mesh, a map and a trajectory");
  const auto a = std::make_shared<Arguments>();
  add_run_options(*command, *a);
  add_number(*command, "--read-ahead", a->read_ahead, {0, 1000},
             "Frames decoded ahead in a thread of their own; 0: no thread")
      ->capture_default_str();
  command->add_option("--frames", a->frames, kFramesHelp)->type_name("RANGE");
  add_number(*command, "--hold-out", a->hold_out, {2, 1'000'000},
             "Every N-th frame gets a pose and is left out of the map, its colours and its adjustment, so that `cairn "
             "evaluate map` judges the map by frames that it has never seen [none]");
  auto* poses =
      command
          ->add_option(
              "--poses", a->poses,
              "Fuse with these world_from_camera poses (TUM format, or a recording with true poses) and do not track")
          ->check(CLI::ExistingPath)
          ->excludes("--resume");
  command
      ->add_option("--guess", a->guess,
                   "Poses of a phone's odometry, of wheels or of another program (as --poses) to begin each alignment "
                   "with, as long as they are better than the camera's own motion")
      ->check(CLI::ExistingPath)
      ->excludes(poses);
  command
      ->add_option(
          "--poses-convention", a->poses_convention,
          "How --poses or --guess are meant: camera_from_world, wxyz (qw first), opengl, ros or unity axes of "
          "the camera or axes=RIGHT,DOWN,FORWARD (as x,-y,-z), mm, cm, ft or scale=METRES, clock=SECONDS to add; "
          "several are joined by commas [world_from_camera, x right, y down, z forward, metres]")
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
                 "Write the session, the trajectory and report.json alone: for a part of a map that is made of several")
      ->excludes(poses);
  command
      ->add_flag("--refine", a->refine,
                 "Align keyframes with each other after the last frame and bend the map as the pose graph says")
      ->excludes(poses);
  command
      ->add_flag("--adjust", a->adjust,
                 "Adjust keyframes, the surface they see, the moments of their rows and what the depth camera errs by "
                 "together after the last frame, by depth and brightness, and bend the map as keyframes move")
      ->excludes(poses);
  command
      ->add_flag("--reintegrate", a->reintegrate,
                 "Like --refine and --adjust, but then track the frames between keyframes again and fuse all of them "
                 "with depth corrected instead of bending the map")
      ->excludes(poses);
  command->callback([a] { reconstruct(*a); });
}

}  // namespace cairn::apps
