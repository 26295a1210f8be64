// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/atomic_file.hpp"
#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/inputs_and_outputs.hpp"
#include "cli/interrupt.hpp"
#include "cli/json_text.hpp"
#include "cli/progress.hpp"
#include "cli/reasons.hpp"
#include "cli/sources.hpp"
#include "cli/write_frames.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;
constexpr double kMaxColorDelay = 0.02;  // seconds between depth and color: the association limit of the TUM layout

struct Arguments {
  std::string sequence, frames, color = "png";
  fs::path output, camera, mask;
  bool registered = false, json = false;
};

struct Converted {
  int frames = 0, unreadable = 0, unpaired = 0;  // `unpaired`: depth and color timestamps differ too much
  double depth_scale = kTumDepthScale;
  Reasons left_out;
  Trajectory poses;                  // poses stored with the frames
  std::optional<std::string> ended;  // reason for an early end
  bool is_interrupted = false;
};

/// Reads the usable frames and reports the rest.
class Reader {
 public:
  Reader(Source& source, Converted& converted)
      : source_(source), converted_(converted), progress_(source.size()), first_(read()) {
    if (first_) converted_.depth_scale = exact_depth_scale(*first_);
  }
  std::optional<Frame> next() { return first_ ? std::exchange(first_, std::nullopt) : read(); }

 private:
  std::optional<Frame> read() {
    while (!interrupt_.requested()) {
      auto frame = source_.next();
      if (!frame) {
        converted_.ended = source_.ended_early();
        return frame;
      }
      progress_.step("converting");
      if (frame->problem) {
        ++converted_.unreadable;
        converted_.left_out.add(frame->index, *frame->problem);
        continue;
      }
      ++converted_.frames;
      interrupt_.allow_graceful_exit();
      converted_.unpaired += !frame->color.empty() && std::abs(frame->color_delay) > kMaxColorDelay;
      if (frame->world_from_camera) converted_.poses.push_back({frame->timestamp, *frame->world_from_camera});
      return frame;
    }
    converted_.is_interrupted = true;
    return std::nullopt;
  }

  Source& source_;
  Converted& converted_;
  Interrupt interrupt_{Interrupt::Graceful::later};
  Progress progress_;
  std::optional<Frame> first_;  // sets the depth unit
};

Converted convert_to(const Arguments& a, const fs::path& folder) {
  auto source =
      masked(open_source(a.sequence, {.range = parse_frames(a.frames), .camera = a.camera}), a.mask, a.sequence);
  if (a.registered) source = with_color_on_depth(std::move(source));
  Converted converted;
  {
    Reader reader(*source, converted);
    Recorder writer(folder, source->rig(), converted.depth_scale);
    write_frames(
        [&] { return reader.next(); },
        [&](const Frame& frame) { return encode(frame, source->rig(), a.color == "png", converted.depth_scale); },
        writer);
  }
  if (converted.frames == 0)
    throw std::runtime_error(a.sequence + ": contains no readable frame" +
                             (converted.ended ? "; " + *converted.ended : ""));
  Trajectory truth = is_synthetic(a.sequence) ? Trajectory{} : recorded_truth(a.sequence);
  if (truth.empty()) truth = converted.poses;
  if (!truth.empty()) write_trajectory(folder / "groundtruth.txt", truth);
  return converted;
}

void convert(const Arguments& a) {
  if (is_sensor(a.sequence))
    throw std::runtime_error(a.sequence + ": is a sensor; record it with `cairn record`, or name a recording");
  Inputs().add_recording(a.sequence).add(a.camera).add(a.mask).check_output_folder(a.output);
  Converted c;
  write_folder(a.output, [&](const fs::path& folder) { c = convert_to(a, folder); });
  for (const std::string& line : c.left_out.lines(c.frames + c.unreadable, "left out")) spdlog::warn(line);
  if (c.unpaired > 0)
    spdlog::warn("{} frames have color more than {} s before or after depth: the TUM layout does not pair them",
                 c.unpaired, kMaxColorDelay);
  if (a.json)
    fmt::print("{}\n",
               format_json({{"frames", c.frames}, {"unreadable", c.unreadable}, {"depth_scale", c.depth_scale}}, 2));
  else
    print_result("{}: {} frames, depth in {} units per meter{}\n", a.output.string(), c.frames, c.depth_scale,
                 (c.unreadable > 0 ? fmt::format(", {} unreadable", c.unreadable) : "") +
                     (c.is_interrupted ? "; interrupted, later frames are missing" : ""));
  if (c.ended) throw std::runtime_error(*c.ended + "; the frames before are in " + a.output.string());
}

}  // namespace

void add_convert(CLI::App& program) {
  auto* command = program.add_subcommand("convert", "Convert a recording of any kind to the TUM layout");
  const auto a = std::make_shared<Arguments>();
  command->add_option("SEQUENCE", a->sequence, kSequenceHelp)->required()->type_name(kPath);
  command->add_option("-o,--output", a->output, "New folder for a recording in the TUM layout")
      ->required()
      ->type_name(kFolder);
  add_camera(*command, a->camera, "in place of the recording's own cameras");
  command->add_option("--frames", a->frames, kFramesHelp)->type_name("RANGE");
  add_mask(*command, a->mask);
  command->add_flag("--registered", a->registered,
                    "Register color to depth, for programs with a single camera [both cameras unchanged]");
  command->add_option("--color", a->color, "Format of the color images")
      ->check(one_of({"jpg", "png"}))
      ->capture_default_str();
  command->add_flag("--json", a->json, "Print a summary to stdout as JSON");
  command->callback([a] { convert(*a); });
}

}  // namespace cairn::apps
