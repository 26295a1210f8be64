// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "base/file_name.hpp"
#include "base/unfinished.hpp"
#include "cairn/io/recorder.hpp"
#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/inputs_and_outputs.hpp"
#include "cli/interrupt.hpp"
#include "cli/json_text.hpp"
#include "cli/progress.hpp"
#include "cli/quantity.hpp"
#include "cli/sources.hpp"
#include "cli/write_frames.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;
constexpr std::uint64_t kReservedDisk = std::uint64_t{256} << 20;  // bytes of disk space that a recording leaves free
constexpr int kDiskCheckInterval = 30;                             // frames

struct Arguments {
  std::string sequence;
  fs::path output, camera;
  std::vector<std::string> topics;
  std::string color = "jpg";
  double seconds = 0;
  bool json = false;
};

std::uint64_t free_disk_space(const fs::path& output) { return fs::space(tidy(output).parent_path()).available; }

/// Statistics of a recording, with the reason for its end.
struct Recorded {
  int frames = 0, unreadable = 0;
  double first = 0, last = 0;        // timestamps, seconds
  std::optional<std::string> ended;  // reason for an early end
};

/// Returns the frames to record until an end condition holds.
class Reader {
 public:
  /// `unfinished`: files to remove if no frame is recorded.
  Reader(Source& source, const Arguments& a, Recorded& recorded, std::vector<Unfinished>& unfinished)
      : source_(source), a_(a), recorded_(recorded), unfinished_(unfinished) {}
  std::optional<Frame> operator()() {
    while (!interrupt_.requested()) {
      auto frame = source_.next();
      if (!frame) {
        recorded_.ended = source_.ended_early();
        return frame;
      }
      if (frame->problem) {
        ++recorded_.unreadable;
        continue;
      }
      if (recorded_.frames == 0) recorded_.first = frame->timestamp;
      if (a_.seconds > 0 && frame->timestamp - recorded_.first >= a_.seconds) break;
      if (recorded_.frames % kDiskCheckInterval == 0 && free_disk_space(a_.output) < kReservedDisk) {
        recorded_.ended =
            fmt::format("{}: less than {} MiB are left on the disk", a_.output.string(), kReservedDisk >> 20);
        break;
      }
      recorded_.last = frame->timestamp;
      ++recorded_.frames;
      interrupt_.allow_graceful_exit();
      unfinished_.clear();
      progress_.step("recording" + (source_.dropped() > 0 ? fmt::format(", {} DROPPED", source_.dropped()) : ""));
      return frame;
    }
    return std::nullopt;
  }

 private:
  Source& source_;
  const Arguments& a_;
  Recorded& recorded_;
  std::vector<Unfinished>& unfinished_;
  Interrupt interrupt_{Interrupt::Graceful::later};
  Progress progress_{std::nullopt};
};

/// Files left by a recording without frames.
std::vector<Unfinished> unfinished_of(const fs::path& output, bool is_file) {
  std::vector<Unfinished> all;
  const bool is_new = !fs::exists(output);
  if (is_file || is_new) all.emplace_back(output, is_file ? Unfinished::Kind::all : Unfinished::Kind::empty);
  if (is_file || (!is_new && !fs::is_empty(output))) return all;
  for (const char* name : {"rgb", "depth", "rgb.txt", "depth.txt", "camera.yaml"}) all.emplace_back(output / name);
  return all;
}

void record(const Arguments& a) {
  const bool to_oni = extension_of(a.output) == ".oni";
  if (to_oni && !a.sequence.starts_with("openni:") && extension_of(a.sequence) != ".oni")
    throw std::runtime_error(a.output.string() + ": only OpenNI2 sources can be recorded as .oni; name a folder");
  Inputs().add_recording(a.sequence).add(a.camera).check_output_folder(a.output);
  if (to_oni && fs::exists(a.output)) throw std::runtime_error(a.output.string() + ": exists; choose another name");
  if (fs::path folder = tidy(a.output).parent_path(); !fs::is_directory(folder))
    throw std::runtime_error(folder.string() + ": there is no such folder");
  if (const auto left = free_disk_space(a.output); left < 2 * kReservedDisk)
    throw std::runtime_error(fmt::format("{}: {} MiB are left on the disk, a recording needs {} at least",
                                         a.output.string(), left >> 20, 2 * kReservedDisk >> 20));
  SourceOptions options = source_options(a.sequence, a.camera, a.topics);
  if (to_oni) options.copy_to = a.output;
  std::vector<Unfinished> unfinished = unfinished_of(a.output, to_oni);
  auto source = open_source(a.sequence, options);
  Recorded recorded;
  {
    Reader read(*source, a, recorded, unfinished);
    if (to_oni)
      while (read()) {
      }
    else {
      Recorder writer(a.output, source->rig());
      write_frames([&] { return read(); },
                   [&](const Frame& frame) { return encode(frame, source->rig(), a.color == "png"); }, writer);
    }
  }
  const int dropped = source->dropped();
  source.reset();  // closes the .oni file
  const double seconds = recorded.last - recorded.first;
  if (recorded.frames == 0)
    throw std::runtime_error(a.sequence + ": no frame arrived" + (recorded.ended ? "; " + *recorded.ended : ""));
  if (a.json)
    fmt::print("{}\n", format_json({{"frames", recorded.frames},
                                    {"dropped", dropped},
                                    {"unreadable", recorded.unreadable},
                                    {"seconds", seconds}},
                                   2));
  else
    print_result("{}: {} frames in {:.1f} s, {} dropped{}\n", a.output.string(), recorded.frames, seconds, dropped,
                 recorded.unreadable > 0 ? fmt::format(", {} unreadable", recorded.unreadable) : "");
  if (recorded.ended) throw std::runtime_error(*recorded.ended + "; the frames before are in " + a.output.string());
}

}  // namespace

void add_record(CLI::App& program) {
  auto* command = program.add_subcommand("record", "Record a depth camera, to reconstruct it later");
  const auto a = std::make_shared<Arguments>();
  command->add_option("URI", a->sequence, kSequenceHelp)->required()->type_name(kPath);
  command->add_option("-o,--output", a->output, "New folder for a recording in the TUM layout, or .oni file")
      ->required()
      ->type_name(kPath);
  add_camera(*command, a->camera, "in place of the sensor's own intrinsics");
  add_topics(*command, a->topics);
  constexpr double kMaxSeconds = 1e6;
  add_number(*command, "--seconds", a->seconds, {0, kMaxSeconds}, Unit::seconds, "Duration; 0: until Ctrl-C")
      ->capture_default_str();
  command->add_option("--color", a->color, "Format of the color images")
      ->check(one_of({"jpg", "png"}))
      ->capture_default_str();
  command->add_flag("--json", a->json, "Print a summary to stdout as JSON");
  command->callback([a] { record(*a); });
}

}  // namespace cairn::apps
