// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/calibrate.hpp"

#include <fmt/format.h>

#include <cmath>

#include "cairn/io/find_color_camera.hpp"
#include "cairn/io/source.hpp"
#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/inputs_and_outputs.hpp"
#include "cli/progress.hpp"
#include "cli/quantity.hpp"
#include "cli/sources.hpp"

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
std::function<std::unique_ptr<Source>()> source_factory(const Arguments& a) {
  return [name = a.sequence, options = source_options(a.sequence, a.camera, a.topics)]() mutable {
    auto source = open_source(name, options);
    options.find_color_camera = false;
    return source;
  };
}

bool print_refusal(const std::string& failure_reason) {
  if (!failure_reason.empty()) fmt::print("{}; nothing was written\n", failure_reason);
  return !failure_reason.empty();
}

void calibrate_shutter(const Arguments& a) {
  Progress progress(std::nullopt);
  const FoundShutter found = find_shutter(source_factory(a), [&] { progress.step("tracking"); });
  if (print_refusal(found.failure_reason)) return;
  write_rig(a.output, found.rig);
  fmt::print("readout        {:.1f} ms, +- {:.1f}, from {} keyframes; error on held-out data reduced by {:.1f} %\n",
             1000 * found.readout, 1000 * found.sigma, found.keyframes, 100 * found.error_reduction);
  fmt::print("{}: pass it to cairn reconstruct with --camera\n", a.output.string());
}

void calibrate_depth(const Arguments& a) {
  Progress progress(std::nullopt);
  const FoundDepthCorrection found = find_depth_correction(source_factory(a), [&] { progress.step("tracking"); });
  if (print_refusal(found.failure_reason)) return;
  write_rig(a.output, found.rig);
  double squared = 0;
  for (const float offset : found.rig.depth_correction.offsets)
    squared += static_cast<double>(offset) * static_cast<double>(offset);
  const double offset = std::sqrt(squared / static_cast<double>(found.rig.depth_correction.offsets.size()));
  fmt::print(
      "depth          error of {:.1f} mm at 1 m and {:.0f} mm at 3 m (RMS over the image), from {} keyframes; "
      "the correction reduces the error on held-out data by {:.1f} %\n",
      1000 * offset, 9000 * offset, found.keyframes, 100 * found.error_reduction);
  fmt::print("{}: pass it to cairn reconstruct with --camera\n", a.output.string());
}

std::string to_text(const Camera& c) {
  return fmt::format("fx {:.1f} fy {:.1f} cx {:.1f} cy {:.1f} pixels, k1 {:.4f}", c.fx, c.fy, c.cx, c.cy,
                     c.distortion[0]);
}

void calibrate_all(const Arguments& a) {
  Progress progress(std::nullopt);
  const FoundCalibration found = find_calibration(source_factory(a), [&] { progress.step("tracking"); });
  if (print_refusal(found.failure_reason)) return;
  write_rig(a.output, found.rig);
  fmt::print("depth camera   {}\n", to_text(found.rig.depth));
  if (found.rig.color) fmt::print("color camera   {}\n", to_text(found.rig.color->camera));
  fmt::print("readout        {:.1f} ms, +- {:.1f}\n", 1000 * found.rig.depth.readout, 1000 * found.readout_sigma);
  fmt::print("clock          color is {:.1f} ms ahead; each run estimates this offset itself\n",
             1000 * found.clock_offset);
  fmt::print("{} keyframes; error on held-out data reduced by {:.1f} %\n", found.keyframes,
             100 * found.error_reduction);
  fmt::print("{}: pass it to cairn reconstruct with --camera\n", a.output.string());
}

void calibrate(const Arguments& a) {
  Inputs().add_recording(a.sequence).add(a.camera).check_output_file(a.output);
  if (is_sensor(a.sequence))
    throw std::runtime_error(a.sequence + ": is a sensor, which has no end; record it first with cairn record");
  if (a.shutter) return calibrate_shutter(a);
  if (a.depth) return calibrate_depth(a);
  if (a.all) return calibrate_all(a);
  const auto source = open_source(a.sequence, source_options(a.sequence, a.camera, a.topics));
  const auto rig = find_color_camera(*source, a.frames);
  if (!rig) {
    fmt::print("no better color camera was found from the edges of depth and color; nothing was written\n");
    return;
  }
  write_rig(a.output, *rig);
  const Eigen::Isometry3d& pose = rig->color->color_from_depth;
  const Eigen::Vector3d t = 100 * pose.translation();
  fmt::print(
      "color camera   fx {:.1f} fy {:.1f} pixels, {:.1f} {:.1f} {:.1f} cm from the depth camera, rotated by {:.2f} "
      "degrees\n",
      rig->color->camera.fx, rig->color->camera.fy, t.x(), t.y(), t.z(),
      Eigen::AngleAxisd(pose.linear()).angle() * 57.29578);
  fmt::print("{}: pass it to cairn reconstruct with --camera\n", a.output.string());
}

}  // namespace

void add_calibrate(CLI::App& program) {
  auto* command = program.add_subcommand(
      "calibrate", "Calibrate a sensor's color camera, rolling shutter or depth from a recording");
  const auto a = std::make_shared<Arguments>();
  command->add_option("SEQUENCE", a->sequence, kSequenceHelp)->required()->type_name(kPath);
  command->add_option("-o,--output", a->output, "camera.yaml to write")->required()->type_name(kFile);
  add_camera(*command, a->camera, "as initial values in place of the recording's own cameras");
  auto* frames =
      add_number(*command, "--frames", a->frames, {1, 1000}, "Number of frames to use, spread over the recording")
          ->capture_default_str();
  auto* shutter =
      command
          ->add_flag("--shutter", a->shutter,
                     "Estimate the readout time of the cameras' rows instead, by tracking the full recording")
          ->excludes(frames);
  auto* depth = command
                    ->add_flag("--depth", a->depth,
                               "Estimate the depth error over the image instead, by tracking the full recording")
                    ->excludes(frames)
                    ->excludes(shutter);
  command
      ->add_flag("--all", a->all,
                 "Estimate focal lengths, principal points, lens distortion, readout time, depth error and the pose of "
                 "the color camera jointly instead, by tracking the full recording")
      ->excludes(frames)
      ->excludes(shutter)
      ->excludes(depth);
  add_topics(*command, a->topics);
  command->callback([a] { calibrate(*a); });
}

}  // namespace cairn::apps
