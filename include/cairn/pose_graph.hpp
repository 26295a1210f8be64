// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Poses bound to each other by measurements of how they lie to one another.
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "cairn/pose.hpp"

namespace cairn {

struct PoseGraph {
  struct Edge {
    std::size_t i = 0, j = 0;                                    ///< nodes
    Eigen::Isometry3d i_from_j = Eigen::Isometry3d::Identity();  ///< measured pose of j in the frame of i
    Matrix6d information = Matrix6d::Identity();  ///< of (rotation, translation) in the frame of j; 1/rad^2, 1/m^2
    bool is_loop_closure = false;  ///< a loop: the optimiser may find that it is no measurement of this pair
    bool may_slip = false;         ///< no loop, and its error has long tails: a t-distribution's
  };
  /// An accelerometer's reading at rest.
  struct Gravity {
    std::size_t node = 0;
    Eigen::Vector3d up = -Eigen::Vector3d::UnitY();  ///< unit vector in the node's frame; in the world up is -y
    double sigma = 0.02;                             ///< radians
  };
  /// Of what a .g2o file has the information of rotations; Edge::information is always of radians.
  enum class FileRotation : std::uint8_t {
    angle,      ///< as GTSAM and SE-Sync read it, and as published graphs are compared
    half_angle  ///< of the quaternion's vector part, as g2o's own edges measure it
  };
  std::vector<Eigen::Isometry3d> world_from_node;
  std::vector<Edge> edges;
  std::vector<Gravity> gravity;
  FileRotation file_rotation = FileRotation::angle;  ///< of the file it was read from, or is written to
};

struct OptimiseOptions {
  bool robust = true;               ///< weigh edges that may be false
  double inlier_threshold = 22.46;  ///< squared error, in units of an edge's own noise, beyond which it is taken for
                                    ///< false: 99.9 % of the chi-squared distribution with 6 degrees of freedom
  int max_iterations = 100;         ///< of Levenberg-Marquardt, each time that it is called
};

struct OptimiseReport {
  double cost_before = 0, cost = 0;  ///< half the sum of squared errors in units of their noise, with the final weights
  int iterations = 0;
  int components = 0;                ///< parts that no edge joins; the first node of each stays where it is
  bool from_chordal = false;         ///< started from the chordal initialisation, not from the given poses
  std::vector<double> edge_weights;  ///< 1: believed, 0: false; by edge; of one that may slip, anything above 0
  double seconds = 0;
};

/// Nodes from which on optimise() may take seconds.
inline constexpr std::size_t kLargeGraph = 1000;

/// Moves the poses to the minimum of the sum of squared errors (Ceres, SE(3) on a manifold), from the given poses or
/// from the chordal initialisation (Carlone et al. 2015), whichever costs less. Edges that may be false are weighed by
/// graduated non-convexity with truncated least squares (Yang et al. 2020); before that, where many of them have no
/// neighbour that agrees with them, only those that have are believed (after Mangelson et al. 2018). Edges that may
/// slip are weighed again and again by what they are off (Lange, Little & Taylor 1989). In a graph of
/// thousands of nodes with few loops both are done with every eighth node first, then with all of them. Throws
/// std::runtime_error naming the edge for a number that is not finite, an information matrix that is not positive
/// definite, or a node that does not exist; the graph is then unchanged. The same graph gives the same bits.
OptimiseReport optimise(PoseGraph& graph, const OptimiseOptions& options = {});

/// What a loop that was just found moves, for a graph of thousands of nodes, where the whole costs seconds: the last
/// edge is that loop, of the others those of more than no weight are believed. Every eighth node of what follows each
/// other is optimised, the poses between are bent along. Where the last edge's share of the cost is more than noise can
/// be, its weight in the report is 0 and nothing moves. What optimise() makes of the same is more exact. Throws as
/// that.
OptimiseReport close_loop(PoseGraph& graph, const std::vector<double>& edge_weights);

/// Rotations that minimise the chordal distance to the measured ones, relaxed to matrices and projected; then the
/// translations that suit them (Carlone, Tron, Daniilidis & Dellaert 2015, sec. III-B). Nodes that no edge reaches
/// stay.
[[nodiscard]] std::vector<Eigen::Isometry3d> chordal_initialisation(const PoseGraph& graph,
                                                                    const std::vector<double>& edge_weights);

/// Cost as certified solvers define it: sum of kappa |R_j - R_i R_ij|^2 + tau |t_j - t_i - R_i t_ij|^2 (Rosen et al.
/// 2019, eq. 12), kappa and tau from the information matrices as there.
[[nodiscard]] double chordal_cost(const PoseGraph& graph);

/// A .g2o file (VERTEX_SE3:QUAT, EDGE_SE3:QUAT; ids are mapped to indices in the order of the ids). Information is read
/// as of radians, as GTSAM and SE-Sync do, unless the first line says that it is of half the angle; what is not
/// positive definite is made so, with one warning that counts such edges. Edges between nodes that do not follow each
/// other may be false. Throws std::runtime_error with file and line.
[[nodiscard]] PoseGraph read_g2o(const std::filesystem::path& file);
/// Writes it, with PoseGraph::file_rotation in the first line where that is half_angle; whole or not at all.
void write_g2o(const std::filesystem::path& file, const PoseGraph& graph);

}  // namespace cairn
