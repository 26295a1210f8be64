// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Global consistency after the last frame: keyframes that see the same are aligned with each other, and a pose graph
// spreads what these alignments say against the tracked poses.
#pragma once
#include <vector>

#include "cairn/mapper.hpp"
#include "graph/pose_graph.hpp"
#include "place/features.hpp"
#include "surface/preprocess.hpp"
#include "track/align.hpp"

namespace cairn {

class Refine {
 public:
  Refine(gpu::Device& device, const Camera& camera, const Options& options);

  /// Keeps the frame if it lies far enough from the last one that was kept. `information` is that of its alignment with
  /// the map, in its own frame; none for the first one.
  void add(const Frame& frame, const Eigen::Isometry3d& world_from_camera, const Matrix6d* information);

  /// Aligns by geometry alone (colour may not be registered to depth), optimises, and moves the trajectory: between two
  /// keyframes the correction is interpolated. Writes the graph if `graph_file` is not empty.
  [[nodiscard]] Refined operator()(const Trajectory& tracked, const std::filesystem::path& graph_file = {});

 private:
  struct View {
    Frame frame;
    Eigen::Isometry3d world_from_camera;
    Matrix6d information;
    Features features;
    Thumbnail thumbnail;
  };
  struct Pair {
    std::size_t from, to;
    Eigen::Isometry3d from_from_to;  // guess
    bool is_loop;                    // found by its looks, not by its tracked pose
  };
  [[nodiscard]] std::vector<Pair> pairs() const;
  [[nodiscard]] std::vector<PoseGraph::Edge> align(const std::vector<Pair>& pairs);

  Camera camera_;
  Preprocess first_, second_;
  Align align_;
  std::vector<View> keyframes_;
};

}  // namespace cairn
