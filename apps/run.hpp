// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What `reconstruct` and `live` share: from options to frames to written files.
#pragma once
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cairn/mapper.hpp"
#include "cairn/run_log.hpp"
#include "cairn/session.hpp"
#include "cairn/source.hpp"
#include "cairn/unfinished.hpp"
#include "cairn/verdict.hpp"
#include "durations.hpp"
#include "export_options.hpp"
#include "frame_log.hpp"
#include "inputs_and_outputs.hpp"
#include "output_folder.hpp"

namespace cairn::apps {

/// What the user says about a map and where it goes.
struct RunArguments : OutputArguments {
  std::string sequence;
  std::filesystem::path config, camera, log;
  std::optional<std::string> sensor;
  std::string motion = "hand";
  std::optional<std::string> up;
  std::vector<std::string> topics;
  std::optional<float> voxel_size;
  std::optional<std::uint64_t> device_memory_mib, host_memory_mib;
  int device = -1;
  std::optional<int> hold_out;  // every so many frames; none: as the session says
  double checkpoint_seconds = 20;
  std::optional<float> esdf_voxel_size, max_distance, robot_radius;
  bool esdf = false, resume = false, no_loops = false, json = false;
  bool verbose = false, no_mesh = false;
  bool may_be_reset = false;           // see Run::reset
  std::filesystem::path asked_output;  // OUT as it was given, before choose_output
  MeshArguments mesh;
};

void add_run_options(CLI::App& command, RunArguments& a);
/// What all runs read.
[[nodiscard]] Inputs inputs_of(const RunArguments& a);
/// The arguments with the folder that the map goes to: see choose_output. Throws std::runtime_error where an output is
/// not apart from the inputs.
template <class Arguments>
[[nodiscard]] Arguments with_output(Arguments a, const Inputs& inputs, bool can_resume = true) {
  a.asked_output = a.output;
  inputs.expect_apart_from_folder(a.output);
  inputs.expect_apart_from_file(a.log);
  if (a.resume) return a;
  a.output = choose_output(a, can_resume);
  inputs.expect_apart_from_folder(a.output);
  return a;
}
/// What suits the sensor and the user, checked; `finest_level` is the program's own default of that option. Throws
/// std::runtime_error for what does not fit.
[[nodiscard]] Options options_of(const RunArguments& a, const SensorModel& sensor = {},
                                 int finest_level = TrackOptions{}.finest_level);
/// What they open their source with.
[[nodiscard]] SourceOptions source_options(const RunArguments& a, const FrameRange& range);

/// What a session remembers for this program.
struct Progressed {
  std::string recording;  // see identity()
  int next = 0;           // frame
  HoldOut hold_out;
  FrameLog frames;
  std::string evidence;  // Evidence::save

  [[nodiscard]] std::string note() const;
  static Progressed from(const std::string& note);
};

/// A frame's report in a few words; `verbose`: with numbers.
[[nodiscard]] std::string words(const FrameReport& report, bool verbose);
[[nodiscard]] double peak_memory_mb();

/// From the first frame to the written files.
class Run {
 public:
  /// `progressed` is what an earlier run of the same sequence did; with RunArguments::resume and another sequence the
  /// map goes on with a new recording. The output folder is made; without resume the session in it stays until the
  /// first checkpoint.
  Run(RunArguments arguments, const Options& options, Poses poses, const Rig& rig, Progressed progressed,
      bool is_next_recording);

