// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Quality assessment of a run, as text for users: reasons for frames absent from the map, and a comparison of the map
// with sampled frames.
#pragma once
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/eval/pose_check.hpp"
#include "cairn/mapping/camera.hpp"
#include "cairn/mapping/frame.hpp"
#include "cairn/mapping/mesh.hpp"
#include "cairn/mapping/options.hpp"
#include "cairn/mapping/reports.hpp"
#include "cairn/mapping/trajectory.hpp"

namespace cairn {

/// Real-time performance on a live stream.
struct FrameRates {
  int dropped = 0;                     ///< frames dropped while the computer was busy
  double processed = 0, received = 0;  ///< frames per second: processed, and received
};

/// Summary of a run.
struct RunSummary {
  int total = 0;                      ///< frames intended for the map
  int fused = 0, lost = 0;            ///< the remaining frames were skipped
  int held_out = 0;                   ///< held-out frames, not counted in `total`
  int components = 1;                 ///< connected components of the map
  FocalEvidence focal;                ///< from the tracked views
  FrameRates frame_rates;             ///< for a sensor, or a recording played in real time
  std::string upright_unknown;        ///< reason for an unknown gravity direction, and the remedy; empty if known
  std::vector<std::string> warnings;  ///< further warnings, one line each
  std::optional<PoseCheck> poses;     ///< for a run with given poses
};

/// Assessment of a map's usability.
struct Verdict {
  enum class Level {
    good,  ///< at least 95 % of the frames are in the map, and no measurement contradicts it
    weak,  ///< fewer frames, a warning, or an Item that is not good
    bad    ///< less than 80 %, several components, or given poses contradicted by most of the depth
  };
  /// A measurement and its limit.
  struct Item {
    std::string name;             ///< name in report.json: `frames_in_map`, `map_in_the_way`, ...
    double value = 0, limit = 0;  ///< in `unit`
    std::string unit;             ///< `%`, `m/s`, ...
    Level level = Level::good;    ///< level of this measurement alone
    std::string text;             ///< one line; if not good, with the remedy, and repeated in `reasons`
  };
  Level level = Level::good;
  std::string words;                 ///< one sentence
  std::vector<std::string> reasons;  ///< one line each: finding and remedy
  std::vector<Item> evidence;        ///< available measurements
};

/// `good`, `weak` or `bad`.
[[nodiscard]] std::string to_string(Verdict::Level level);

/// Collects statistics of frames as they arrive: range and density of depth, brightness and sharpness of color, speed
/// of the image motion, plausibility of the focal length. Needs no poses. Takes some hundred microseconds per frame,
/// and some tens of milliseconds in up to a dozen frames per run, for feature extraction. Stores a sample of frames (at
/// most 64, 1.2 MB) for compare_with_map.
class RunMonitor {
 public:
  RunMonitor(const Rig& rig, const Options& options);
  ~RunMonitor();
  RunMonitor(RunMonitor&&) noexcept;
  RunMonitor& operator=(RunMonitor&&) noexcept;

  /// Assigns the following frames to this recording of the map, counted from 0.
  void begin_recording(int number);
  /// Adds a frame with its report.
  void add(const Frame& frame, const FrameReport& report);
  /// Compares the finished map with the sampled frames. `parts`: its surface; `trajectories`: final poses, by
  /// recording, in the same world; `clock_offset`: seconds by which their times are ahead of the frames'; `correction`:
  /// depth correction of the map. Renders at most 64 images, 64 pixels wide.
  void compare_with_map(const std::vector<Mesh>& parts, const std::vector<Trajectory>& trajectories,
                        double clock_offset, const DepthCorrection& correction);
  /// Compares a tracked trajectory with the poses from the recording's device or its owner, in the same clock. `drift`:
  /// tolerance factor for the drift of these poses; 1 suits visual-inertial odometry: 5 cm and 3 % of the path length
  /// (including the drift of tracking), 2 degrees.
  void compare_with_device(const Trajectory& tracked, const Trajectory& device, double drift = 1);
  /// Assessment with its reasons, ordered by explanatory power: implausible input first.
  [[nodiscard]] Verdict verdict(const RunSummary& outcome) const;

  /// All sums and the sample in one line, for a resumed run.
  [[nodiscard]] std::string save() const;
  /// Restores the result of save(). Ignores text in another format.
  void restore(const std::string& saved);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn
