// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Shared by `reconstruct` and `live`: from options over frames to written files.
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

#include "base/unfinished.hpp"
#include "cairn/eval/verdict.hpp"
#include "cairn/io/source.hpp"
#include "cairn/mapping/mapper.hpp"
#include "cairn/mapping/run_log.hpp"
#include "cairn/mapping/session.hpp"
#include "cli/durations.hpp"
#include "cli/export_options.hpp"
#include "cli/frame_log.hpp"
#include "cli/inputs_and_outputs.hpp"
#include "cli/output_folder.hpp"

namespace cairn::apps {

/// Options for a map and its output.
struct RunArguments : OutputArguments {
  std::string sequence;
  std::filesystem::path config, camera, log;
  std::optional<std::string> sensor;
  std::optional<std::string> motion;
  std::string device_poses = "prior";
  std::optional<std::string> up;
  std::vector<std::string> topics;
  std::optional<float> voxel_size;
  std::optional<std::uint64_t> device_memory_mib, host_memory_mib;
  int device = -1;
  std::optional<int> hold_out;  // interval in frames; empty: as in the session
  double checkpoint_seconds = 20;
  std::optional<float> esdf_voxel_size, max_distance, robot_radius;
  bool esdf = false, resume = false, no_loops = false, json = false;
  bool verbose = false, no_mesh = false;
  bool may_be_reset = false;           // see Run::reset
  std::filesystem::path asked_output;  // OUT as given, before choose_output
  MeshArguments mesh;
};

void add_run_options(CLI::App& command, RunArguments& a);
/// Adds --quality.
CLI::Option* add_quality(CLI::App& command, Quality& quality);
/// Inputs of all runs.
[[nodiscard]] Inputs inputs_of(const RunArguments& a);
/// Returns the arguments with the chosen output folder, see choose_output. Throws std::runtime_error if an output
/// overlaps an input.
template <class Arguments>
[[nodiscard]] Arguments with_output(Arguments a, const Inputs& inputs, bool can_resume = true) {
  a.asked_output = a.output;
  inputs.check_output_folder(a.output);
  inputs.check_output_file(a.log);
  if (a.resume) return a;
  a.output = choose_output(a, can_resume);
  inputs.check_output_folder(a.output);
  return a;
}
/// Checked options for the sensor and the user's arguments; `finest_level` is the program's default for this option.
/// Throws std::runtime_error for invalid combinations.
[[nodiscard]] Options options_of(const RunArguments& a, const SensorModel& sensor = {}, bool has_assumed_rate = false,
                                 int finest_level = TrackOptions{}.finest_level);
/// Options for opening the source.
[[nodiscard]] SourceOptions source_options(const RunArguments& a, const FrameRange& range);

/// State of the program in a session.
struct RunProgress {
  std::string recording;  // see identity()
  int next = 0;           // frame
  HoldOut hold_out;
  bool judges = false;    // the held-out frames judge the quality, and join the map in the end
  bool improved = false;  // the stages of a quality have run on these frames
  FrameLog frames;
  std::string evidence;  // Evidence::save

  [[nodiscard]] std::string note() const;
  static RunProgress from(const std::string& note);
};

/// Short text for a frame's report; `verbose` adds numbers.
[[nodiscard]] std::string to_string(const FrameReport& report, bool verbose);
[[nodiscard]] double peak_memory_mb();

/// A run from the first frame to the written files.
class Run {
 public:
  /// Creates the output folder. `progressed` is the state of an earlier run of the same sequence; with
  /// RunArguments::resume and another sequence, the map continues with a new recording. Without resume, an existing
  /// session remains until the first checkpoint.
  Run(RunArguments arguments, const Options& options, Poses poses, const Rig& rig, RunProgress progressed,
      bool is_next_recording);

