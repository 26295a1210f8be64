// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Stages of a run after the last frame, shared by `reconstruct` and `live`.
#pragma once
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "cairn/io/source.hpp"
#include "cairn/mapping/mapper.hpp"
#include "cairn/mapping/viewer.hpp"
#include "cli/interrupt.hpp"
#include "cli/run.hpp"

namespace cairn::apps {

/// Requested stages: by a quality, or singly and unjudged.
struct FinalStages {
  Quality quality = Quality::good;
  bool refine = false, adjust = false, reintegrate = false;

  [[nodiscard]] bool is_expert() const { return refine || adjust || reintegrate; }
  /// True if the run has enough frames for the stages, of a single recording.
  [[nodiscard]] bool apply_to(const Run& run) const;
};

/// Selects the frames held out to judge the quality, in the first run of a session.
void hold_out_to_judge(Quality quality, const RunArguments& a, const Source& source, RunProgress& progressed);

/// Time of the stages of a quality, relative to the time of the frames; 0 for fewer frames than the stages need.
[[nodiscard]] double relative_time(Quality quality, std::optional<int> frames);

/// Opens the recording again for the stages; null if they do not read it, and, with a warning, if it cannot be opened.
[[nodiscard]] std::unique_ptr<Source> open_again(const FinalStages& stages, const RunArguments& a,
                                                 const FrameRange& range, Run& run);

/// Records that the user has skipped all stages. Returns the results for report.json.
[[nodiscard]] nlohmann::json skip(const FinalStages& stages, Run& run);

/// Improves the complete map after the last frame, and returns the results for report.json. A signal, or a command of
/// the page, ends the current stage and keeps its previous result; an adjustment keeps its intermediate result.
/// `again`: see FinishOptions::reintegrate. `judges`: see RunProgress. `view`: may be null.
[[nodiscard]] nlohmann::json improve(const FinalStages& stages, Source* again, bool judges, Run& run,
                                     Interrupt& interrupt, LiveViewer* view);

}  // namespace cairn::apps
