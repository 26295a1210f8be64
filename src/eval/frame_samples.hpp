// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Frames of a run on a coarse grid, for a comparison with the finished map.
#pragma once
#include <cstdint>
#include <iosfwd>
#include <vector>

#include "cairn/frame.hpp"

namespace cairn {

/// A frame at the pixels of the grid.
struct FrameSample {
  double timestamp = 0;  // seconds
  int recording = 0;     // of the map, counted from 0
  bool held_out = false;
  std::vector<std::uint16_t> depth;      // units of kDepthUnit; 0: no measurement, or an edge
  std::vector<std::uint8_t> brightness;  // 0 to 255; empty: no color on depth

  static constexpr double kDepthUnit = 0.0002;  // meters; depth beyond 13.1 m is left out
  [[nodiscard]] double at(std::size_t pixel) const { return kDepthUnit * depth[pixel]; }
};

/// An even sample of a run's frames: every n-th, with n doubled as the run grows, so that a run of days takes no more
/// memory than one of minutes. Frames that are held out have a sample of their own.
class FrameSamples {
 public:
  static constexpr std::size_t kMost = 48, kMostHeldOut = 16;  // frames
  explicit FrameSamples(const Rig& rig);

  /// `depth_range`: meters, of what the map uses.
  void add(const Frame& frame, int recording, double min_depth, double max_depth);
  /// Pinhole camera of the grid: at most 64 pixels across, without lens and shutter.
  [[nodiscard]] const Camera& camera() const { return camera_; }
  /// All samples, fused frames first, each in the order of the run.
  [[nodiscard]] std::vector<const FrameSample*> all() const;

  void save(std::ostream& out) const;
  /// Samples that save() wrote for the same grid; others leave the samples as they are.
  void restore(std::istream& in);

 private:
  struct Thinned {
    std::vector<FrameSample> kept;
    std::uint64_t seen = 0, every = 1;  // frames
  };
  [[nodiscard]] FrameSample sample_of(const Frame& frame, double min_depth, double max_depth) const;
  Rig rig_;
  Camera camera_;
  std::vector<std::size_t> pixels_;  // of the image, by pixel of the grid; kOutside: beside it
  Thinned fused_, held_out_;
};

}  // namespace cairn
