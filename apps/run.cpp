// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "run.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <algorithm>
#include <numeric>
#include <utility>

#include "export_options.hpp"
#include "outputs.hpp"
#include "sources.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
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

}  // namespace

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

std::string Progressed::note() const {
  return nlohmann::json{{"sequence", sequence}, {"next", next}, {"per_frame", per_frame}}.dump();
}

Progressed Progressed::from(const std::string& note) {
  const auto j = nlohmann::json::parse(note);
  return {j.at("sequence"), j.at("next"), j.at("per_frame")};
}

int Progressed::count(const char* state) const {
  return static_cast<int>(
      std::count_if(per_frame.begin(), per_frame.end(), [&](const auto& f) { return f.at("state") == state; }));
}

Options options_of(const RunArguments& a, Poses poses, const Options& defaults) {
  Options options = defaults;
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
  if (poses == Poses::tracked) options.session = a.output / "session";
  options.keep_keyframes = a.mesh.texture.enabled;
  check(a.mesh, a.output / "mesh.glb");
  check(options);
  return options;
}

Beginning beginning(const RunArguments& a, const Options& options, FrameRange range) {
  Beginning begin{.progressed = {.sequence = identity(a.sequence)}, .range = range};
  if (!a.resume) return begin;
  Progressed before = Progressed::from(Mapper::session_info(options.session).note);
  begin.is_next_recording = before.sequence != begin.progressed.sequence || is_sensor(a.sequence);
  if (!begin.is_next_recording) {
    begin.progressed = std::move(before);
    while (begin.range.begin < begin.progressed.next) begin.range.begin += begin.range.step;
  }
  return begin;
}

Run::Run(RunArguments arguments, const Options& options, Poses poses, const Camera& camera, Progressed progressed,
         bool is_next_recording)
    : arguments_(std::move(arguments)),
      options_(options),
      poses_(poses),
      camera_(camera),
      progressed_(std::move(progressed)) {
  prepare_output(arguments_.output);
  if (arguments_.resume) {
    mapper_.emplace(Mapper::resume(camera_, options_, arguments_.device));
    if (is_next_recording) mapper_->begin_recording();
  } else {
    reset();
  }
}

void Run::reset() {
  mapper_.reset();
  fs::remove_all(arguments_.output / "session");
  mapper_.emplace(camera_, options_, poses_, arguments_.device);
  progressed_.per_frame = nlohmann::json::array();
  stages_.clear();
}

FrameReport Run::add(const Frame& frame, double waited_ms) {
  FrameReport report = mapper_->add(frame);
  report.stage_ms["wait for decoding"] = waited_ms;
  for (const auto& [stage, ms] : report.stage_ms) stages_[stage].push_back(ms);
  if (report.state == FrameState::skipped) spdlog::warn("frame {} skipped: {}", report.index, report.reason);
  progressed_.next = report.index + 1;
  progressed_.per_frame.push_back(to_json(report));
  if (std::chrono::duration<double>(Clock::now() - saved_).count() >= arguments_.checkpoint_seconds) {
    mapper_->checkpoint(progressed_.note());
    saved_ = Clock::now();
  }
  return report;
}

void Run::timed(const char* stage, const std::function<void()>& work) {
  const auto begin = Clock::now();
  work();
  stages_[stage].push_back(std::chrono::duration<double, std::milli>(Clock::now() - begin).count());
}

void Run::warn(const std::string& text) {
  spdlog::warn("{}", text);
  warnings_.push_back(text);
}