  /// Fuses a frame. One at which the mapper fails, as without memory, stops the run: it is to be finished then. Throws
  /// std::runtime_error if that is the first.
  FrameReport add(const Frame& frame, double waited_ms);
  /// Poses that the recording's device, or its owner, had while it was taken: what is tracked is held against them.
  /// `drift`: see Evidence::hold_against_device.
  void compare_with(Trajectory device_poses, double drift = 1) {
    device_poses_ = std::move(device_poses);
    device_drift_ = drift;
  }
  [[nodiscard]] bool stopped() const { return stopped_.has_value(); }
  /// Frames that have a pose and are no part of the map.
  [[nodiscard]] int held_out() const { return progressed_.frames.count("held_out"); }
  /// Forgets what this run has mapped, also what is saved of it, and begins again with the next frame: with an empty
  /// map, or with RunArguments::resume, where RunArguments::may_be_reset says that it may come to this, with the map as
  /// the run has found it.
  void reset();
  /// Frames of earlier runs that reset() leaves.
  [[nodiscard]] int frames_before() const { return found_.frames.size(); }
  [[nodiscard]] Mapper& mapper() { return *mapper_; }
  /// Does the work and keeps its time under a stage's name.
  void timed(const char* stage, const std::function<void()>& work);
  /// Tells the user at once, and whoever reads the report.
  void warn(const std::string& text);
  /// Checked given poses, of which the verdict and report.json speak.
  void set_pose_check(const PoseCheck& check);
  /// Warns of what the map has switched off since it was last asked.
  void tell_warnings();

  /// What came of a stream that does not wait.
  void keeps_up(const KeepingUp& keeping_up) { keeping_up_ = keeping_up; }
  /// Tells that the user ended the run `left` frames before its recording ends.
  void interrupted(int left);
  /// The same of a stage after the last frame.
  void interrupted_in(const char* stage);
  /// What to say when the user ends the program at once, as of the moment when it is asked; it may outlive this.
  [[nodiscard]] std::function<std::string()> said_when_ended() const;
  /// Writes everything, with report.json and report.html, of which `more` is a part, and tells the user how it went.
  /// Throws std::runtime_error if no frame could be used, or with what could not be written.
  [[nodiscard]] Verdict finish(const nlohmann::json& more = {});

 private:
  using Clock = std::chrono::steady_clock;
  void begin_map();
  [[nodiscard]] Verdict judge(int components) const;
  /// Once the map is written, it is held against the frames that it was made from.
  void hold_against_frames();
  /// Adds the options, the frames, the verdict and the checks of this run to report.json.
  void complete(nlohmann::json& report, const Verdict& verdict) const;
  /// With --log, as long as the log can be written.
  void log(const std::function<void(RunLog&)>& work);
  [[nodiscard]] std::string how_to_go_on() const;
  /// Makes the folder, and remembers what of it is new.
  void prepare();
  void checkpoint();
  void tell(const nlohmann::json& report, const Verdict& verdict) const;
  RunArguments arguments_;
  Options options_;
  Poses poses_;
  Rig rig_;
  Progressed found_;  // of the runs that this one goes on from
  bool is_next_recording_;
  Progressed progressed_;
  std::vector<Unfinished> unfinished_;  // what this run made and nobody can go on with yet
  std::optional<int> left_;             // frames, of a run that was interrupted
  std::string left_stage_;              // in which it was
  KeepingUp keeping_up_;
  Evidence evidence_;
  Trajectory device_poses_;  // empty: none
  double device_drift_ = 1;
  std::optional<ReplacedSession> replaced_;  // its place, when this run makes none: nobody else writes there
  std::optional<Session> session_;           // of tracked poses
  std::optional<Mapper> mapper_;
  std::optional<RunLog> log_;
  std::map<std::string, Durations> stages_;
  std::vector<std::string> warnings_;
  std::optional<PoseCheck> pose_check_;
  std::optional<std::string> stopped_;  // why
  bool has_colour_ = false;
  int colourless_ = 0;    // frames before there is colour
  std::size_t told_ = 0;  // of the map's own warnings
  Clock::time_point start_ = Clock::now(), saved_ = start_;
};

/// Where a run begins: what an earlier one did, and the frames that are left.
struct Beginning {
  Progressed progressed;
  FrameRange range;
  bool is_next_recording = false;
};
/// Throws std::runtime_error where frames of a recording are to be held out in another way than those before them.
[[nodiscard]] Beginning beginning(const RunArguments& a, FrameRange range);

/// Its level and words, and a line for each reason.
void print(const Verdict& verdict, std::FILE* out);
/// Ends the program with exit code 3 where a verdict is bad.
void end_with(const Verdict& verdict);

}  // namespace cairn::apps
