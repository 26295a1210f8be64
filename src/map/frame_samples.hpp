// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Frames of a run sampled on a coarse grid, for comparison with the finished map.
#pragma once
#include <cstdint>
#include <iosfwd>
#include <vector>

#include "cairn/mapping/frame.hpp"

namespace cairn {

/// A frame on the pixels of the grid.
struct FrameSample {
  double timestamp = 0;  // seconds
  int recording = 0;     // index of the recording in the map, from 0
  bool held_out = false;
  std::vector<std::uint16_t> depth;      // units of kDepthUnit; 0: no measurement, or an edge
  std::vector<std::uint8_t> brightness;  // 0 to 255; empty: no color aligned with depth

  static constexpr double kDepthUnit = 0.0002;  // meters; depth beyond 13.1 m is dropped
  [[nodiscard]] double at(std::size_t pixel) const { return kDepthUnit * depth[pixel]; }
};

/// Even sample of a run's frames: every n-th frame, with n doubled as the run grows, so that memory does not grow with
/// its length. Held-out frames are sampled separately.
class FrameSamples {
 public:
  static constexpr std::size_t kMaxFused = 48, kMaxHeldOut = 16;  // frames
  explicit FrameSamples(const Rig& rig);

  /// Depth outside [min_depth, max_depth], in meters, is dropped.
  void add(const Frame& frame, int recording, double min_depth, double max_depth);
  /// Pinhole camera of the grid: at most 64 pixels wide, without distortion and rolling shutter.
  [[nodiscard]] const Camera& camera() const { return camera_; }
  /// All samples, fused frames first, each in the order of the run.
  [[nodiscard]] std::vector<const FrameSample*> all() const;

  void save(std::ostream& out) const;
  /// Restores samples written by save() for the same grid; keeps the current samples for any other input.
  void restore(std::istream& in);

 private:
  struct Thinned {
    std::vector<FrameSample> kept;
    std::uint64_t seen = 0, every = 1;  // frames
  };
  [[nodiscard]] FrameSample sample_of(const Frame& frame, double min_depth, double max_depth) const;
  Rig rig_;
  Camera camera_;
  std::vector<std::size_t> pixels_;  // image pixel per grid pixel; kOutside: outside the image
  Thinned fused_, held_out_;
};

}  // namespace cairn
