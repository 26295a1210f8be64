// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/splat_training.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "cli/console.hpp"
#include "cli/flags.hpp"
#include "cli/progress.hpp"
#include "cli/quantity.hpp"
#include "cli/view_error.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

void print_error(const char* name, const ViewError& e) {
  print_result(
      "{:<9} PSNR {:.2f} dB, {:.2f} dB after a gain per image, over {:.1f} % of their pixels; depth {:.1f} mm RMS\n",
      name, e.psnr, e.psnr_with_gain, 100 * e.covered, 1000 * e.depth_rmse);
}

/// Shows the training as a fraction of its iterations or its time, whichever is larger.
SplatStep show_progress(Progress& progress, const SplatOptions& options, Interrupt& interrupt) {
  return [&](const SplatProgress& p) {
    constexpr int kParts = 1000;
    if (p.iterations == 0) {
      progress.step(0, kParts, fmt::format("preparing the images; the training needs about {}", format_size(p.memory)));
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

}  // namespace

TrainedSplats train_and_write(Map& map, const SplatOptions& options, const OpenRecording& open, const fs::path& file,
                              Interrupt& interrupt) {
  TrainedSplats trained = [&] {
    Progress progress(std::nullopt, "");
    return train_splats(map, options, show_progress(progress, options, interrupt), open);
  }();
  write_splats(file, trained.splats);
  return trained;
}

nlohmann::json to_json(const TrainedSplats& trained, const fs::path& file) {
  const SplatReport& report = trained.report;
  nlohmann::json json{{"splats", trained.splats.size()}, {"degree", trained.splats.degree},
                      {"iterations", report.iterations}, {"images", report.images},
                      {"seconds", report.seconds},       {"psnr_db", report.psnr},
                      {"bytes", fs::file_size(file)},    {"memory_bytes", report.memory}};
  if (!report.problem.empty()) json["problem"] = report.problem;
  if (report.held_out) json["held_out"] = view_error_json(*report.held_out);
  if (report.mesh) json["mesh"] = view_error_json(*report.mesh);
  return json;
}

void print(const TrainedSplats& trained, const fs::path& file, const char* images) {
  const SplatReport& report = trained.report;
  print_result("{}  {}, {} splats after {} iterations in {:.1f} s\n", file.string(), format_size(fs::file_size(file)),
               format_count(trained.splats.size()), report.iterations, report.seconds);
  print_result("images    {} {}, PSNR {:.2f} dB at the size of training\n", report.images, images, report.psnr);
  if (!report.problem.empty()) print_result("held out  not compared: {}\n", with_flag_names(report.problem));
  if (!report.held_out) return;
  print_result("held out  {} other {}, at full size:\n", report.held_out->frames, images);
  print_error("splats", *report.held_out);
  if (report.mesh) print_error("mesh", *report.mesh);
}

}  // namespace cairn::apps
