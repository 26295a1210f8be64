// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <thread>

#include "cairn/device.hpp"
#include "cairn/layouts.hpp"
#include "cairn/live_source.hpp"
#include "cairn/viewer.hpp"
#include "commands.hpp"
#include "console.hpp"
#include "interrupt.hpp"
#include "progress.hpp"
#include "run.hpp"
#include "sources.hpp"
#include "view_options.hpp"

namespace cairn::apps {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;
constexpr int kWidthOnCpu = 256;  // maximum image width in pixels for alignment on a CPU
constexpr auto kPatience = 50ms;  // longest wait for a frame before viewers are served
constexpr auto kGone = 5s;        // after this time a viewer is gone, not reloading
constexpr auto kShown = 10s;      // time for viewers to fetch the result after an interrupt

struct Arguments : RunArguments {
  bool view = false, as_fast_as_possible = false, real_time = false;
  ViewArguments page;
};

/// Returns true if frames may be dropped while the computer is busy: for sources that do not wait.
bool leaves_out(const Arguments& a) { return is_sensor(a.sequence) || a.real_time; }

/// Stream of frames. A sensor delivers its newest frame; a recording delivers every frame, at most at recording speed.
/// --real-time delivers the newest frame of a recording, --as-fast-as-possible every frame without pacing.
class Stream {
 public:
  Stream(const Arguments& a, const FrameRange& range) : is_sensor_(is_sensor(a.sequence)) {
    auto source = open_source(a.sequence, source_options(a, range));
    if (a.as_fast_as_possible) {
      every_ = read_ahead(std::move(source));
    } else {
      newest_ = std::make_unique<LiveSource>(std::move(source), is_sensor_    ? Pace::as_it_comes
                                                                : a.real_time ? Pace::as_recorded
                                                                              : Pace::every_frame);
    }
  }
  [[nodiscard]] const Source& source() const { return newest_ ? *newest_ : *every_; }
  [[nodiscard]] bool ended() const { return !is_held_ && (newest_ ? newest_->ended() : ended_); }
  /// Returns nullopt after a timeout, at the end, and while a recording is paused.
  std::optional<Frame> next() {
    if (is_held_) {
      std::this_thread::sleep_for(kPatience);
      return std::nullopt;
    }
    if (newest_) return newest_->next_within(kPatience);
    arrived_ = Clock::now();
    auto frame = every_->next();
    ended_ = !frame;
    return frame;
  }
  [[nodiscard]] Clock::time_point arrived() const { return newest_ ? newest_->arrived() : arrived_; }
  /// A paused recording resumes at the same frame; a sensor keeps delivering frames.
  void pause(bool paused) {
    is_held_ = paused && !is_sensor_;
    if (newest_) newest_->pause(paused);
  }

 private:
  bool is_sensor_, is_held_ = false;
  std::unique_ptr<LiveSource> newest_;
  std::unique_ptr<Source> every_;
  Clock::time_point arrived_;
  bool ended_ = false;
};

double milliseconds(Clock::duration d) { return std::chrono::duration<double, std::milli>(d).count(); }

/// On a CPU, aligning fewer pixels (every fourth of 640x480) costs less accuracy than dropping frames. Small images are
/// aligned at the default level.
int finest_level(const Arguments& a, const Camera& depth) {
  TrackOptions track;
  const auto devices = list_devices();
  const bool is_cpu = std::all_of(devices.begin(), devices.end(), [&](const DeviceInfo& d) {
    return d.type == "cpu" || d.missing || (a.device >= 0 && d.index != a.device);
  });
  if (is_cpu && leaves_out(a))
    while (track.finest_level + 1 < track.levels && depth.width >> track.finest_level > kWidthOnCpu)
      ++track.finest_level;
  return track.finest_level;
}

/// Shares freed memory between threads and returns large blocks to the system. Otherwise the memory of a long run would
/// grow by per-thread caches and fragmentation.
void keep_memory_together() {
  mallopt(M_ARENA_MAX, 2);
  mallopt(M_MMAP_THRESHOLD, 1 << 20);
  mallopt(M_TRIM_THRESHOLD, 16 << 20);
}

/// Stream statistics for report.json.
nlohmann::json to_json(double seconds, int fused, int dropped, const Durations& latencies, const LiveViewer* view) {
  nlohmann::json told{
      {"seconds", seconds},
      {"frames_per_second", fused / seconds},
      {"skipped_to_keep_up", dropped},
      {"latency_ms",
       {{"median", latencies.percentile(0.5)}, {"p95", latencies.percentile(0.95)}, {"max", latencies.most()}}}};
  if (view == nullptr) return told;
  const LiveViewer::Told seen = view->told();
  told["view"] = {
      {"parts", seen.parts}, {"updates_per_second", seen.updates_per_second}, {"ms_per_update", seen.ms_per_update}};
  if (seen.first_mesh_seconds) told["view"]["first_mesh_seconds"] = *seen.first_mesh_seconds;
  return told;
}

/// Statistics of the run since the last reset.
struct Course {
  Durations latencies;
  int fused = 0, read = 0, left_out_before = 0;  // frames; before the last reset
  double first_stamp = 0, last_stamp = 0;        // seconds
  Clock::time_point first = Clock::now();

  void add(const Frame& frame) {
    if (read++ == 0) first_stamp = frame.timestamp;
    last_stamp = frame.timestamp;
  }
  [[nodiscard]] KeepingUp keeping_up(int left_out) const {
    KeepingUp told{.left_out = left_out - left_out_before};
    if (const double seconds = last_stamp - first_stamp; seconds > 0 && told.left_out > 0) {
      told.taken = (read - 1) / seconds;
      told.came = (read - 1 + told.left_out) / seconds;
    }
    return told;
  }
};

/// Prints the stream statistics in one line.
void print(const nlohmann::json& told, const KeepingUp& keeping_up, const Course& course) {
  const std::string pace = keeping_up.came > 0
                               ? fmt::format("keeps up with {:.0f} of {:.0f} frames a second, {} left out",
                                             keeping_up.taken, keeping_up.came, keeping_up.left_out)
                               : fmt::format("{:.1f} frames/s", told["frames_per_second"].get<double>());
  fmt::print("live        {}, {:.0f} ms from frame to pose (95 %)\n", pace, course.latencies.percentile(0.95));
}

/// Serves the result while a viewer is connected; after Ctrl-C only until viewers have fetched it.
void show_result(LiveViewer& view, const std::filesystem::path& output, bool is_interrupted) {
  view.finished(output);
  if (view.viewers() == 0) return;
  std::fflush(stdout);
  const Interrupt interrupt(Interrupt::Worth::now, "");
  if (!is_interrupted) fmt::print(stderr, "the page shows the result; Ctrl-C or closing it ends\n");
  const auto begin = Clock::now();
  for (auto seen = begin; !interrupt.requested() && Clock::now() - seen < kGone;) {
    std::this_thread::sleep_for(kPatience);
    if (view.viewers() > 0) seen = Clock::now();
    if (is_interrupted && (view.is_shown() || Clock::now() - begin > kShown)) break;
  }
}

/// Processes frames until the recording or the user ends the run; handles the page's commands between frames.
void follow(const Arguments& a, Interrupt& interrupt, Stream& stream, Run& run, const Options& options,
            LiveViewer* view, Course& course) {
  const std::optional<int> count = is_sensor(a.sequence) ? std::nullopt : stream.source().size();
  Progress progress(leaves_out(a) ? std::nullopt : count);
  bool paused = false;
  int read = 0;
  Clock::duration waited{};
  while (!interrupt.requested()) {
    if (view) {
      const LiveViewer::Asked asked = view->asked();
      if (asked.finish) break;
      if (asked.pause) stream.pause(paused = *asked.pause);
      if (asked.reset) {
        run.reset();
        view->begin(run.mapper(), stream.source().rig(), options, run.frames_before());
        course = {.latencies = {}, .left_out_before = stream.source().dropped()};
      }
    }
    const auto asked_at = Clock::now();
    const auto frame = stream.next();
    waited += Clock::now() - asked_at;
    if (!frame && stream.ended()) break;
    read += frame.has_value();
    if (frame && !paused) {
      course.add(*frame);
      const FrameReport report = run.add(*frame, milliseconds(std::exchange(waited, {})));
      if (run.stopped()) break;
      course.fused += report.state == FrameState::fused;
      if (report.state == FrameState::fused) interrupt.is_worth_finishing();
      const double latency = milliseconds(Clock::now() - stream.arrived());
      course.latencies.add(latency);
      progress.step(words(report, a.verbose) + (stream.source().dropped() > 0
                                                    ? fmt::format(", {} left out to keep up", stream.source().dropped())
                                                    : ""));
      if (view) view->fused(*frame, report, latency);
    }
    if (view) view->update(paused, stream.source().dropped());
  }
  if (const int gone = read + stream.source().dropped(); interrupt.requested() && count && gone < *count)
    run.interrupted(*count - gone);
}

void live(const Arguments& given) {
  Arguments a = with_output(given, inputs_of(given));
  a.may_be_reset = a.view;
  keep_memory_together();
  Options options = options_of(a);  // reports wrong options before a sensor is opened
  const Beginning begin = beginning(a, {});
  std::optional<LiveViewer> view;
  std::unique_ptr<BrowserPage> page;
  if (a.view) {
    const ViewerSite& site = view.emplace(a.page.at).site();
    fmt::print(stderr, "view        {}\n", site.urls.front().url);
    page = tell_how_to_open(a.page, site, "see the map, and pause, reset and finish the run",
                            [&view] { return view->is_opened(); });
  }
  Stream stream(a, begin.range);
  const Rig& rig = stream.source().rig();
  options = options_of(a, rig.sensor, finest_level(a, rig.depth));
  Run run(a, options, Poses::tracked, stream.source().rig(), begin.progressed, begin.is_next_recording);
  run.compare_with(device_poses(a.sequence, a.camera));
  if (view) view->begin(run.mapper(), stream.source().rig(), options, run.frames_before());

  Course course;
  std::optional<LastWords> ending(run.said_when_ended());
  std::optional<Interrupt> interrupt(Interrupt::Worth::later);
  follow(a, *interrupt, stream, run, options, view ? &*view : nullptr, course);
  interrupt->say(kWriting);
  if (view) view->finishing();
  if (const auto why = stream.source().ended_early()) run.warn(*why);
  const double seconds = std::chrono::duration<double>(Clock::now() - course.first).count();
  const int dropped = stream.source().dropped();  // read now, since a sensor keeps running while files are written
  const nlohmann::json told = to_json(seconds, course.fused, dropped, course.latencies, view ? &*view : nullptr);
  const KeepingUp keeping_up = course.keeping_up(dropped);
  run.keeps_up(keeping_up);
  const Verdict verdict = run.finish({{"live", told}});
  if (!a.json && !is_quiet()) print(told, keeping_up, course);
  ending.reset();
  const bool is_interrupted = interrupt->requested();
  interrupt.reset();
  if (view) show_result(*view, a.output, is_interrupted);
  end_with(verdict);
}

}  // namespace

void add_live(CLI::App& program) {
  auto* command = program.add_subcommand("live", "Map what a depth camera sees while it moves, and watch the map grow");
  const auto a = std::make_shared<Arguments>();
  add_run_options(*command, *a);
  auto* view = command->add_flag("--view", a->view, "Show the map in a browser while it grows; prints the address");
  add_view_options(*command, a->page, view);
  auto* fast = command->add_flag("--as-fast-as-possible", a->as_fast_as_possible,
                                 "Play a recording faster than it was taken, where it can be fused faster");
  command
      ->add_flag("--real-time", a->real_time,
                 "Play a recording at the speed it was taken at, and leave out frames to keep up, as with a sensor "
                 "[every frame, more slowly where that takes longer]")
      ->excludes(fast);
  command->callback([a] { live(*a); });
}

}  // namespace cairn::apps
