// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "cairn/frame.hpp"
#include "cairn/mesh.hpp"
#include "cairn/options.hpp"
#include "cairn/trajectory.hpp"

namespace cairn {

enum class Poses {
  tracked,  // found by aligning each frame with the map; the world is the first camera's frame,
            // turned so that gravity points along y where Frame::acceleration tells it
  given     // taken from Frame::world_from_camera
};

enum class FrameState {
  fused,   // has a pose and is part of the map
  lost,    // no trustworthy pose: not fused
  skipped  // could not be used at all
};

/// What became of one frame.
struct FrameReport {
  int index = 0;
  double timestamp = 0.0;  // seconds
  FrameState state = FrameState::skipped;
  std::string reason;         // why lost or skipped
  double inlier_share = 0.0;  // see Alignment in src/track/align.hpp
  double overlap = 0.0;
  double rmse = 0.0;                                       // standard deviations of the depth noise
  double photometric_share = 0.0, photometric_rmse = 0.0;  // brightness in 0..1; 0: no colour was used
  int unobserved_by_geometry = 0, unobserved = 0;          // directions of the pose, of 6
  double moving = 0.0;                                     // share of the image that was left out since it moves
  std::string guess;                                       // where the alignment started
  int iterations = 0;
  int touched_bricks = 0, new_bricks = 0;
  std::map<std::string, double> stage_ms;  // preprocess, raycast, track, fuse
};

/// A trajectory made consistent by a pose graph over keyframes.
struct Refined {
  Trajectory trajectory;  // of all fused frames, stamped as the frames are
  int keyframes = 0;
  int pairs_tried = 0, pairs_aligned = 0, pairs_believed = 0;  // of keyframes that see the same
  double cost_before = 0, cost = 0;                            // see OptimiseReport in src/graph/pose_graph.hpp
};

/// The map from a stream of frames: start here. One frame's way is Mapper::add in src/map/mapper.cpp.
///
///   auto source = cairn::open_recording("rgbd_dataset_freiburg1_desk");
///   cairn::Mapper mapper(source->camera());
///   while (auto frame = source->next()) mapper.add(*frame);
///   cairn::write_mesh("desk.glb", mapper.mesh());
///
/// One thread at a time.
class Mapper {
 public:
  /// `device`: as `cairn devices` numbers them; -1 chooses. Throws std::runtime_error for options out of range (see
  /// check) and for a device that cannot be used.
  explicit Mapper(const Camera& camera, const Options& options = {}, Poses poses = Poses::tracked, int device = -1);
  ~Mapper();
  Mapper(Mapper&&) noexcept;

  /// Aligns and fuses the next frame. Bad frames and lost tracking are told in the report. Throws only when the device
  /// fails or its memory does not hold one view.
  FrameReport add(const Frame& frame);

  /// Of all fused frames, in the colour camera's clock: with Poses::tracked the depth images' stamps are moved by what
  /// the images tell of the two clocks' difference (Statistics::clock_offset).
  [[nodiscard]] Trajectory trajectory() const;
  /// Aligns keyframes that see the same with each other and corrects the trajectory (Options::refine must be set). The
  /// map stays as it was fused: fuse the frames again with these poses. `graph_file`: where to write the keyframes'
  /// graph (.g2o).
  [[nodiscard]] Refined refine(const std::filesystem::path& graph_file = {});
  /// The surface, in the world frame, with normals and colours.
  [[nodiscard]] Mesh mesh();
  /// Writes the grids `tsdf`, `weight` and `colour` to a .vdb file, whole or not at all.
  void write_map(const std::filesystem::path& file);

  struct Statistics {
    std::string device;
    std::uint64_t device_memory_peak = 0;  // bytes
    std::uint64_t bricks = 0, paged_out = 0, paged_in = 0;
    double clock_offset = 0;  // seconds that the colour camera's clock is ahead of the depth camera's
    FocalEvidence focal;
    std::optional<double> tilt;  // radians between the world's y axis and gravity as all fused frames measured it
    std::map<std::string, std::pair<int, double>> kernels;  // calls and total milliseconds on the device, by kernel
  };
  [[nodiscard]] Statistics statistics() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn
