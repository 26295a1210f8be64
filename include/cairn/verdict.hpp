// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// How well a run went, in words for people: what its frames tell of why some are not in the map.
#pragma once
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/camera.hpp"
#include "cairn/frame.hpp"
#include "cairn/options.hpp"
#include "cairn/pose_check.hpp"
#include "cairn/reports.hpp"

namespace cairn {

/// Of a stream that does not wait: what a computer takes of it.
struct KeepingUp {
  int left_out = 0;            ///< frames that came while it was busy
  double taken = 0, came = 0;  ///< frames a second
};

/// What a run has come to.
struct Outcome {
  int total = 0;                      ///< frames that were to be in the map, of which
  int fused = 0, lost = 0;            ///< the others were skipped
  int held_out = 0;                   ///< beside all of these: no part of the map, as it was asked for
  int components = 1;                 ///< parts of the map that nothing joins
  FocalEvidence focal;                ///< of the views that were tracked
  KeepingUp keeping_up;               ///< of a sensor, or of a recording that plays in real time
  std::vector<std::string> warnings;  ///< of other things, a line each
  std::optional<PoseCheck> poses;     ///< of a run with given poses
};

/// Whether a map can be used as it is.
struct Verdict {
  enum class Level {
    good,  ///< at least 95 % of the frames are in it, and nothing speaks against it
    weak,  ///< fewer, or there are warnings
    bad    ///< less than 80 %, parts that nothing joins, or given poses that most of the depth contradicts
  };
  Level level = Level::good;
  std::string words;                 ///< one sentence
  std::vector<std::string> reasons;  ///< one line each: what was seen, and what to do
};

/// `good`, `weak` or `bad`.
[[nodiscard]] std::string name_of(Verdict::Level level);

/// What frames tell, added up as they come: how far and how dense depth is, how bright and how sharp colour, how fast
/// the view moves, whether the focal length can be far from right. It needs no pose. Some hundred microseconds a frame;
/// some tens of milliseconds in up to a dozen frames of a run, in which corners are looked for.
class Evidence {
 public:
  Evidence(const Rig& rig, const Options& options);
  ~Evidence();
  Evidence(Evidence&&) noexcept;
  Evidence& operator=(Evidence&&) noexcept;

  /// `report`: what became of the frame.
  void add(const Frame& frame, const FrameReport& report);
  /// Reasons come by what they explain: what cannot be right first.
  [[nodiscard]] Verdict verdict(const Outcome& outcome) const;

  /// All sums in a line, to go on with later.
  [[nodiscard]] std::string save() const;
  /// Goes on from what save() gave. What it has not made is left out: the sums begin anew.
  void restore(const std::string& saved);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn
