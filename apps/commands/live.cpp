// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <thread>

#include "cairn/io/layouts.hpp"
#include "cairn/io/live_source.hpp"
#include "cairn/mapping/device.hpp"
#include "cairn/mapping/ros2_publisher.hpp"
#include "cairn/mapping/viewer.hpp"
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/final_stages.hpp"
#include "cli/interrupt.hpp"
#include "cli/progress.hpp"
#include "cli/run.hpp"
#include "cli/run_view.hpp"
#include "cli/sources.hpp"

namespace cairn::apps {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;
constexpr int kMaxWidthOnCpu = 256;   // maximum image width in pixels for alignment on a CPU
constexpr auto kFrameTimeout = 50ms;  // longest wait for a frame before viewers are served

constexpr const char* kSkipping = "keeping the map as tracked; interrupt again to end at once";

struct Arguments : RunArguments {
  bool as_fast_as_possible = false, real_time = false;
  std::string publish;  // ros2:DOMAIN; empty: nothing is published
  RunViewArguments view;
  FinalStages stages;
};

/// Returns true if frames may be dropped while the computer is busy: for sources that do not wait.
bool may_drop_frames(const Arguments& a) { return is_sensor(a.sequence) || a.real_time; }

/// Stream of frames. A sensor delivers its newest frame; a recording delivers every frame, at most at recording speed.
/// --real-time delivers the newest frame of a recording, --as-fast-as-possible every frame without pacing.
class Stream {
 public:
  Stream(const Arguments& a, std::unique_ptr<Source> source) : is_sensor_(is_sensor(a.sequence)) {
    if (a.as_fast_as_possible) {
      blocking_ = read_ahead(std::move(source));
    } else {
      newest_ = std::make_unique<LiveSource>(std::move(source), is_sensor_    ? Pace::as_it_comes
                                                                : a.real_time ? Pace::as_recorded
                                                                              : Pace::every_frame);
    }
  }
  [[nodiscard]] const Source& source() const { return newest_ ? *newest_ : *blocking_; }
  [[nodiscard]] bool ended() const { return !is_paused_ && (newest_ ? newest_->ended() : ended_); }
  /// Returns nullopt after a timeout, at the end, and while a recording is paused.
  std::optional<Frame> next() {
    if (is_paused_) {
      std::this_thread::sleep_for(kFrameTimeout);
      return std::nullopt;
    }
    if (newest_) return newest_->next_within(kFrameTimeout);
    arrived_ = Clock::now();
    auto frame = blocking_->next();
    ended_ = !frame;
    return frame;
  }
  [[nodiscard]] Clock::time_point arrived() const { return newest_ ? newest_->arrived() : arrived_; }
  /// A paused recording resumes at the same frame; a sensor keeps delivering frames.
  void pause(bool paused) {
    is_paused_ = paused && !is_sensor_;
    if (newest_) newest_->pause(paused);
  }

 private:
  bool is_sensor_, is_paused_ = false;
  std::unique_ptr<LiveSource> newest_;
  std::unique_ptr<Source> blocking_;
  Clock::time_point arrived_;
  bool ended_ = false;
};

/// On a CPU, aligning fewer pixels (every fourth of 640x480) costs less accuracy than dropping frames. Small images are
/// aligned at the default level.
int finest_level(const Arguments& a, const Camera& depth) {
  TrackOptions track;
  const auto devices = list_devices();
  const bool is_cpu = std::all_of(devices.begin(), devices.end(), [&](const DeviceInfo& d) {
    return d.type == "cpu" || d.missing || (a.device >= 0 && d.index != a.device);
  });
  if (is_cpu && may_drop_frames(a))
    while (track.finest_level + 1 < track.levels && depth.width >> track.finest_level > kMaxWidthOnCpu)
      ++track.finest_level;
  return track.finest_level;
}

/// Shares freed memory between threads and returns large blocks to the system. Otherwise the memory of a long run would
/// grow by per-thread caches and fragmentation.
void limit_heap_growth() {
  mallopt(M_ARENA_MAX, 2);
  mallopt(M_MMAP_THRESHOLD, 1 << 20);
  mallopt(M_TRIM_THRESHOLD, 16 << 20);
}

/// Stream statistics for report.json.
nlohmann::json to_json(double seconds, int fused, int dropped, const Durations& latencies, const LiveViewer* view) {
  nlohmann::json json{
      {"seconds", seconds},
      {"frames_per_second", fused / seconds},
      {"skipped_to_keep_up", dropped},
      {"latency_ms",
       {{"median", latencies.percentile(0.5)}, {"p95", latencies.percentile(0.95)}, {"max", latencies.max()}}}};
  if (view == nullptr) return json;
  const LiveViewer::ViewerStats viewer = view->stats();
  json["view"] = {{"parts", viewer.parts},
                  {"updates_per_second", viewer.updates_per_second},
                  {"ms_per_update", viewer.ms_per_update}};
  if (viewer.first_mesh_seconds) json["view"]["first_mesh_seconds"] = *viewer.first_mesh_seconds;
  return json;
}

/// Statistics of the run since the last reset.
struct LiveStats {
  Durations latencies;
  int fused = 0, read = 0, dropped_before = 0;  // frames; before the last reset
  double first_stamp = 0, last_stamp = 0;       // seconds
  Clock::time_point first = Clock::now();

  void add(const Frame& frame) {
    if (read++ == 0) first_stamp = frame.timestamp;
    last_stamp = frame.timestamp;
  }
  [[nodiscard]] FrameRates frame_rates(int dropped) const {
    FrameRates rates{.dropped = dropped - dropped_before};
    if (const double seconds = last_stamp - first_stamp; seconds > 0 && rates.dropped > 0) {
      rates.processed = (read - 1) / seconds;
      rates.received = (read - 1 + rates.dropped) / seconds;
    }
    return rates;
  }
};

/// Prints the stream statistics in one line.
void print(const nlohmann::json& json, const FrameRates& frame_rates, const LiveStats& stats) {
  const std::string pace = frame_rates.received > 0
                               ? fmt::format("keeps up with {:.0f} of {:.0f} frames a second, {} dropped",
                                             frame_rates.processed, frame_rates.received, frame_rates.dropped)
                               : fmt::format("{:.1f} frames/s", json["frames_per_second"].get<double>());
  fmt::print("live        {}, {:.0f} ms from frame to pose (95 %)\n", pace, stats.latencies.percentile(0.95));
}

/// Sets the messages of the first and the second signal: the second skips the final stages, if there are any.
void set_messages(const Arguments& a, const Run& run, Interrupt& interrupt) {
  const bool has_stages = a.stages.apply_to(run);
  interrupt.set_message(has_stages ? "improving the map of the frames so far; interrupt again to skip this"
                                   : kFinishing);
  interrupt.set_next_message(has_stages ? kSkipping : "");
}

void update(TrackingState& tracking, const FrameReport& report, int dropped) {
  using Is = TrackingState::Is;
  if (report.state != FrameState::skipped) tracking.is = report.state == FrameState::lost ? Is::lost : Is::tracking;
  tracking.dropped = dropped;
}

/// Processes frames until the recording or the user ends the run; handles the page's commands between frames.
void process_frames(const Arguments& a, Interrupt& interrupt, Stream& stream, Run& run, const Options& options,
                    LiveViewer* view, TrackingState& tracking, Ros2Publisher* publisher, LiveStats& stats) {
  const std::optional<int> count = is_sensor(a.sequence) ? std::nullopt : stream.source().size();
  Progress progress(may_drop_frames(a) ? std::nullopt : count, "frames", relative_time(a.stages.quality, count));
  bool paused = false;
  int read = 0;
  Clock::duration waited{};
  while (!interrupt.requested()) {
    if (view) {
      const LiveViewer::ViewerCommands commands = view->commands();
      if (commands.finish) break;
      if (commands.pause) stream.pause(paused = *commands.pause);
      if (commands.reset) {
        run.reset();
        if (!interrupt.requested()) set_messages(a, run, interrupt);
        view->begin(run.mapper(), stream.source().rig(), options, run.frames_before());
        if (publisher) publisher->begin(run.mapper());
        stats = {.latencies = {}, .dropped_before = stream.source().dropped()};
      }
    }
    const auto wait_begin = Clock::now();
    const auto frame = stream.next();
    waited += Clock::now() - wait_begin;
    if (!frame && stream.ended()) break;
    read += frame.has_value();
    if (frame && !paused) {
      stats.add(*frame);
      const FrameReport report = run.add(*frame, milliseconds(std::exchange(waited, {})));
      if (run.stopped()) break;
      update(tracking, report, stream.source().dropped());
      stats.fused += report.state == FrameState::fused;
      if (report.state == FrameState::fused) interrupt.allow_graceful_exit();
      if (!interrupt.requested()) set_messages(a, run, interrupt);
      const double latency = milliseconds(Clock::now() - stream.arrived());
      stats.latencies.add(latency);
      progress.step(
          to_string(report, a.verbose) +
          (stream.source().dropped() > 0 ? fmt::format(", {} dropped to keep up", stream.source().dropped()) : ""));
      if (view) view->fused(*frame, report, latency);
      if (publisher) publisher->add(report);
    }
    if (view) view->update(paused, stream.source().dropped());
  }
  if (const int gone = read + stream.source().dropped(); interrupt.requested() && count && gone < *count)
    run.interrupted(*count - gone);
}

/// Runs the stages after the last frame, and adds their results to the report.
void improve(const Arguments& a, const RunProgress& begin, const LiveStats& stats, Run& run, Interrupt& interrupt,
             LiveViewer* view, nlohmann::json& report) {
  if (run.stopped() || !a.stages.apply_to(run) || (stats.read == 0 && begin.improved)) return;
  interrupt.begin_next_step(kSkipping);
  std::unique_ptr<Source> again;
  const FrameRange read{.end = run.next_frame() - first_index(a.sequence)};
  if (!interrupt.requested()) again = open_again(a.stages, a, read, run);
  if (again) again = read_ahead(hold_out(std::move(again), begin.hold_out));
  report.update(improve(a.stages, again.get(), begin.judges, run, interrupt, view));
}

void live(const Arguments& requested) {
  Arguments a = with_output(requested, inputs_of(requested));
  a.may_be_reset = a.view.view;
  limit_heap_growth();
  Options options = options_of(a);  // reports wrong options before a sensor is opened
  ResumePoint begin = resume_point(a, {});
  std::optional<RunView> page;
  if (a.view.view) page.emplace(a.view, "see the map, and pause, reset and finish the run");
  LiveViewer* const view = page ? &page->viewer() : nullptr;
  std::optional<Ros2Publisher> publisher;
  if (!a.publish.empty())
    publisher.emplace(a.publish,
                      is_ros_recording(a.sequence) ? Ros2Publisher::Stamps::frames : Ros2Publisher::Stamps::now);
  const auto tracking = std::make_shared<TrackingState>();
  SourceOptions input = source_options(a, begin.range);
  input.tracking = tracking;
  auto source = open_source(a.sequence, input);
  hold_out_to_judge(a.stages.quality, a, *source, begin.progressed);
  Stream stream(a, hold_out(std::move(source), begin.progressed.hold_out));
  const Rig& rig = stream.source().rig();
  options = options_of(a, rig.sensor, stream.source().has_assumed_rate(), finest_level(a, rig.depth));
  Run run(a, options, Poses::tracked, stream.source().rig(), begin.progressed, begin.is_next_recording);
  run.compare_with(device_poses(a.sequence, a.camera));
  if (view) view->begin(run.mapper(), stream.source().rig(), options, run.frames_before());
  if (publisher) publisher->begin(run.mapper());

  LiveStats stats;
  std::optional<ExitMessage> exit_message(run.exit_message());
  std::optional<Interrupt> interrupt(Interrupt::Graceful::later);
  process_frames(a, *interrupt, stream, run, options, view, *tracking, publisher ? &*publisher : nullptr, stats);
  publisher.reset();
  bool is_interrupted = interrupt->requested();
  if (view) view->finishing();
  if (const auto why = stream.source().ended_early()) run.warn(*why);
  const double seconds = std::chrono::duration<double>(Clock::now() - stats.first).count();
  const int dropped = stream.source().dropped();  // read now, since a sensor keeps running while files are written
  nlohmann::json report{{"live", to_json(seconds, stats.fused, dropped, stats.latencies, view)}};
  const FrameRates frame_rates = stats.frame_rates(dropped);
  run.set_frame_rates(frame_rates);
  improve(a, begin.progressed, stats, run, *interrupt, view, report);
  interrupt->set_message(kWriting);
  interrupt->set_next_message("");
  if (view) view->finishing();
  const Verdict verdict = run.finish(report);
  if (!a.json && !is_quiet()) print(report["live"], frame_rates, stats);
  exit_message.reset();
  is_interrupted = is_interrupted || interrupt->requested();
  interrupt.reset();
  if (page) page->show_result(a.output, is_interrupted);
  exit_with(verdict);
}

}  // namespace

void add_live(CLI::App& program) {
  auto* command = program.add_subcommand("live", "Map with a depth camera in real time, and watch the map grow");
  const auto a = std::make_shared<Arguments>();
  add_run_options(*command, *a);
  add_run_view(*command, a->view);
  add_quality(*command, a->stages.quality);
  auto* fast = command->add_flag("--as-fast-as-possible", a->as_fast_as_possible,
                                 "Play a recording faster than recorded, if possible");
  command
      ->add_flag("--real-time", a->real_time,
                 "Play a recording at recorded speed, and drop frames to keep up, as with a sensor [every frame, "
                 "slower if necessary]")
      ->excludes(fast);
  command
      ->add_option("--publish", a->publish,
                   "Publish poses and the surface as ROS 2 topics: ros2: for the domain ROS_DOMAIN_ID, else 0, or "
                   "ros2:DOMAIN")
      ->type_name("ros2:");
  command->callback([a] { live(*a); });
}

}  // namespace cairn::apps
