// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Stages after the last frame, and their assessment by held-out frames.
#include <algorithm>
#include <utility>

#include "cairn/mapping/mapper.hpp"
#include "mapper/adjust.hpp"
#include "mapper/map_state.hpp"
#include "mapper/second_pass.hpp"

namespace cairn {
namespace {

/// Result of an optimization of the keyframe poses.
struct OptimizedPoses {
  std::vector<Eigen::Isometry3d> world_from_camera;  // by keyframe
  SurfaceSigma surface_sigma;
  std::vector<AdjustedStep> steps;

  explicit OptimizedPoses(const Atlas& atlas)
      : world_from_camera(atlas.world_from_camera), surface_sigma(atlas.surface_sigma), steps(atlas.steps) {}
  void restore(Atlas& atlas) && {
    atlas.world_from_camera = std::move(world_from_camera);
    atlas.surface_sigma = std::move(surface_sigma);
    atlas.steps = std::move(steps);
  }
};

}  // namespace

std::string_view to_string(Quality quality) {
  switch (quality) {
    case Quality::fast:
      return "fast";
    case Quality::good:
      return "good";
    case Quality::best:
      return "best";
  }
  return {};
}

FinishOptions finish_options(Quality quality, Source* again) {
  if (quality == Quality::fast) return {};
  constexpr int kMaxInterpolated = 2;
  return {.adjust = true,
          .reintegrate = again,
          .is_judged = true,
          .max_interpolated = quality == Quality::good ? kMaxInterpolated : 0};
}

FinishReport Mapper::finish(const FinishOptions& options) {
  MapState& s = *state_;
  FinishReport report;
  bool goes_on = true;
  const auto progress_of = [&](FinishStage stage) {
    return [&, stage](double fraction) {
      goes_on = goes_on && (!options.progress || options.progress(stage, fraction));
      return goes_on;
    };
  };
  const bool is_again = options.reintegrate != nullptr;
  if (options.is_judged && (options.refine || options.adjust || is_again)) report.error_before = s.held_out_error();
  OptimizedPoses before(s.back_end.atlas());
  const bool was_undeformed = s.back_end.is_undeformed();
  std::vector<Frame> held_out;
  if (options.refine) report.refined = refine(progress_of(FinishStage::refine));
  if ((options.adjust || is_again) && goes_on) report.adjusted = adjust(progress_of(FinishStage::adjust));
  if (is_again && goes_on) {
    // A stream without a size has about as many frames as poses.
    const int count = options.reintegrate->size().value_or(static_cast<int>(trajectory().size()));
    const auto progress = [&, goes_on_at = progress_of(FinishStage::reintegrate)](int frames) {
      return goes_on_at(count > 0 ? std::min(1.0, static_cast<double>(frames) / count) : 0.0);
    };
    const AddedCalibration added{.correction = report.adjusted->correction,
                                 .readout = usable_readout(*report.adjusted)};
    SecondPassResult result = cairn::reintegrate(s, *options.reintegrate,
                                                 {.added = added,
                                                  .max_interpolated = options.max_interpolated,
                                                  .keeps_held_out = options.fuses_held_out,
                                                  .before = report.error_before ? &*report.error_before : nullptr},
                                                 progress);
    report.is_reintegrated = result.is_replaced;
    report.error = result.error;
    held_out = std::move(result.held_out);
  }
  if (report.error_before && !report.error) report.error = s.held_out_error();
  if (report.error_before && report.error && !is_confirmed(*report.error_before, *report.error)) {
    std::move(before).restore(s.back_end.atlas());
    s.cached_volume.reset();
    report.is_kept = false;
  }
  report.has_fused_held_out = !held_out.empty() && (report.is_reintegrated || (!report.is_kept && was_undeformed));
  if (report.has_fused_held_out) fuse_held_out(s, held_out);
  freeze_gravity();
  return report;
}

}  // namespace cairn
