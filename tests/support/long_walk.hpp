// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Pose graph of a walk of hours through a building.
#pragma once
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "cairn/mapping/pose_graph.hpp"

namespace cairn {

/// Steps of 25 cm between random places of floors of 20 by 10 meters, with noise; loops to earlier places, with noise;
/// and false loops, half of them single, half in rows of five consistent loops, as between rooms of the same
/// appearance.
class LongWalk {
 public:
  LongWalk(std::size_t nodes, std::size_t true_loops, std::size_t false_loops) {
    walk(nodes);
    for (std::size_t k = 1; k < nodes; ++k) steps_.push_back(edge(k - 1, k, truth[k - 1].inverse() * truth[k], kStep));
    find_loops(true_loops);
    for (std::size_t n = 0; n < false_loops; n += kRow) {
      const bool in_a_row = n / kRow % 2 == 0;
      std::size_t i = 0, j = 0;
      Eigen::Isometry3d wrong;  // false offset of the second place
      for (std::size_t m = 0; m < kRow && n + m < false_loops; ++m) {
        if (m == 0 || !in_a_row) {
          do {
            i = uniform(nodes - kRow), j = uniform(nodes - kRow);
          } while (i + kBetween > j ||
                   (truth[i].translation() - truth[j].translation()).norm() < kMinFalseLoopDistance);
          wrong = truth[i] * motion({0.1, 0.5}) * truth[j].inverse();
        } else {
          ++i, ++j;
        }
        loops.push_back({edge(i, j, truth[i].inverse() * wrong * truth[j], kLoop), true});
        loops.back().edge.is_loop_closure = true;
      }
    }
    std::stable_sort(loops.begin(), loops.end(), [](const Loop& a, const Loop& b) { return a.edge.j < b.edge.j; });
  }

  struct Loop {
    PoseGraph::Edge edge;
    bool is_false = false;
  };
  std::vector<Eigen::Isometry3d> truth;
  std::vector<Loop> loops;  // sorted by their second node

  /// Adds a node after the last node of `graph`, at the pose given by its step.
  void add_node(PoseGraph& graph) const {
    const std::size_t k = graph.world_from_node.size();
    graph.world_from_node.push_back(k == 0 ? truth[0] : graph.world_from_node.back() * steps_[k - 1].i_from_j);
  }
  /// Graph of the first nodes at given poses, with their steps and the first `loop_count` loops.
  [[nodiscard]] PoseGraph graph(const std::vector<Eigen::Isometry3d>& poses, std::size_t loop_count) const {
    PoseGraph graph{.world_from_node = poses};
    graph.edges.assign(steps_.begin(), steps_.begin() + static_cast<std::ptrdiff_t>(poses.size()) - 1);
    for (std::size_t k = 0; k < loop_count; ++k) graph.edges.push_back(loops[k].edge);
    return graph;
  }
  /// Root mean square error in meters, with the first node fixed.
  [[nodiscard]] double error(const PoseGraph& graph) const {
    double squared = 0;
    for (std::size_t k = 0; k < graph.world_from_node.size(); ++k)
      squared += (graph.world_from_node[k].translation() - truth[k].translation()).squaredNorm();
    return std::sqrt(squared / static_cast<double>(graph.world_from_node.size()));
  }

 private:
  struct Noise {
    double radians, meters;
  };
  static constexpr Noise kStep{0.002, 0.004}, kLoop{0.003, 0.01};
  static constexpr std::size_t kBetween = 200, kRow = 5;  // nodes between a loop's ends; loops in a row
  static constexpr double kMinFalseLoopDistance = 5, kMaxLoopDistance = 1;  // meters
  static constexpr double kStepLength = 0.25, kTurn = 0.2;

  std::size_t uniform(std::size_t below) { return random_() % below; }
  Eigen::Isometry3d motion(Noise noise) {
    Vector6d x;
    for (int i = 0; i < 6; ++i) x[i] = (i < 3 ? noise.radians : noise.meters) * normal_(random_);
    return retract(x);
  }
  PoseGraph::Edge edge(std::size_t i, std::size_t j, const Eigen::Isometry3d& true_motion, Noise noise) {
    PoseGraph::Edge edge{.i = i, .j = j, .i_from_j = true_motion * motion(noise)};
    edge.information.diagonal() << Eigen::Vector3d::Constant(1 / (noise.radians * noise.radians)),
        Eigen::Vector3d::Constant(1 / (noise.meters * noise.meters));
    return edge;
  }
  void walk(std::size_t nodes) {
    Eigen::Vector3d at(5, 0, 5), to = at;
    double heading = 0;
    for (std::size_t k = 0; k < nodes; ++k) {
      if ((to - at).norm() < 2 * kStepLength)
        to = 2.5 * Eigen::Vector3d(static_cast<double>(uniform(8)), -static_cast<double>(uniform(1 + nodes / 7000)),
                                   static_cast<double>(uniform(4)));
      const Eigen::Vector3d to_target = to - at;
      const double off = std::remainder(std::atan2(to_target.x(), to_target.z()) - heading, 2 * M_PI);
      heading += std::clamp(off, -kTurn, kTurn);
      if (std::abs(off) < 0.5) at += kStepLength * to_target.normalized();
      Eigen::Isometry3d t(Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitY()));
      t.translation() = at;
      truth.push_back(t);
    }
  }
  /// At most one per node; several in a row, as while the camera stays at a place.
  void find_loops(std::size_t count) {
    std::vector<bool> has_one(truth.size(), false);
    while (loops.size() < count) {
      const std::size_t first = kBetween + 1 + uniform(truth.size() - kBetween - 1);
      for (std::size_t j = first; j < std::min(first + kRow, truth.size()) && loops.size() < count; ++j) {
        if (has_one[j]) continue;
        const std::size_t from = uniform(j - kBetween);
        for (std::size_t n = 0; n < j - kBetween; ++n) {
          const std::size_t i = (from + n) % (j - kBetween);
          const Eigen::Isometry3d between = truth[i].inverse() * truth[j];
          if (between.translation().norm() > kMaxLoopDistance || Eigen::AngleAxisd(between.linear()).angle() > 0.5)
            continue;
          loops.push_back({edge(i, j, between, kLoop)});
          loops.back().edge.is_loop_closure = has_one[j] = true;
          break;
        }
      }
    }
  }

  std::mt19937 random_{11};
  std::normal_distribution<double> normal_;
  std::vector<PoseGraph::Edge> steps_;
};

}  // namespace cairn
