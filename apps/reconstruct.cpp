// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numeric>
#include <utility>

#include "cairn/mapper.hpp"
#include "cairn/source.hpp"
#include "commands.hpp"
#include "io/atomic_file.hpp"
#include "outputs.hpp"
#include "progress.hpp"
#include "synth/source.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

struct Arguments {
  std::string sequence;
  fs::path output, config, poses;
  std::optional<float> voxel_size;
  std::optional<std::uint64_t> device_memory_mib, host_memory_mib;
  int device = -1, read_ahead = 4;
  std::string frames;
  double checkpoint_seconds = 20;
  std::optional<float> esdf_voxel_size, max_distance;
  bool esdf = false, refine = false, refuse = false, resume = false, no_loops = false, json = false;
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

std::unique_ptr<Source> open_source(const Arguments& a, const FrameRange& range) {
  constexpr std::string_view kSynthetic = "synthetic:";
  std::unique_ptr<Source> source;
  if (a.sequence.starts_with(kSynthetic))
    source = open_synthetic(
        {.scene = a.sequence.substr(kSynthetic.size()), .first = range.begin, .frames = range.end.value_or(300)});
  else
    source = open_recording(a.sequence, range);
  if (!a.poses.empty()) source = with_poses(std::move(source), read_trajectory(a.poses));
  return a.read_ahead > 0 ? read_ahead(std::move(source), a.read_ahead) : std::move(source);
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::string words(const FrameReport& r) {
  switch (r.state) {
    case FrameState::fused:
      if (r.iterations == 0) return "fusing";
      return fmt::format("{:.0f} % inliers within {:.1f} sigma", 100 * r.inlier_share, r.rmse) +
             (r.guess == "motion" ? "" : ", guess: " + r.guess) +
             (r.unobserved_by_geometry > 0 ? fmt::format(", {} directions by colour", r.unobserved_by_geometry) : "") +
             (r.unobserved > 0 ? fmt::format(", {} by motion", r.unobserved) : "");
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

nlohmann::json to_json(const FrameReport& r) {
  static constexpr const char* kStates[] = {"fused", "lost", "skipped"};
  nlohmann::json j{{"index", r.index}, {"timestamp", r.timestamp}, {"state", kStates[static_cast<int>(r.state)]}};
  if (!r.reason.empty()) j["reason"] = r.reason;
  if (r.iterations > 0)
    j.update({{"inlier_share", r.inlier_share},
              {"overlap", r.overlap},
              {"rmse", r.rmse},
              {"iterations", r.iterations},
              {"photometric_share", r.photometric_share},
              {"photometric_rmse", r.photometric_rmse},
              {"unobserved_by_geometry", r.unobserved_by_geometry},
              {"unobserved", r.unobserved},
              {"moving", r.moving},
              {"guess", r.guess}});
  if (r.touched_bricks > 0) j.update({{"touched_bricks", r.touched_bricks}, {"new_bricks", r.new_bricks}});
  j["ms"] = r.stage_ms;
  return j;
}

/// What a session remembers for this program.
struct Progressed {
  std::string sequence;
  int next = 0;  // frame
  nlohmann::json per_frame = nlohmann::json::array();

  [[nodiscard]] std::string note() const {
    return nlohmann::json{{"sequence", sequence}, {"next", next}, {"per_frame", per_frame}}.dump();
  }
  static Progressed from(const std::string& note) {
    const auto j = nlohmann::json::parse(note);
    return {j.at("sequence"), j.at("next"), j.at("per_frame")};
  }
  [[nodiscard]] auto count(const char* state) const {
    return std::count_if(per_frame.begin(), per_frame.end(), [&](const auto& f) { return f.at("state") == state; });
  }
};

std::string identity(const std::string& sequence) {
  return fs::exists(sequence) ? fs::weakly_canonical(sequence).string() : sequence;
}

void reconstruct(const Arguments& a) {
  const auto start = Clock::now();
  Options options;
  if (!a.config.empty()) read_options(a.config, options);
  if (a.voxel_size) {
    options.fuse.voxel_size = *a.voxel_size;
    options.fuse.truncation = 4 * *a.voxel_size;
  }
  if (a.device_memory_mib) options.fuse.device_memory = *a.device_memory_mib << 20;
  if (a.host_memory_mib) options.map.host_memory = *a.host_memory_mib << 20;
  if (a.no_loops) options.map.loops = false;
  options.esdf.live = options.esdf.live || a.esdf;
  if (a.esdf_voxel_size) options.esdf.voxel_size = *a.esdf_voxel_size;
  if (a.max_distance) options.esdf.max_distance = *a.max_distance;
  const Poses poses = a.poses.empty() ? Poses::tracked : Poses::given;
  if (poses == Poses::tracked) options.session = a.output / "session";
  check(options);

  Progressed progressed{.sequence = identity(a.sequence)};
  FrameRange range = parse_frames(a.frames);
  bool is_next_recording = false;
  if (a.resume) {
    Progressed before = Progressed::from(Mapper::session_info(options.session).note);
    is_next_recording = before.sequence != progressed.sequence;
    if (!is_next_recording) {
      progressed = std::move(before);
      while (range.begin < progressed.next) range.begin += range.step;
    }
  }
  const auto source = open_source(a, range);
  prepare_output(a.output);
  if (!a.resume) fs::remove_all(a.output / "session");
  Mapper mapper = a.resume ? Mapper::resume(source->camera(), options, a.device)
                           : Mapper(source->camera(), options, poses, a.device);
  if (is_next_recording) mapper.begin_recording();

  std::map<std::string, std::vector<double>> stages;
  {
    Progress progress(source->size());
    auto waited = Clock::now(), saved = waited;
    while (auto frame = source->next()) {
      const double wait_ms = std::chrono::duration<double, std::milli>(Clock::now() - waited).count();
      FrameReport report = mapper.add(*frame);
      report.stage_ms["wait for decoding"] = wait_ms;
      for (const auto& [stage, ms] : report.stage_ms) stages[stage].push_back(ms);
      progress.step(words(report));
      if (report.state == FrameState::skipped) spdlog::warn("frame {} skipped: {}", report.index, report.reason);
      progressed.next = report.index + 1;
      progressed.per_frame.push_back(to_json(report));
      waited = Clock::now();
      if (std::chrono::duration<double>(waited - saved).count() < a.checkpoint_seconds) continue;
      mapper.checkpoint(progressed.note());
      saved = Clock::now();
    }
  }
  const auto total = progressed.per_frame.size();
  const auto fused = progressed.count("fused"), lost = progressed.count("lost"), skipped = progressed.count("skipped");
  if (const FocalEvidence f = mapper.statistics().focal; f.contradicts())
    spdlog::warn(
        "{}: corners fit a focal length of {:.0f} pixels ({:.2f} pixels off) better than the given {:.0f} "
        "({:.2f} pixels off, {} pairs of views): check the camera's intrinsics, and that colour is registered to depth",
        a.sequence, f.scale * source->camera().fx, f.error_best, source->camera().fx, f.error_given, f.pairs);
  if (fused == 0)
    throw std::runtime_error(a.sequence + ": none of " + std::to_string(total) + " frames could be used" +
                             (total == 0 ? "" : "; the first: " + progressed.per_frame[0].value("reason", "")));

  const Timed timed = [&](const char* name, const std::function<void()>& work) {
    const auto begin = Clock::now();
    work();
    stages[name].push_back(std::chrono::duration<double, std::milli>(Clock::now() - begin).count());
  };
  std::optional<Refined> refined;
  if (a.refine || a.refuse) timed("refine", [&] { refined = mapper.refine(); });
  if (a.refuse) {
    timed("fuse again", [&] {
      const auto again = open_source(a, parse_frames(a.frames));
      Progress progress(again->size());
      mapper.fuse_again(*again, [&] { progress.step("fusing again"); });
    });
  }
  nlohmann::json report = write_outputs(mapper, a.output, poses, timed);
  timed("write session", [&] {
    mapper.checkpoint(progressed.note());
    if (const std::string problem = mapper.session_problem(); !problem.empty())
      spdlog::warn("--resume cannot go on from here, the map itself is complete: {}", problem);
  });

  const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
  report.update({{"sequence", a.sequence},
                 {"options",
                  {{"voxel_size", options.fuse.voxel_size},
                   {"truncation", options.fuse.truncation},
                   {"max_depth", options.surface.max_depth}}},
                 {"frames", {{"total", total}, {"fused", fused}, {"lost", lost}, {"skipped", skipped}}},
                 {"seconds", seconds},
                 {"frames_per_second", static_cast<double>(total) / seconds},
                 {"peak_memory_mb", peak_memory_mb()}});
  if (refined)
    report["refined"] = {{"keyframes", refined->keyframes},         {"pairs_tried", refined->pairs_tried},
                         {"pairs_aligned", refined->pairs_aligned}, {"pairs_believed", refined->pairs_believed},
                         {"cost_before", refined->cost_before},     {"cost", refined->cost}};
  for (const auto& [stage, ms] : stages)
    report["stages"][stage] = {{"count", ms.size()},
                               {"median_ms", median(ms)},
                               {"max_ms", *std::max_element(ms.begin(), ms.end())},
                               {"total_ms", std::accumulate(ms.begin(), ms.end(), 0.0)}};
  nlohmann::json whole = report;
  whole["per_frame"] = std::move(progressed.per_frame);
  write_whole(a.output / "report.json",
              [&](const fs::path& temporary) { std::ofstream(temporary) << whole.dump(1) << '\n'; });

  if (a.json) {
    fmt::print("{}\n", report.dump(2));
    return;
  }
  fmt::print("{} of {} frames fused ({} lost, {} skipped) in {:.1f} s, {:.1f} frames/s, {:.0f} MB peak\n", fused, total,
             lost, skipped, seconds, static_cast<double>(total) / seconds, peak_memory_mb());
  fmt::print("mesh        {} ({} triangles)\n", (a.output / "mesh.glb").string(),
             report["mesh"]["triangles"].get<std::size_t>());
  fmt::print("map         {}\n", (a.output / "map.vdb").string());
  fmt::print("trajectory  {}\n", (a.output / "trajectory.txt").string());
  fmt::print("report      {}\n", (a.output / "report.json").string());
}

}  // namespace

void add_reconstruct(CLI::App& program) {
  auto* command = program.add_subcommand("reconstruct", "Turn a recording into a mesh, a map and a trajectory");
  const auto a = std::make_shared<Arguments>();
  command
      ->add_option("SEQUENCE", a->sequence,
                   "Folder (TUM RGB-D, 7-Scenes, ICL-NUIM, or with intrinsics.json) or synthetic:NAME")
      ->required();
  command
      ->add_option("-o,--output", a->output,
                   "Folder for mesh.glb, map.vdb, trajectory.txt, graph.svg, report.json and the session")
      ->required();
  command->add_option("--config", a->config, "YAML file that overrides options")->check(CLI::ExistingFile);
  command->add_option("--voxel-size", a->voxel_size, "Metres; the truncation is four voxels [0.01]");
  command->add_option("--device", a->device, "Vulkan device as `cairn devices` numbers them; -1 chooses")
      ->capture_default_str();
  command->add_option("--read-ahead", a->read_ahead, "frames decoded ahead in a thread of their own; 0: no thread")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  command->add_option("--device-memory", a->device_memory_mib,
                      "MiB for the map on the device [half of it, 2048 at most]");
  command->add_option("--host-memory", a->host_memory_mib,
                      "MiB for ended submaps; others wait on the disk [a quarter of the host's]");
  auto* live = command->add_flag(
      "--esdf", a->esdf, "Keep a distance field up to date while frames are fused; map.vdb gets the grid `esdf`");
  command->add_option("--esdf-voxel-size", a->esdf_voxel_size, "Metres: 1, 2, 4 or 8 voxels of the map [two]")
      ->needs(live);
  command->add_option("--max-distance", a->max_distance, "Metres that the distance field looks [2]")->needs(live);
  command->add_flag("--no-loops", a->no_loops, "Do not recognise places");
  command->add_option("--frames", a->frames, "A:B:STEP, frames A to B - 1, every STEP-th [all]");
  command->add_option("--poses", a->poses, "Fuse with these world_from_camera poses (TUM format) and do not track")
      ->check(CLI::ExistingFile);
  command
      ->add_flag("--refine", a->refine,
                 "Align keyframes with each other after the last frame and bend the map as the pose graph says")
      ->excludes("--poses");
  command
      ->add_flag("--refuse", a->refuse,
                 "Like --refine, but fuse all frames again with the corrected poses instead of bending the map")
      ->excludes("--poses");
  command
      ->add_flag("--resume", a->resume,
                 "Go on from the session in OUT: where a run was cut off, or with another recording of the same place")
      ->excludes("--poses");
  command
      ->add_option("--checkpoint", a->checkpoint_seconds,
                   "Seconds between two checkpoints of the session: so much work a kill costs at most")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_flag("--json", a->json, "Print the report to stdout as JSON");
  command->callback([a] { reconstruct(*a); });
}

}  // namespace cairn::apps
