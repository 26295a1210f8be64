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
#include <numbers>
#include <numeric>
#include <utility>

#include "cairn/mapper.hpp"
#include "cairn/source.hpp"
#include "commands.hpp"
#include "io/atomic_file.hpp"
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
  std::optional<std::uint64_t> device_memory_mib;
  int device = -1, read_ahead = 4;
  std::string frames;
  bool refuse = false, json = false;
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

std::unique_ptr<Source> open_source(const Arguments& a) {
  const FrameRange range = parse_frames(a.frames);
  constexpr std::string_view kSynthetic = "synthetic:";
  std::unique_ptr<Source> source;
  if (a.sequence.starts_with(kSynthetic))
    source = open_synthetic({.scene = a.sequence.substr(kSynthetic.size()), .frames = range.end.value_or(300)});
  else
    source = open_recording(a.sequence, range);
  if (!a.poses.empty()) source = with_poses(std::move(source), read_trajectory(a.poses));
  return a.read_ahead > 0 ? read_ahead(std::move(source), a.read_ahead) : std::move(source);
}

/// Fails before the work, not after it.
void prepare_output(const fs::path& output) {
  std::error_code error;
  fs::create_directories(output, error);
  if (error || !fs::is_directory(output))
    throw std::runtime_error("cannot make the folder " + output.string() + ": " + error.message() +
                             "; choose another with -o");
  write_whole(output / ".cairn", [](const fs::path&) {});
  fs::remove(output / ".cairn");
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

void reconstruct(const Arguments& a) {
  const auto start = Clock::now();
  Options options;
  if (!a.config.empty()) read_options(a.config, options);
  if (a.voxel_size) {
    options.fuse.voxel_size = *a.voxel_size;
    options.fuse.truncation = 4 * *a.voxel_size;
  }
  if (a.device_memory_mib) options.fuse.device_memory = *a.device_memory_mib << 20;
  options.refine = a.refuse;
  check(options);
  auto source = open_source(a);
  prepare_output(a.output);
  std::optional<Mapper> mapper(std::in_place, source->camera(), options,
                               a.poses.empty() ? Poses::tracked : Poses::given, a.device);

  std::vector<FrameReport> frames;
  std::map<std::string, std::vector<double>> stages;
  {
    Progress progress(source->size());
    auto waited = Clock::now();
    while (auto frame = source->next()) {
      const double wait_ms = std::chrono::duration<double, std::milli>(Clock::now() - waited).count();
      FrameReport report = mapper->add(*frame);
      report.stage_ms["wait for decoding"] = wait_ms;
      for (const auto& [stage, ms] : report.stage_ms) stages[stage].push_back(ms);
      progress.step(words(report));
      frames.push_back(std::move(report));
      waited = Clock::now();
    }
  }
  const auto count = [&](FrameState state) {
    return std::count_if(frames.begin(), frames.end(), [&](const FrameReport& r) { return r.state == state; });
  };
  const auto fused = count(FrameState::fused);
  for (const auto& r : frames)
    if (r.state == FrameState::skipped) spdlog::warn("frame {} skipped: {}", r.index, r.reason);
  Mapper::Statistics statistics = mapper->statistics();
  if (const FocalEvidence& f = statistics.focal; f.contradicts())
    spdlog::warn(
        "{}: corners fit a focal length of {:.0f} pixels ({:.2f} pixels off) better than the given {:.0f} "
        "({:.2f} pixels off, {} pairs of views): check the camera's intrinsics, and that colour is registered to depth",
        a.sequence, f.scale * source->camera().fx, f.error_best, source->camera().fx, f.error_given, f.pairs);
  if (fused == 0)
    throw std::runtime_error(a.sequence + ": none of " + std::to_string(frames.size()) + " frames could be used" +
                             (frames.empty() ? "" : "; the first: " + frames[0].reason));

  const auto timed = [&](const char* name, auto&& work) {
    const auto begin = Clock::now();
    work();
    stages[name].push_back(std::chrono::duration<double, std::milli>(Clock::now() - begin).count());
  };
  Trajectory trajectory = mapper->trajectory();
  std::optional<Refined> refined;
  if (a.refuse) {
    timed("refine", [&] { refined = mapper->refine(a.output / "graph.g2o"); });
    timed("fuse again", [&] {
      auto again = with_poses(open_source(a), refined->trajectory, 0);
      mapper.reset();  // gives its memory back
      mapper.emplace(again->camera(), options, Poses::given, a.device);
      Progress progress(again->size());
      while (auto frame = again->next()) {
        if (frame->world_from_camera) mapper->add(*frame);
        progress.step("fusing again");
      }
    });
    trajectory = refined->trajectory;
    for (StampedPose& pose : trajectory) pose.timestamp += statistics.clock_offset;
    // The second pass knows about the map and how upright it stands, the first about the cameras.
    const Mapper::Statistics tracked = std::exchange(statistics, mapper->statistics());
    statistics.clock_offset = tracked.clock_offset, statistics.focal = tracked.focal;
  }
  write_trajectory(a.output / "trajectory.txt", trajectory);
  Mesh mesh;
  timed("mesh", [&] { mesh = mapper->mesh(); });
  timed("write mesh", [&] { write_mesh(a.output / "mesh.glb", mesh); });
  timed("write map", [&] { mapper->write_map(a.output / "map.vdb"); });

  const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
  nlohmann::json report{
      {"sequence", a.sequence},
      {"device", statistics.device},
      {"options",
       {{"voxel_size", options.fuse.voxel_size},
        {"truncation", options.fuse.truncation},
        {"max_depth", options.surface.max_depth}}},
      {"frames",
       {{"total", frames.size()},
        {"fused", fused},
        {"lost", count(FrameState::lost)},
        {"skipped", count(FrameState::skipped)}}},
      {"seconds", seconds},
      {"frames_per_second", static_cast<double>(frames.size()) / seconds},
      {"peak_memory_mb", peak_memory_mb()},
      {"device_memory_peak_mb", static_cast<double>(statistics.device_memory_peak) / (1 << 20)},
      {"clock_offset", statistics.clock_offset},
      {"focal_length",
       {{"best_scale", statistics.focal.scale},
        {"error_given_pixels", statistics.focal.error_given},
        {"error_best_pixels", statistics.focal.error_best},
        {"pairs", statistics.focal.pairs}}},
      {"bricks",
       {{"allocated", statistics.bricks}, {"paged_out", statistics.paged_out}, {"paged_in", statistics.paged_in}}},
      {"mesh", {{"vertices", mesh.positions.size()}, {"triangles", mesh.triangles.size()}}},
      {"loops", nlohmann::json::array()}};
  if (refined)
    report["refined"] = {{"keyframes", refined->keyframes},         {"pairs_tried", refined->pairs_tried},
                         {"pairs_aligned", refined->pairs_aligned}, {"pairs_believed", refined->pairs_believed},
                         {"cost_before", refined->cost_before},     {"cost", refined->cost}};
  if (statistics.tilt) report["tilt_degrees"] = *statistics.tilt * 180 / std::numbers::pi;
  for (const auto& [stage, ms] : stages)
    report["stages"][stage] = {{"count", ms.size()},
                               {"median_ms", median(ms)},
                               {"max_ms", *std::max_element(ms.begin(), ms.end())},
                               {"total_ms", std::accumulate(ms.begin(), ms.end(), 0.0)}};
  for (const auto& [kernel, time] : statistics.kernels)
    report["kernels"][kernel] = {
        {"calls", time.first}, {"total_ms", time.second}, {"mean_ms", time.second / std::max(1, time.first)}};
  nlohmann::json per_frame = nlohmann::json::array();
  for (const auto& r : frames) per_frame.push_back(to_json(r));
  nlohmann::json whole = report;
  whole["per_frame"] = std::move(per_frame);
  write_whole(a.output / "report.json",
              [&](const fs::path& temporary) { std::ofstream(temporary) << whole.dump(1) << '\n'; });

  if (a.json) {
    fmt::print("{}\n", report.dump(2));
    return;
  }
  fmt::print("{} of {} frames fused ({} lost, {} skipped) in {:.1f} s, {:.1f} frames/s, {:.0f} MB peak\n", fused,
             frames.size(), count(FrameState::lost), count(FrameState::skipped), seconds,
             static_cast<double>(frames.size()) / seconds, peak_memory_mb());
  fmt::print("mesh        {} ({} triangles)\n", (a.output / "mesh.glb").string(), mesh.triangles.size());
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
  command->add_option("-o,--output", a->output, "Folder for mesh.glb, map.vdb, trajectory.txt and report.json")
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
  command->add_option("--frames", a->frames, "A:B:STEP, frames A to B - 1, every STEP-th [all]");
  command->add_option("--poses", a->poses, "Fuse with these world_from_camera poses (TUM format) and do not track")
      ->check(CLI::ExistingFile);
  command
      ->add_flag("--refuse", a->refuse,
                 "Align keyframes with each other, correct the trajectory, and fuse all frames again with it")
      ->excludes("--poses");
  command->add_flag("--json", a->json, "Print the report to stdout as JSON");
  command->callback([a] { reconstruct(*a); });
}

}  // namespace cairn::apps
