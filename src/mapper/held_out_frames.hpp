// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Held-out frames as evidence for or against a map.
#pragma once
#include "cairn/mapping/options.hpp"
#include "cairn/mapping/reports.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "map/frame_samples.hpp"
#include "preprocess/frame_pyramid.hpp"
#include "volume/vdb/brick_tree.hpp"

namespace cairn {

/// Calibration found from a recording, in addition to its rig's.
struct AddedCalibration {
  DepthCorrection correction;  // empty: none
  double readout = 0;          // s, of both cameras of a rig without a readout
};

/// Even sample of a run's held-out frames.
class HeldOutFrames {
 public:
  explicit HeldOutFrames(const Rig& rig) : samples_(rig) {}
  void add(double timestamp, const FramePyramid& seen, const SurfaceOptions& options);
  [[nodiscard]] bool empty() const { return samples_.all().empty(); }
  /// Compares the map with the frames at these poses (world_from_camera). `added`: calibration in addition to the
  /// rig's at add(). Returns nullopt if fewer than four frames have a pose.
  [[nodiscard]] std::optional<HeldOutError> compare(const BrickTree& map, const FuseOptions& options,
                                                    const AddedCalibration& added, const Trajectory& poses) const;

 private:
  FrameSamples samples_;
};

/// True if the frames confirm a change of the map from `before` to `after`: within tolerances, neither depth,
/// brightness, coverage nor doubled surface becomes worse.
[[nodiscard]] bool is_confirmed(const HeldOutError& before, const HeldOutError& after);

}  // namespace cairn
