// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <charconv>
#include <chrono>

#include "commands.hpp"
#include "interrupt.hpp"
#include "progress.hpp"
#include "run.hpp"
#include "sources.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

struct Arguments : RunArguments {
  fs::path poses;
  std::string frames;
  int read_ahead = 4;
  bool refine = false, reintegrate = false;
};

/// A:B:STEP, each part may be empty.
FrameRange parse_frames(const std::string& text) {
  FrameRange range;
  std::array<std::optional<int>, 3> parts;
  std::size_t begin = 0, part = 0;
  const auto wrong = [&] {
    return CLI::ValidationError("--frames", "'" + text + "' is not A:B:STEP, for example 0:300 or ::3");
  };
  while (true) {
    const std::size_t end = std::min(text.find(':', begin), text.size());
    if (part == 3) throw wrong();
    if (end > begin) {
      int value = 0;
      const auto [stop, error] = std::from_chars(text.data() + begin, text.data() + end, value);
      if (error != std::errc() || stop != text.data() + end || value < 0) throw wrong();
      parts[part] = value;
    }
    ++part;
    if (end == text.size()) break;
    begin = end + 1;
  }
  if (parts[2] == 0 || (parts[1] && *parts[1] <= parts[0].value_or(0))) throw wrong();
  return {.begin = parts[0].value_or(0), .end = parts[1], .step = parts[2].value_or(1)};
}

std::unique_ptr<Source> open_frames(const Arguments& a, const FrameRange& range) {
  auto source = open_source(a.sequence, {.range = range, .camera = a.camera, .copy_to = {}});
  if (!a.poses.empty()) {
    auto poses = recorded_truth(a.poses);
    if (poses.empty()) throw std::runtime_error(a.poses.string() + ": is a recording without poses");
    source = with_poses(std::move(source), std::move(poses));
  }
  return a.read_ahead > 0 ? read_ahead(std::move(source), a.read_ahead) : std::move(source);
}

void reconstruct(const Arguments& a) {
  const Poses poses = a.poses.empty() ? Poses::tracked : Poses::given;
  const Options options = options_of(a);
  const Beginning begin = beginning(a, parse_frames(a.frames));
  const auto source = open_frames(a, begin.range);
  Run run(a, options, poses, source->rig(), begin.progressed, begin.is_next_recording);
  {
    const Interrupt interrupt;
    Progress progress(source->size());
    auto waited = Clock::now();
    while (!interrupt.requested()) {
      const auto frame = source->next();
      if (!frame) break;
      const FrameReport report =
          run.add(*frame, std::chrono::duration<double, std::milli>(Clock::now() - waited).count());
      if (run.stopped()) break;
      progress.step(words(report));
      waited = Clock::now();
    }
  }
  if (const auto why = source->ended_early()) run.warn(*why);

  nlohmann::json more;
  if ((a.refine || a.reintegrate) && !run.stopped())
    run.timed("refine", [&] {
      const Refined refined = run.mapper().refine();
      more["refined"] = {{"keyframes", refined.keyframes},         {"pairs_tried", refined.pairs_tried},
                         {"pairs_aligned", refined.pairs_aligned}, {"pairs_inlier", refined.pairs_inlier},
                         {"cost_before", refined.cost_before},     {"cost", refined.cost}};
    });
  if (a.reintegrate && !run.stopped())
    run.timed("reintegrate", [&] {
      const auto again = open_frames(a, parse_frames(a.frames));
      Progress progress(again->size());
      run.mapper().reintegrate(*again, [&] { progress.step("reintegrating"); });
    });
  run.finish(more);
}

}  // namespace

void add_reconstruct(CLI::App& program) {
  auto* command = program.add_subcommand("reconstruct", "Turn a recording into a mesh, a map and a trajectory");
  const auto a = std::make_shared<Arguments>();
  add_run_options(*command, *a);
  command->add_option("--read-ahead", a->read_ahead, "frames decoded ahead in a thread of their own; 0: no thread")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  command->add_option("--frames", a->frames, "A:B:STEP, frames A to B - 1, every STEP-th [all]");
  auto* poses =
      command
          ->add_option(
              "--poses", a->poses,
              "Fuse with these world_from_camera poses (TUM format, or a recording with true poses) and do not track")
          ->check(CLI::ExistingPath)
          ->excludes("--resume");
  command
      ->add_flag("--refine", a->refine,
                 "Align keyframes with each other after the last frame and bend the map as the pose graph says")
      ->excludes(poses);
  command
      ->add_flag("--reintegrate", a->reintegrate,
                 "Like --refine, but fuse all frames again with the corrected poses instead of bending the map")
      ->excludes(poses);
  command->callback([a] { reconstruct(*a); });
}

}  // namespace cairn::apps