void Run::finish(const nlohmann::json& more) {
  const auto total = progressed_.per_frame.size();
  const auto fused = progressed_.count("fused"), lost = progressed_.count("lost"),
             skipped = progressed_.count("skipped");
  const std::string& sequence = arguments_.sequence;
  const fs::path& output = arguments_.output;
  if (fused == 0)
    throw std::runtime_error(sequence + ": none of " + std::to_string(total) + " frames could be used" +
                             (total == 0 ? "" : "; the first: " + progressed_.per_frame[0].value("reason", "")));
  if (const FocalEvidence f = mapper_->statistics().focal; f.contradicts())
    warn(fmt::format(
        "{}: corners fit a focal length of {:.0f} pixels ({:.2f} pixels off) better than the given {:.0f} "
        "({:.2f} pixels off, {} pairs of views): check the camera's intrinsics, and that colour is registered to depth",
        sequence, f.scale * camera_.fx, f.error_best, camera_.fx, f.error_given, f.pairs));

  arguments_.mesh.source = fs::path(sequence).filename().string();
  nlohmann::json report = write_outputs(*mapper_, output, poses_, arguments_.mesh,
                                        [this](const char* stage, const auto& work) { timed(stage, work); });
  if (const int pieces = report["submaps"]["pieces"]; pieces > 1)
    warn(fmt::format("{} pieces of the map are not joined by any loop; the largest is written, the session keeps all",
                     pieces));
  timed("write session", [&] {
    mapper_->checkpoint(progressed_.note());
    if (const std::string problem = mapper_->session_problem(); !problem.empty())
      warn("--resume cannot go on from here, the map itself is complete: " + problem);
  });

  const double seconds = std::chrono::duration<double>(Clock::now() - start_).count();
  report.update({{"sequence", sequence},
                 {"options",
                  {{"voxel_size", options_.fuse.voxel_size},
                   {"truncation", options_.fuse.truncation},
                   {"max_depth", options_.surface.max_depth},
                   {"track_finest_level", options_.track.finest_level}}},
                 {"frames", {{"total", total}, {"fused", fused}, {"lost", lost}, {"skipped", skipped}}},
                 {"seconds", seconds},
                 {"frames_per_second", static_cast<double>(total) / seconds},
                 {"peak_memory_mb", peak_memory_mb()},
                 {"warnings", warnings_}});
  if (!more.is_null()) report.update(more);
  for (const auto& [stage, ms] : stages_)
    report["stages"][stage] = {{"count", ms.size()},
                               {"median_ms", median(ms)},
                               {"max_ms", *std::max_element(ms.begin(), ms.end())},
                               {"total_ms", std::accumulate(ms.begin(), ms.end(), 0.0)}};
  nlohmann::json whole = report;
  whole["per_frame"] = progressed_.per_frame;
  write_report(output, whole);

  if (arguments_.json) {
    fmt::print("{}\n", report.dump(2));
    return;
  }
  fmt::print("{} of {} frames fused ({} lost, {} skipped) in {:.1f} s, {:.1f} frames/s, {:.0f} MB peak\n", fused, total,
             lost, skipped, seconds, static_cast<double>(total) / seconds, peak_memory_mb());
  fmt::print("mesh        {} ({} triangles)\n", (output / "mesh.glb").string(),
             report["mesh"]["triangles"].get<std::size_t>());
  fmt::print("map         {}\n", (output / "map.vdb").string());
  fmt::print("trajectory  {}\n", (output / "trajectory.txt").string());
  fmt::print("report      {}\n", (output / "report.html").string());
}

void add_run_options(CLI::App& command, RunArguments& a) {
  command.add_option("SEQUENCE", a.sequence, kSequenceHelp)->required();
  command
      .add_option("-o,--output", a.output,
                  "Folder for mesh.glb, map.vdb, trajectory.txt, graph.svg, report.html and the session")
      ->required();
  command.add_option("--config", a.config, "YAML file that overrides options")->check(CLI::ExistingFile);
  command.add_option("--camera", a.camera, "camera.yaml instead of a sensor's or .oni file's own intrinsics")
      ->check(CLI::ExistingFile);
  command.add_option("--voxel-size", a.voxel_size, "Metres; the truncation is four voxels [0.01]");
  command.add_option("--device", a.device, "Vulkan device as `cairn devices` numbers them; -1 chooses")
      ->capture_default_str();
  command.add_option("--device-memory", a.device_memory_mib,
                     "MiB for the map on the device [half of it, 2048 at most]");
  command.add_option("--host-memory", a.host_memory_mib,
                     "MiB for ended submaps; others wait on the disk [a quarter of the host's]");
  auto* live = command.add_flag(
      "--esdf", a.esdf, "Keep a distance field up to date while frames are fused; map.vdb gets the grid `esdf`");
  command.add_option("--esdf-voxel-size", a.esdf_voxel_size, "Metres: 1, 2, 4 or 8 voxels of the map [two]")
      ->needs(live);
  command.add_option("--max-distance", a.max_distance, "Metres that the distance field looks [2]")->needs(live);
  command.add_flag("--no-loops", a.no_loops, "Do not recognise places");
  command.add_flag(
      "--resume", a.resume,
      "Go on from the session in OUT: where a run was cut off, or with another recording of the same place");
  command
      .add_option("--checkpoint", a.checkpoint_seconds,
                  "Seconds between two checkpoints of the session: so much work a kill costs at most")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command.add_flag("--json", a.json, "Print the report to stdout as JSON");
  add_export_options(command, a.mesh);
}

}  // namespace cairn::apps