  /// Fuses a frame. A failure of the mapper, such as out of memory, stops the run, and finish() must follow. Throws if
  /// no frame has been fused before.
  FrameReport add(const Frame& frame, double waited_ms);
  /// Sets reference poses from the recording's device or its owner, compared with the tracked poses. `drift`: see
  /// RunMonitor::compare_with_device.
  void compare_with(Trajectory device_poses, double drift = 1) {
    device_poses_ = std::move(device_poses);
    device_drift_ = drift;
  }
  [[nodiscard]] bool stopped() const { return stopped_.has_value(); }
  /// Frames with a pose that are not part of the map.
  [[nodiscard]] int held_out() const { return progressed_.frames.count("held_out"); }
  /// Index of the frame after the last one.
  [[nodiscard]] int next_frame() const { return progressed_.next; }
  /// Frames with a pose, of all recordings.
  [[nodiscard]] int posed() const { return progressed_.frames.count("fused") + held_out(); }
  /// Records that the stages of a quality have run. A resumed run without new frames does not repeat them.
  void improved() { progressed_.improved = true; }
  /// Records that the held-out frames have joined the map.
  void fused_held_out() { progressed_.frames.replace("held_out", "fused"); }
  /// Discards the results of this run, including saved state, and restarts at the next frame: with an empty map, or
  /// with the map as found, if RunArguments::resume is set. The latter requires RunArguments::may_be_reset.
  void reset();
  /// Frames of earlier runs, which reset() keeps.
  [[nodiscard]] int frames_before() const { return previous_.frames.size(); }
  [[nodiscard]] Mapper& mapper() { return *mapper_; }
  [[nodiscard]] const Mapper& mapper() const { return *mapper_; }
  /// Runs `work` and records its duration under a stage's name.
  void timed(const char* stage, const std::function<void()>& work);
  void add_time(const std::string& stage, double milliseconds);
  /// Prints a warning at once and adds it to the report.
  void warn(const std::string& text);
  /// Sets the check of given poses, for the verdict and report.json.
  void set_pose_check(const PoseCheck& check);
  /// Warns of features that the map has disabled since the last call.
  void print_warnings();

  /// Sets statistics of a stream that does not wait.
  void set_frame_rates(const FrameRates& frame_rates) { frame_rates_ = frame_rates; }
  /// Marks the run as interrupted by the user, `left` frames before the end of its recording.
  void interrupted(int left);
  /// Marks a stage after the last frame as interrupted. A sensor's run cannot repeat it.
  void interrupted_in(const std::string& stage);
  /// Returns a function for the message at an immediate end by the user, reflecting the state when called. The function
  /// may outlive this object.
  [[nodiscard]] std::function<std::string()> exit_message() const;
  /// Files made from the written map; returns their entries for report.json.
  using MoreFiles = std::function<nlohmann::json(Map& map)>;
  /// Writes all files, with `more` merged into report.json and report.html, then `more_files`, whose failure is a
  /// warning, and prints a summary. Throws std::runtime_error if no frame was usable, or listing the files that could
  /// not be written.
  [[nodiscard]] Verdict finish(const nlohmann::json& more = {}, const MoreFiles& more_files = {});

 private:
  using Clock = std::chrono::steady_clock;
  void create_map();
  [[nodiscard]] Verdict judge(int components) const;
  /// Writes `more_files` and adds their entries to the report.
  void add_files(const MoreFiles& more_files, nlohmann::json& report);
  /// Compares the written map with the frames it was made from.
  void compare_with_frames();
  /// Adds the options, the frames, the verdict and the checks of this run to report.json.
  void complete(nlohmann::json& report, const Verdict& verdict) const;
  /// Logs with --log, until the log cannot be written.
  void log(const std::function<void(RunLog&)>& work);
  [[nodiscard]] std::string resume_instructions() const;
  /// Creates the folder and records its new files.
  void prepare();
  void checkpoint();
  void print_summary(const nlohmann::json& report, const Verdict& verdict) const;
  RunArguments arguments_;
  Options options_;
  Poses poses_;
  Rig rig_;
  RunProgress previous_;  // state of earlier runs that this run continues
  bool is_next_recording_;
  RunProgress progressed_;
  std::vector<Unfinished> unfinished_;  // new files of this run, not resumable yet
  std::optional<int> frames_left_;      // remaining frames of an interrupted run
  std::string interrupted_stage_;       // interrupted stage
  FrameRates frame_rates_;
  RunMonitor evidence_;
  Trajectory device_poses_;  // empty: none
  double device_drift_ = 1;
  std::optional<ReplacedSession> replaced_;  // locks the session folder if this run has no session
  std::optional<Session> session_;           // with tracked poses
  std::optional<Mapper> mapper_;
  std::optional<RunLog> log_;
  std::map<std::string, Durations> stages_;
  std::vector<std::string> warnings_;
  std::optional<PoseCheck> pose_check_;
  std::optional<std::string> stopped_;  // reason
  bool has_color_ = false;
  int colorless_ = 0;                 // frames before the first color
  std::size_t printed_warnings_ = 0;  // number of the map's warnings already printed
  Clock::time_point start_ = Clock::now(), saved_ = start_;
};

/// Starting point of a run: the state of an earlier run and the remaining frames.
struct ResumePoint {
  RunProgress progressed;
  FrameRange range;
  bool is_next_recording = false;
};
/// Throws std::runtime_error if the hold-out of a recording differs from that of its earlier frames.
[[nodiscard]] ResumePoint resume_point(const RunArguments& a, FrameRange range);

/// Prints level and words of a verdict, and a line for each reason.
void print(const Verdict& verdict, std::FILE* out);
/// Ends the program with exit code 3 if the verdict is bad.
void exit_with(const Verdict& verdict);

}  // namespace cairn::apps
