// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/calibrate.hpp"

#include <fmt/format.h>

#include <cmath>

#include "cairn/source.hpp"
#include "command_tree.hpp"
#include "commands.hpp"
#include "inputs_and_outputs.hpp"
#include "progress.hpp"
#include "quantity.hpp"
#include "sources.hpp"

namespace cairn::apps {
namespace {

struct Arguments {
  std::string sequence;
  std::filesystem::path camera, output;
  std::vector<std::string> topics;
  int frames = 40;
  bool shutter = false, depth = false, all = false;
};

/// Reopens the recording on each call. Only the first call searches for a color camera.
std::function<std::unique_ptr<Source>()> opener(const Arguments& a) {
  return [name = a.sequence, options = source_options(a.sequence, a.camera, a.topics)]() mutable {
    auto source = open_source(name, options);
    options.find_colour_camera = false;
    return source;
  };
}

bool is_refused(const std::string& why_not) {
  if (!why_not.empty()) fmt::print("{}; nothing was written\n", why_not);
  return !why_not.empty();
}

void calibrate_shutter(const Arguments& a) {
  Progress progress(std::nullopt);
  const FoundShutter found = find_shutter(opener(a), [&] { progress.step("tracking"); });
  if (is_refused(found.why_not)) return;
  write_rig(a.output, found.rig);
  fmt::print("readout        {:.1f} ms, +- {:.1f}, from {} keyframes; predicts what was held out {:.1f} % better\n",
             1000 * found.readout, 1000 * found.sigma, found.keyframes, 100 * found.predicts_better);
  fmt::print("{}: give it to reconstruct with --camera\n", a.output.string());
}

void calibrate_depth(const Arguments& a) {
  Progress progress(std::nullopt);
  const FoundDepthCorrection found = find_depth_correction(opener(a), [&] { progress.step("tracking"); });
  if (is_refused(found.why_not)) return;
  write_rig(a.output, found.rig);
  double squared = 0;
  for (const float offset : found.rig.depth_correction.offsets)
    squared += static_cast<double>(offset) * static_cast<double>(offset);
  const double offset = std::sqrt(squared / static_cast<double>(found.rig.depth_correction.offsets.size()));
  fmt::print(
      "depth          off by {:.1f} mm at 1 m and {:.0f} mm at 3 m (RMS over the image), from {} keyframes; "
      "corrected it predicts what was held out {:.1f} % better\n",
      1000 * offset, 9000 * offset, found.keyframes, 100 * found.predicts_better);
  fmt::print("{}: give it to reconstruct with --camera\n", a.output.string());
}

std::string words(const Camera& c) {
  return fmt::format("fx {:.1f} fy {:.1f} cx {:.1f} cy {:.1f} pixels, k1 {:.4f}", c.fx, c.fy, c.cx, c.cy,
                     c.distortion[0]);
}

void calibrate_all(const Arguments& a) {
  Progress progress(std::nullopt);
  const FoundCalibration found = find_calibration(opener(a), [&] { progress.step("tracking"); });
  if (is_refused(found.why_not)) return;
  write_rig(a.output, found.rig);
  fmt::print("depth camera   {}\n", words(found.rig.depth));
  if (found.rig.colour) fmt::print("colour camera  {}\n", words(found.rig.colour->camera));
  fmt::print("readout        {:.1f} ms, +- {:.1f}\n", 1000 * found.rig.depth.readout, 1000 * found.readout_sigma);
  fmt::print("clock          colour is {:.1f} ms ahead; each run finds this itself\n", 1000 * found.clock_offset);
  fmt::print("{} keyframes; predicts what was held out {:.1f} % better\n", found.keyframes,
             100 * found.predicts_better);
  fmt::print("{}: give it to reconstruct with --camera\n", a.output.string());
}

void calibrate(const Arguments& a) {
  Inputs().add_recording(a.sequence).add(a.camera).expect_apart_from_file(a.output);
  if (is_sensor(a.sequence))
    throw std::runtime_error(a.sequence + ": a sensor has no end; record it first with cairn record");
  if (a.shutter) return calibrate_shutter(a);
  if (a.depth) return calibrate_depth(a);
  if (a.all) return calibrate_all(a);
  const auto source = open_source(a.sequence, source_options(a.sequence, a.camera, a.topics));
  const auto rig = find_colour_camera(*source, a.frames);
  if (!rig) {
    fmt::print("the edges of depth and colour tell of no better colour camera; nothing was written\n");
    return;
  }
  write_rig(a.output, *rig);
  const Eigen::Isometry3d& pose = rig->colour->colour_from_depth;
  const Eigen::Vector3d t = 100 * pose.translation();
  fmt::print(
      "colour camera  fx {:.1f} fy {:.1f} pixels, {:.1f} {:.1f} {:.1f} cm beside depth, turned by {:.2f} degrees\n",
      rig->colour->camera.fx, rig->colour->camera.fy, t.x(), t.y(), t.z(),
      Eigen::AngleAxisd(pose.linear()).angle() * 57.29578);
  fmt::print("{}: give it to reconstruct with --camera\n", a.output.string());
}

}  // namespace

void add_calibrate(CLI::App& program) {
  auto* command =
      program.add_subcommand("calibrate", "Find a sensor's colour camera, shutter or errors of depth in a recording");
  const auto a = std::make_shared<Arguments>();
  command->add_option("SEQUENCE", a->sequence, kSequenceHelp)->required()->type_name(kPath);
  command->add_option("-o,--output", a->output, "camera.yaml to write")->required()->type_name(kFile);
  add_camera(*command, a->camera, "to begin with, in place of what the recording tells");
  auto* frames = add_number(*command, "--frames", a->frames, {1, 1000}, "Frames to look at, spread over all")
                     ->capture_default_str();
  auto* shutter =
      command
          ->add_flag("--shutter", a->shutter,
                     "Find how long the cameras take to read their rows instead, by tracking the whole recording")
          ->excludes(frames);
  auto* depth =
      command
          ->add_flag("--depth", a->depth,
                     "Find what the depth camera errs by instead, by place in its image, by tracking the whole "
                     "recording")
          ->excludes(frames)
          ->excludes(shutter);
  command
      ->add_flag("--all", a->all,
                 "Find focal lengths, principal points, the lens, both of these and where the colour camera is "
                 "together instead, by tracking the whole recording")
      ->excludes(frames)
      ->excludes(shutter)
      ->excludes(depth);
  add_topics(*command, a->topics);
  command->callback([a] { calibrate(*a); });
}

}  // namespace cairn::apps
