// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "base/file_name.hpp"
#include "cairn/mapping/viewer.hpp"
#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/inputs_and_outputs.hpp"
#include "cli/interrupt.hpp"
#include "cli/json_text.hpp"
#include "cli/open_with_cameras.hpp"
#include "cli/output_folder.hpp"
#include "cli/quantity.hpp"
#include "cli/sources.hpp"
#include "cli/splat_training.hpp"
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

void train(Arguments a) {
  if (const std::string extension = extension_of(a.output);
      extension != ".ply" && extension != ".spz" && extension != ".glb")
    throw CLI::ValidationError("--output", a.output.string() + ": is not X.spz, X.ply or X.glb, the formats of splats");
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
  Interrupt interrupt(Interrupt::Graceful::later, kWritingSplats);
  const TrainedSplats trained = train_and_write(map, a.options, open, a.output, interrupt);
  if (fs::equivalent(fs::absolute(a.output).parent_path(), a.map) && fs::exists(a.map / "report.html"))
    write_report_page(a.map);  // which lists the folder's files
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
  command->add_option("-o,--output", a->output, "X.spz, or without quantization X.ply or X.glb")
      ->required()
      ->type_name(kFile);
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
