// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Pose graph: poses as nodes, measured relative poses as edges.
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "cairn/mapping/pose.hpp"

namespace cairn {

struct PoseGraph {
  struct Edge {
    std::size_t i = 0, j = 0;                                    ///< node indices
    Eigen::Isometry3d i_from_j = Eigen::Isometry3d::Identity();  ///< measured pose of j in the frame of i
    Matrix6d information = Matrix6d::Identity();  ///< for (rotation, translation) in the frame of j; 1/rad^2, 1/m^2
    bool is_loop_closure = false;                 ///< loop closure: the optimizer may reject it as an outlier
    bool heavy_tailed = false;                    ///< odometry edge with a heavy-tailed error: t-distribution
  };
  /// Gravity direction at a node, from an accelerometer at rest.
  struct Gravity {
    std::size_t node = 0;
    Eigen::Vector3d up = -Eigen::Vector3d::UnitY();  ///< unit vector in the node's frame; up is -y in the world
    double sigma = 0.02;                             ///< radians
  };
  /// Unit of rotations in the information matrices of a .g2o file; Edge::information always uses radians.
  enum class FileRotation : std::uint8_t {
    angle,      ///< radians, as in GTSAM, SE-Sync and published benchmarks
    half_angle  ///< vector part of the quaternion, as in g2o's own edges
  };
  std::vector<Eigen::Isometry3d> world_from_node;
  std::vector<Edge> edges;
  std::vector<Gravity> gravity;
  FileRotation file_rotation = FileRotation::angle;  ///< of the .g2o file read or written
};

struct OptimizeOptions {
  bool robust = true;               ///< robust weights for loop closures
  double inlier_threshold = 22.46;  ///< squared error in units of the edge's noise; larger is an outlier: 99.9 % of the
                                    ///< chi-squared distribution with 6 degrees of freedom
  int max_iterations = 100;         ///< Levenberg-Marquardt iterations per solve
};

struct OptimizeReport {
  double cost_before = 0, cost = 0;  ///< half the sum of squared normalized errors, with the final weights
  int iterations = 0;
  int components = 0;                ///< connected components; the first node of each is fixed
  bool from_chordal = false;         ///< started from the chordal initialization, not from the given poses
  std::vector<double> edge_weights;  ///< by edge: 1: inlier, 0: outlier; always above 0 for heavy_tailed edges
  double seconds = 0;
};

/// Number of nodes above which optimize() may take seconds.
inline constexpr std::size_t kLargeGraph = 1000;

/// Optimizes the poses: minimizes the sum of squared errors (Ceres, SE(3) on a manifold), starting from the given poses
/// or from the chordal initialization (Carlone et al. 2015), whichever has the lower cost. Loop closures are weighted
/// by graduated non-convexity with truncated least squares (Yang et al. 2020); before it, if many of them have no
/// consistent neighbor, only pairwise consistent ones are kept (after Mangelson et al. 2018). Heavy-tailed edges are
/// iteratively reweighted by their residuals (Lange, Little & Taylor 1989). A graph with thousands of nodes and few
/// loops is first solved with every eighth node, then with all nodes. Throws std::runtime_error naming the edge for a
/// value that is not finite, an information matrix that is not positive definite, or a missing node; the graph is then
/// unchanged. The result is bit-identical for the same graph.
OptimizeReport optimize(PoseGraph& graph, const OptimizeOptions& options = {});

/// Fast approximate update of a graph with thousands of nodes after one new loop closure, the last edge; optimize()
/// would take seconds. The other edges are inliers if their weight is above 0. Optimizes every eighth node of
/// consecutive ones and interpolates the poses between them. If closing the loop costs more than measurement noise
/// explains, its weight in the report is 0 and no pose moves. Less accurate than optimize(). Throws as optimize().
OptimizeReport close_loop(PoseGraph& graph, const std::vector<double>& edge_weights);

/// Chordal initialization: rotations that minimize the chordal distance to the measured ones, relaxed to matrices and
/// projected; then the corresponding translations (Carlone, Tron, Daniilidis & Dellaert 2015, sec. III-B). Nodes
/// without edges keep their poses.
[[nodiscard]] std::vector<Eigen::Isometry3d> chordal_initialization(const PoseGraph& graph,
                                                                    const std::vector<double>& edge_weights);

/// Cost in the definition of certified solvers: sum of kappa |R_j - R_i R_ij|^2 + tau |t_j - t_i - R_i t_ij|^2 (Rosen
/// et al. 2019, eq. 12), with kappa and tau from the information matrices as in that paper.
[[nodiscard]] double chordal_cost(const PoseGraph& graph);

/// Reads a .g2o file (VERTEX_SE3:QUAT, EDGE_SE3:QUAT; node indices follow the order of the ids). Information is in
/// radians, as in GTSAM and SE-Sync, unless the first line declares half angles. Matrices that are not positive
/// definite are made so, with one warning that counts them. Edges between non-consecutive nodes are loop closures.
/// Throws std::runtime_error with file and line.
[[nodiscard]] PoseGraph read_g2o(const std::filesystem::path& file);
/// Writes a .g2o file atomically; the first line states PoseGraph::file_rotation if it is half_angle.
void write_g2o(const std::filesystem::path& file, const PoseGraph& graph);

}  // namespace cairn
