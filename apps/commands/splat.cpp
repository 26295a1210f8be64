// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/file_name.hpp"
#include "cairn/mapping/splat_training.hpp"
#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/inputs_and_outputs.hpp"
#include "cli/interrupt.hpp"
#include "cli/json_text.hpp"
#include "cli/open_with_cameras.hpp"
#include "cli/output_folder.hpp"
#include "cli/progress.hpp"
#include "cli/quantity.hpp"
#include "cli/sources.hpp"
#include "cli/view_error.hpp"
#include "options/option_ranges.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  fs::path map, output;
  std::string recording;
  SplatOptions options;
  int device = -1;
  bool json = false;
};

nlohmann::json to_json(const TrainedSplats& trained, const fs::path& file) {
  const SplatReport& report = trained.report;
  nlohmann::json json{{"splats", trained.splats.size()}, {"degree", trained.splats.degree},
                      {"iterations", report.iterations}, {"images", report.images},
                      {"seconds", report.seconds},       {"psnr_db", report.psnr},
                      {"bytes", fs::file_size(file)}};
  if (report.held_out) json["held_out"] = view_error_json(*report.held_out);
  if (report.mesh) json["mesh"] = view_error_json(*report.mesh);
  return json;
}

void print_error(const char* name, const ViewError& e) {
  print_result("{:<9} PSNR {:.2f} dB, {:.2f} dB after a gain per image, over {:.1f} % of their pixels\n", name, e.psnr,
               e.psnr_with_gain, 100 * e.covered);
}

void print(const TrainedSplats& trained, const fs::path& file, const char* images) {
  const SplatReport& report = trained.report;
  print_result("{}  {}, {} splats after {} iterations in {:.1f} s\n", file.string(), format_size(fs::file_size(file)),
               format_count(trained.splats.size()), report.iterations, report.seconds);
  print_result("images    {} {}, PSNR {:.2f} dB at the size of training\n", report.images, images, report.psnr);
  if (!report.held_out) return;
  print_result("held out  {} other {}, at full size:\n", report.held_out->frames, images);
  print_error("splats", *report.held_out);
  if (report.mesh) print_error("mesh", *report.mesh);
}

/// Shows the training as a fraction of its iterations or its time, whichever is larger.
SplatStep show_progress(Progress& progress, const SplatOptions& options, Interrupt& interrupt) {
  return [&](const SplatProgress& p) {
    constexpr int kParts = 1000;
    if (p.iterations == 0) {
      progress.step(0, kParts, "preparing the images");
    } else {
      interrupt.allow_graceful_exit();
      const double share = std::max(static_cast<double>(p.iteration) / p.iterations,
                                    options.max_seconds > 0 ? std::min(1.0, p.seconds / options.max_seconds) : 0.0);
      progress.step(static_cast<int>(kParts * share), kParts,
                    fmt::format("{} splats, PSNR {:.1f} dB", format_count(p.splats), p.psnr));
    }
    return !interrupt.requested();
  };
}

void train(Arguments a) {
  if (const std::string extension = extension_of(a.output); extension != ".ply" && extension != ".spz")
    throw CLI::ValidationError("--output", a.output.string() + ": is not X.ply or X.spz, the formats of splats");
  if (!fs::is_directory(a.map))
    throw std::runtime_error(a.map.string() +
                             ": has no keyframes, which splats need: give the folder written by reconstruct, live or "
                             "merge");
  Inputs().add_map(a.map).add_recording(a.recording).check_output_file(a.output);
  if (const fs::path folder = a.output.parent_path(); !folder.empty()) prepare_output(folder);
  if (fs::exists(a.map / "mesh.glb")) a.options.mesh = a.map / "mesh.glb";
  OpenRecording open;
  if (!a.recording.empty()) open = [&] { return read_ahead(open_with_cameras(a.recording, a.map / kMapCamera)); };
  Map map = Map::open(a.map, a.device);
  Interrupt interrupt(Interrupt::Graceful::later, "writing the splats so far; interrupt again to end at once");
  std::optional<Progress> progress(std::in_place, std::nullopt, "");
  const TrainedSplats trained = train_splats(map, a.options, show_progress(*progress, a.options, interrupt), open);
  progress.reset();
  write_splats(a.output, trained.splats);
  if (a.json)
    fmt::print("{}\n", format_json(to_json(trained, a.output), 2));
  else
    print(trained, a.output, open ? "frames" : "keyframes");
}

}  // namespace

void add_splat(CLI::App& program) {
  auto* command = program.add_subcommand("splat", "Train Gaussian splats from a map's images, starting at its surface");
  const auto a = std::make_shared<Arguments>();
  command->add_option("MAP", a->map, "Folder written by reconstruct, live or merge")
      ->required()
      ->check(CLI::ExistingPath);
  command->add_option("-o,--output", a->output, "X.spz, or X.ply without quantization")->required()->type_name(kFile);
  command
      ->add_option("--recording", a->recording,
                   "The map's last recording: train with its sharpest frames, instead of the keyframes")
      ->check(is_recording);
  const auto option = [&](const char* name, auto& value, const char* field, Unit unit, const char* help) {
    add_number(*command, name, value, export_range_of(field), unit, help)->capture_default_str();
  };
  SplatOptions& o = a->options;
  option("--iterations", o.iterations, "SplatOptions::iterations", Unit::none, "Training steps, an image each");
  option("--time", o.max_seconds, "SplatOptions::max_seconds", Unit::seconds,
         "End the training after this time; 0: after all iterations");
  option("--resolution", o.resolution, "SplatOptions::resolution", Unit::share,
         "Size of the training images, relative to the color images");
  option("--max-splats", o.max_splats, "SplatOptions::max_splats", Unit::none, "Maximum number of splats");
  option("--degree", o.degree, "SplatOptions::degree", Unit::none,
         "Degree of the spherical harmonics of the colors; 0: equal from all directions");
  option("--images", o.images, "SplatOptions::images", Unit::none,
         "Maximum number of training images from the recording");
  option("--hold-out", o.hold_out, "SplatOptions::hold_out", Unit::none,
         "Keep every N-th image for the comparison in the end; 0: train with all");
  add_device(*command, a->device);
  command->add_flag("--json", a->json, "Print JSON");
  command->callback([a] { train(*a); });
}

}  // namespace cairn::apps
