// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// How well a run went, in words for people: what its frames tell of why some are not in the map, and the map held
// against a sample of them.
#pragma once
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/camera.hpp"
#include "cairn/frame.hpp"
#include "cairn/mesh.hpp"
#include "cairn/options.hpp"
#include "cairn/pose_check.hpp"
#include "cairn/reports.hpp"
#include "cairn/trajectory.hpp"

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
  std::string upright_unknown;        ///< why gravity is not known, and the remedy; empty where it is
  std::vector<std::string> warnings;  ///< of other things, a line each
  std::optional<PoseCheck> poses;     ///< of a run with given poses
};

/// Whether a map can be used as it is.
struct Verdict {
  enum class Level {
    good,  ///< at least 95 % of the frames are in it, and no measurement contradicts it
    weak,  ///< fewer, or there are warnings, or doubts: see Item
    bad    ///< less than 80 %, parts that nothing joins, or given poses that most of the depth contradicts
  };
  /// A measurement with the limit that it is held to.
  struct Item {
    std::string name;             ///< as in report.json: `frames_in_map`, `map_in_the_way`, ...
    double value = 0, limit = 0;  ///< in `unit`
    std::string unit;             ///< `%`, `m/s`, ...
    Level level = Level::good;    ///< of this measurement alone
    std::string text;             ///< one line; of a doubt also the remedy, and then it is one of the reasons
  };
  Level level = Level::good;
  std::string words;                 ///< one sentence
  std::vector<std::string> reasons;  ///< one line each: what was seen, and what to do
  std::vector<Item> evidence;        ///< what could be measured
};

/// `good`, `weak` or `bad`.
[[nodiscard]] std::string name_of(Verdict::Level level);

/// What frames tell, added up as they come: how far and how dense depth is, how bright and how sharp colour, how fast
/// the view moves, whether the focal length can be far from right. It needs no pose. Some hundred microseconds a frame;
/// some tens of milliseconds in up to a dozen frames of a run, in which corners are looked for. Of the sample of frames
/// that it keeps for the map (at most 64, 1.2 MB) see hold_against_map.
class Evidence {
 public:
  Evidence(const Rig& rig, const Options& options);
  ~Evidence();
  Evidence(Evidence&&) noexcept;
  Evidence& operator=(Evidence&&) noexcept;

  /// Frames from here on are of this recording of the map, counted from 0.
  void begin_recording(int number);
  /// `report`: what became of the frame.
  void add(const Frame& frame, const FrameReport& report);
  /// Holds the finished map against a sample of the frames. `parts`: its surface; `trajectories`: the final poses, by
  /// recording, in the same world; `clock_offset`: seconds that their times are ahead of the frames'; `correction`: of
  /// depth, as the map was made. Renders at most 64 images of 64 pixels across.
  void hold_against_map(const std::vector<Mesh>& parts, const std::vector<Trajectory>& trajectories,
                        double clock_offset, const DepthCorrection& correction);
  /// Holds a tracked trajectory against the poses that the recording's device or its owner had, in the same clock.
  /// `drift`: of these, in units of visual-inertial odometry's: 5 cm and 3 % of the way with that of tracking, 2
  /// degrees.
  void hold_against_device(const Trajectory& tracked, const Trajectory& device, double drift = 1);
  /// Reasons come by what they explain: what cannot be right first.
  [[nodiscard]] Verdict verdict(const Outcome& outcome) const;

  /// All sums and the sample in a line, to go on with later.
  [[nodiscard]] std::string save() const;
  /// Goes on from what save() gave. What it has not made is left out: the sums begin anew.
  void restore(const std::string& saved);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn
