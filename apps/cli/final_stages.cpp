// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/final_stages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "cairn/io/layouts.hpp"
#include "cli/progress.hpp"
#include "cli/sources.hpp"

namespace cairn::apps {
namespace {

using Clock = std::chrono::steady_clock;
// Frames held out to judge --quality: every n-th, not in shorter recordings.
constexpr int kMinJudgedFrames = 60, kHeldOutFrames = 14, kMinHeldOutInterval = 8, kStreamHeldOutInterval = 40;

/// Upper triangles in row order.
nlohmann::json to_json(const std::vector<AdjustReport::KeyframeCovariance>& all) {
  nlohmann::json list = nlohmann::json::array();
  for (const auto& [timestamp, covariance] : all) {
    nlohmann::json triangle = nlohmann::json::array();
    for (int i = 0; i < 6; ++i)
      for (int j = i; j < 6; ++j) triangle.push_back(covariance(i, j));
    list.push_back({{"timestamp", timestamp}, {"covariance", std::move(triangle)}});
  }
  return list;
}

nlohmann::json to_json(const RefineReport& r) {
  return {{"keyframes", r.keyframes},       {"pairs_tried", r.pairs_tried}, {"pairs_aligned", r.pairs_aligned},
          {"pairs_inlier", r.pairs_inlier}, {"cost_before", r.cost_before}, {"cost", r.cost}};
}

nlohmann::json to_json(const AdjustReport& a) {
  return {{"keyframes", a.keyframes},
          {"surfels", a.surfels},
          {"observations", a.observations},
          {"clock_offset", a.clock_offset},
          {"readout", a.readout},
          {"readout_sigma", a.readout_sigma},
          {"predicts_better", a.error_reduction},
          {"has_readout", a.has_readout},
          {"corrected_predicts_better", a.corrected_error_reduction},
          {"has_correction", !a.correction.empty()},
          {"covariances", to_json(a.covariances)}};
}

/// Calibration found by the stages and used for the map.
struct FoundCameras {
  bool has_correction = false;
  double readout = 0;  // s; 0: none
};

/// `before`: rig before the stages.
FoundCameras found_cameras(const Rig& before, const Rig& after) {
  return {.has_correction = before.depth_correction != after.depth_correction,
          .readout = before.depth.readout > 0 ? 0 : after.depth.readout};
}

nlohmann::json to_json(const FoundCameras& found) {
  return {{"depth_corrected", found.has_correction}, {"readout", found.readout}};
}

void warn_of_errors(const AdjustReport& adjusted, const FoundCameras& found, Run& run) {
  if (adjusted.has_readout && found.readout == 0)
    run.warn(
        fmt::format("the camera has a rolling shutter with a readout of about {:.0f} ms: calibrate it with `cairn "
                    "calibrate --shutter` for more accurate tracking",
                    1000 * adjusted.readout));
  if (!adjusted.correction.empty() && !found.has_correction)
    run.warn(
        "the depth error exceeds the sensor noise: `--reintegrate` corrects it, and `cairn calibrate --depth` "
        "calibrates it for later recordings");
}

/// Shows the stages after the last frame, measures their times, and ends them at a signal or a command of the page.
class ShownStages {
 public:
  ShownStages(Run& run, Interrupt& interrupt, LiveViewer* view) : run_(run), interrupt_(interrupt), view_(view) {}
  ShownStages(const ShownStages&) = delete;
  ShownStages& operator=(const ShownStages&) = delete;
  ~ShownStages() { end(); }

  /// FinishOptions::progress.
  bool operator()(FinishStage stage, double fraction) {
    if (stage != stage_) begin(stage);
    progress_->step(static_cast<int>(100 * fraction), 100, text_of(stage).running);
    if (view_) view_->show_stage(text_of(stage).on_page, fraction);
    const bool is_skipped = view_ && view_->commands().skip;
    if (!skipped_ && !is_skipped && !interrupt_.requested()) return true;
    run_.interrupted_in(std::string(to_string(stage)));
    if (!skipped_) skipped_ = stage;
    return false;
  }
  /// Stage ended by the user.
  [[nodiscard]] std::optional<FinishStage> skipped() const { return skipped_; }
  /// Ends the display and the time of the current stage.
  void end() {
    if (stage_) run_.add_time(std::string(to_string(*stage_)), milliseconds(Clock::now() - start_));
    stage_.reset();
    progress_.reset();
  }

 private:
  struct Text {
    const char *running, *on_page, *at_signal;
  };
  static Text text_of(FinishStage stage) {
    switch (stage) {
      case FinishStage::refine:
        return {"refining", "Refining the poses",
                "skipping the rest of the refinement; interrupt again to end at once"};
      case FinishStage::adjust:
        return {"adjusting", "Adjusting the poses", "keeping the adjustment so far; interrupt again to end at once"};
      case FinishStage::reintegrate:
        return {"reintegrating", "Fusing all frames again", "keeping the adjusted map; interrupt again to end at once"};
    }
    return {};
  }
  void begin(FinishStage stage) {
    end();
    stage_ = stage, start_ = Clock::now();
    interrupt_.set_message(text_of(stage).at_signal);
    progress_.emplace(std::nullopt, "");
  }

  Run& run_;
  Interrupt& interrupt_;
  LiveViewer* view_;
  std::optional<FinishStage> stage_, skipped_;
  std::optional<Progress> progress_;
  Clock::time_point start_;
};

/// Stages after the last frame, as requested singly or by a quality.
FinishOptions finish_options(const FinalStages& stages, bool judges, Source* again) {
  if (stages.is_expert())
    return {.refine = stages.refine, .adjust = stages.adjust, .reintegrate = stages.reintegrate ? again : nullptr};
  FinishOptions options = cairn::finish_options(stages.quality, again);
  options.fuses_held_out = judges;
  return options;
}

nlohmann::json to_json(const HeldOutError& e) {
  nlohmann::json j{
      {"frames", e.frames}, {"covered", e.covered}, {"depth_rmse_m", e.depth_rmse}, {"doubled", e.doubled}};
  if (e.brightness_rmse > 0) j["brightness_rmse"] = e.brightness_rmse;
  return j;
}

/// Gain of the stages in one line, by the held-out frames.
std::string gain(const FinishReport& finished, const FoundCameras& found) {
  if (!finished.error_before || !finished.error) return "too few frames held out to judge the adjusted map";
  const HeldOutError &before = *finished.error_before, &after = *finished.error;
  std::string text = fmt::format("depth error {:.1f} -> {:.1f} mm", 1000 * before.depth_rmse, 1000 * after.depth_rmse);
  const auto add = [&](const char* name, double from, double to) {
    text += fmt::format(", {} {:.1f} -> {:.1f} %", name, 100 * from, 100 * to);
  };
  if (before.brightness_rmse > 0) add("brightness", before.brightness_rmse, after.brightness_rmse);
  if (!finished.is_kept) {
    add("covered", before.covered, after.covered);
    add("doubled", before.doubled, after.doubled);
  }
  text += fmt::format(" in {} held-out frames", after.frames);
  if (!finished.is_kept) return "the map as tracked, since the adjusted map is worse: " + text;
  if (finished.adjusted && finished.adjusted->has_readout && found.readout == 0)
    text +=
        fmt::format("; a rolling shutter of about {:.0f} ms: `cairn calibrate --shutter` for more accurate tracking",
                    1000 * finished.adjusted->readout);
  return text;
}

/// Interval of the frames held out to judge the quality; 0: none. `frames`: of the recording, if known.
int judging_interval(Quality quality, std::optional<int> frames) {
  if (quality == Quality::fast || (frames && *frames < kMinJudgedFrames)) return 0;
  return frames ? std::max(kMinHeldOutInterval, *frames / kHeldOutFrames) : kStreamHeldOutInterval;
}

/// Result of a quality for report.json; empty for single stages.
nlohmann::json quality_json(const FinalStages& stages, bool is_kept, const std::string& words) {
  if (stages.is_expert()) return {};
  return {{"quality", {{"requested", to_string(stages.quality)}, {"kept", is_kept}, {"words", words}}}};
}

}  // namespace

bool FinalStages::apply_to(const Run& run) const {
  return is_expert() || (quality != Quality::fast && run.posed() >= kMinJudgedFrames && run.mapper().recordings() == 1);
}

void hold_out_to_judge(Quality quality, const RunArguments& a, const Source& source, RunProgress& progressed) {
  if (a.hold_out || a.resume) return;
  progressed.hold_out.every = judging_interval(quality, source.size());
  progressed.judges = progressed.hold_out.every > 0;
}

double relative_time(Quality quality, std::optional<int> frames) {
  constexpr double kGood = 0.9, kBest = 1.4;  // two CPU cores, --no-texture
  if (quality == Quality::fast || (frames && *frames < kMinJudgedFrames)) return 0;
  return quality == Quality::good ? kGood : kBest;
}

std::unique_ptr<Source> open_again(const FinalStages& stages, const RunArguments& a, const FrameRange& range,
                                   Run& run) {
  if (!stages.reintegrate && (stages.is_expert() || is_sensor(a.sequence))) return nullptr;
  SourceOptions options = source_options(a, range);
  options.find_color_camera = false;  // already known to the mapper
  try {
    return open_source(a.sequence, options);
  } catch (const std::exception& error) {
    run.warn(fmt::format("frames are not fused again: {}", error.what()));
    return nullptr;
  }
}

nlohmann::json skip(const FinalStages& stages, Run& run) {
  run.interrupted_in(stages.refine ? "refine" : "adjust");
  return quality_json(stages, false, "the map as tracked, since the stages were skipped");
}

nlohmann::json improve(const FinalStages& stages, Source* again, bool judges, Run& run, Interrupt& interrupt,
                       LiveViewer* view) {
  if (interrupt.requested()) return skip(stages, run);
  ShownStages shown(run, interrupt, view);
  FinishOptions options = finish_options(stages, judges, again);
  options.progress = std::ref(shown);
  const Rig before = run.mapper().rig();
  const FinishReport finished = run.mapper().finish(options);
  const FoundCameras found = found_cameras(before, run.mapper().rig());
  shown.end();
  if (finished.has_fused_held_out) run.fused_held_out();
  if (!stages.is_expert() && !shown.skipped()) run.improved();
  nlohmann::json results =
      quality_json(stages, finished.is_kept,
                   (shown.skipped() ? fmt::format("skipped in the stage {}; ", to_string(*shown.skipped())) : "") +
                       gain(finished, found));
  if (finished.error_before) results["quality"]["before"] = to_json(*finished.error_before);
  if (finished.error) results["quality"]["after"] = to_json(*finished.error);
  if (finished.refined) results["refined"] = to_json(*finished.refined);
  if (finished.adjusted) {
    results["adjusted"] = to_json(*finished.adjusted);
    results["calibration"] = to_json(found);
    if (stages.is_expert()) warn_of_errors(*finished.adjusted, found, run);
  }
  return results;
}

}  // namespace cairn::apps
