// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <functional>
#include <map>

#include "cairn/io/source.hpp"
#include "cairn/mapping/mapper.hpp"
#include "cairn/synthetic/scene.hpp"
#include "cairn/synthetic/synthetic.hpp"
#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/durations.hpp"
#include "cli/json_text.hpp"
#include "cli/quantity.hpp"
#include "cli/run.hpp"
#include "cli/sources.hpp"
#include "options/option_ranges.hpp"

namespace cairn::apps {
namespace {

constexpr std::size_t kWarmUpFrames = 10;  // warm-up frames, not timed: they allocate buffers and the first bricks
constexpr int kReferenceImages = 12;       // renderings

struct Arguments {
  std::string sequence, frames = "0:200";
  std::filesystem::path camera;
  std::vector<std::string> topics;
  std::optional<float> voxel_size;
  int device = -1;
  bool json = false;
};

double milliseconds(const std::function<void()>& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
}

/// Processor time of the calling thread, milliseconds.
double thread_milliseconds() {
  std::timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

/// Milliseconds per rendering of a fixed scene: a reference for the machine's current speed.
double reference_ms(int device) {
  const Scene scene = synthetic_scene("room");
  SceneCamera camera(scene, synthetic_camera(), device);
  Durations times;
  for (int i = 0; i < kReferenceImages; ++i)
    times.add(milliseconds([&] { (void)camera.render([&](double t) { return scene.world_from_camera(t); }, 0); }));
  return times.percentile(0.5);
}

nlohmann::json to_json(const Durations& d) {
  return {{"mean_ms", d.mean()}, {"median_ms", d.percentile(0.5)}, {"p95_ms", d.percentile(0.95)}};
}

/// Decodes all frames first, then maps them from memory, so that neither stage waits for the other.
nlohmann::json measure(const Arguments& a) {
  SourceOptions source_options = apps::source_options(a.sequence, a.camera, a.topics);
  source_options.range = parse_frames(a.frames);
  const auto source = open_source(a.sequence, source_options);
  Durations decode, per_frame, host;
  std::map<std::string, Durations> stages;
  std::vector<Frame> frames;
  for (std::optional<Frame> frame;;) {
    const double ms = milliseconds([&] { frame = source->next(); });
    if (!frame) break;
    decode.add(ms);
    frames.push_back(std::move(*frame));
  }
  if (frames.size() < 2)
    throw std::runtime_error(a.sequence + ": has fewer than two frames; a benchmark needs at least two");
  const std::size_t first = std::min(kWarmUpFrames, frames.size() / 2);
  const Rig& rig = source->rig();
  const Options options = a.voxel_size ? options_for(rig.sensor, *a.voxel_size) : options_for(rig.sensor);
  Mapper mapper(rig, options, Poses::tracked, a.device);
  Statistics warm;
  int fused = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (i == first) warm = mapper.statistics();
    FrameReport report;
    const double begin = thread_milliseconds(), ms = milliseconds([&] { report = mapper.add(frames[i]); });
    fused += report.state == FrameState::fused;
    if (i < first) continue;
    per_frame.add(ms);
    host.add(thread_milliseconds() - begin);
    for (const auto& [name, stage_ms] : report.stage_ms) stages[name].add(stage_ms);
  }
  const Statistics end = mapper.statistics();
  const auto count = static_cast<double>(per_frame.count());
  nlohmann::json j{{"sequence", a.sequence},
                   {"device", end.device},
                   {"frames", frames.size()},
                   {"fused", fused},
                   {"depth", {rig.depth.width, rig.depth.height}},
                   {"voxel_size", options.fuse.voxel_size},
                   {"decode", to_json(decode)},
                   {"frame", to_json(per_frame)},
                   {"host", to_json(host)},
                   {"frames_per_second", 1000 / per_frame.mean()},
                   {"frames_per_second_decoding_first", 1000 / (per_frame.mean() + decode.mean())},
                   {"waits_per_frame", static_cast<double>(end.device_waits - warm.device_waits) / count},
                   {"bytes_up_per_frame", static_cast<double>(end.uploaded - warm.uploaded) / count},
                   {"bytes_down_per_frame", static_cast<double>(end.downloaded - warm.downloaded) / count},
                   {"reference_ms", reference_ms(a.device)}};
  for (const auto& [name, times] : stages) {
    j["stages"][name] = to_json(times);
    j["stages"][name]["per_frame_ms"] = times.total() / count;
  }
  for (const auto& [name, time] : end.kernels) {
    const auto before = warm.kernels.find(name);
    const KernelTime start = before == warm.kernels.end() ? KernelTime{} : before->second;
    if (time.calls == start.calls) continue;
    j["kernels"][name] = {{"calls_per_frame", (time.calls - start.calls) / count},
                          {"per_frame_ms", (time.milliseconds - start.milliseconds) / count}};
  }
  return j;
}

void print(const nlohmann::json& j) {
  const auto number = [](const nlohmann::json& n) { return n.get<double>(); };
  fmt::print("{} of {} frames of {}x{} fused, voxels of {:g} m, {}\n\n", j["fused"].get<int>(), j["frames"].get<int>(),
             j["depth"][0].get<int>(), j["depth"][1].get<int>(), number(j["voxel_size"]),
             j["device"].get<std::string>());
  fmt::print("{:<14}{:>10}{:>10}{:>10}\n", "ms", "per frame", "median", "95 %");
  const auto line = [&](const std::string& name, double per_frame, const nlohmann::json& d) {
    fmt::print("{:<14}{:>10.2f}{:>10.2f}{:>10.2f}\n", name, per_frame, number(d["median_ms"]), number(d["p95_ms"]));
  };
  line("frame", number(j["frame"]["mean_ms"]), j["frame"]);
  for (const auto& [name, d] : j["stages"].items()) line("  " + name, number(d["per_frame_ms"]), d);
  line("host", number(j["host"]["mean_ms"]), j["host"]);
  line("decoding", number(j["decode"]["mean_ms"]), j["decode"]);
  fmt::print("\n{:<24}{:>10}{:>10}\n", "on the device, ms", "per frame", "calls");
  std::vector<std::pair<double, std::string>> kernels;
  for (const auto& [name, k] : j["kernels"].items()) kernels.emplace_back(-number(k["per_frame_ms"]), name);
  std::ranges::sort(kernels);
  for (const auto& [ms, name] : kernels)
    fmt::print("  {:<22}{:>10.2f}{:>10.1f}\n", name, -ms, number(j["kernels"][name]["calls_per_frame"]));
  fmt::print("\n{:.1f} frames/s, {:.1f} including decoding\n", number(j["frames_per_second"]),
             number(j["frames_per_second_decoding_first"]));
  fmt::print("per frame, the host waits {:.1f} times for the device, uploads {:.2f} MB and downloads {:.2f} MB\n",
             number(j["waits_per_frame"]), 1e-6 * number(j["bytes_up_per_frame"]),
             1e-6 * number(j["bytes_down_per_frame"]));
  fmt::print("{:.1f} ms to render the reference image of the synthetic room: compare runs relative to it\n",
             number(j["reference_ms"]));
}

}  // namespace

void add_bench(CLI::App& program) {
  auto* command = program.add_subcommand("bench", "Measure the time per frame on this machine, by stage and kernel");
  const auto a = std::make_shared<Arguments>();
  command->add_option("SEQUENCE", a->sequence, kSequenceHelp)->required()->type_name(kPath);
  command->add_option("--frames", a->frames, kFramesHelp)->type_name("RANGE")->capture_default_str();
  add_camera(*command, a->camera, "in place of the recording's own cameras");
  add_number(*command, "--voxel-size", a->voxel_size, range_of("fuse.voxel_size"), Unit::meters,
             "Side of a voxel; the truncation is four voxels, or more for noisy sensors [0.01]");
  add_device(*command, a->device);
  command->add_flag("--json", a->json, "Print JSON");
  add_topics(*command, a->topics);
  command->callback([a] {
    const nlohmann::json measured = measure(*a);
    if (a->json)
      fmt::print("{}\n", format_json(measured));
    else
      print(measured);
  });
}

}  // namespace cairn::apps
