// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Bundle adjustment over depth and brightness: poses of keyframes, the surface that they see, and the moments at which
// their rows were taken, all together.
//
// The surface is a set of surfels. Each may move along its normal; what brightness differs by from its middle to two
// places beside it is its own, too, so that exposure does not matter (both as in Schöps, Sattler & Pollefeys 2019, "BAD
// SLAM"). There poses and surfels take turns; here surfels are eliminated from the normal equations (Schur complement),
// so that one step moves all. Both kinds of residuals are weighted by the scale of their own.
#pragma once
#include <array>
#include <memory>
#include <vector>

#include "adjust/view.hpp"
#include "cairn/pose_graph.hpp"

namespace cairn {

/// When rows were taken, beside what the rig and the frames say.
struct BundleShutter {
  double clock = 0;    // seconds that the colour camera's clock is ahead
  double readout = 0;  // seconds from an image's first row to its last, of both cameras
};

class Bundle {
 public:
  static constexpr double kTogether = 30;  // observations that count as one: neighbours err alike

  /// Of a tie, by its squared error in units of its noise and a t-distribution: tracking may have slipped.
  [[nodiscard]] static double weight_of_tie(double squared_error);

  explicit Bundle(const Rig& rig);
  void add(const Frame& keyframe, const Vector6d& velocity, const Eigen::Isometry3d& world_from_camera);
  /// Binds two views by how they were tracked against each other.
  void tie(const PoseGraph::Edge& edge) { ties_.push_back(edge); }
  /// The first view stays where it is. A readout that is not asked for stays 0.
  void adjust(bool finds_readout);

  [[nodiscard]] const std::vector<Eigen::Isometry3d>& world_from_view() const { return poses_; }
  [[nodiscard]] const BundleShutter& shutter() const { return shutter_; }
  [[nodiscard]] double readout_sigma() const { return readout_sigma_; }  // seconds, of the last step
  [[nodiscard]] std::size_t surfels() const { return surfels_.size(); }
  [[nodiscard]] std::size_t observations() const { return seen_by_.size(); }
  /// Mean robust error of surfels that the adjustment did not use, each put where the views that see it say: how well
  /// poses and shutter predict. Lower is better; comparable between adjustments of the same views.
  [[nodiscard]] double held_out_error();

 private:
  struct Surfel {
    Eigen::Vector3d position, normal;
    std::array<Eigen::Vector3d, 2> beside;                        // from its middle
    Eigen::Vector2d brightness_beside = Eigen::Vector2d::Zero();  // less that of its middle
    bool is_seen = false;                                         // in brightness, so that that is known
  };
  using Shutter = Eigen::Vector2d;  // clock, readout
  /// What one view tells of one surfel: a gap along the normal, and two differences of brightness.
  struct Residual {
    double value = 0, weight = 0, measured = 0;
    Vector6d by_pose;
    Eigen::Vector3d by_surfel;  // along its normal, and its brightness_beside
    Shutter by_shutter;
  };
  struct Seen {
    std::array<Residual, 3> residual;
    int count = 0;  // 1: the gap alone
  };
  struct Look;
  struct Equations;

  [[nodiscard]] bool look(const Surfel& surfel, std::size_t view, bool brightness, Seen& seen) const;
  [[nodiscard]] bool is_seen(const Surfel& surfel, std::size_t view, Seen& seen) const {
    return look(surfel, view, false, seen);
  }
  [[nodiscard]] Surfel surfel_at(std::size_t view, int x, int y) const;
  enum class Cells { adjusted, held_out };
  void sample(Cells cells);
  void associate();
  void settle_surfels();
  void measure_scales();
  void weigh_ties();
  [[nodiscard]] Vector6d error_of(const PoseGraph::Edge& tie) const;
  [[nodiscard]] double cost_of_surfels() const;
  [[nodiscard]] double cost() const;
  void linearise_surfels(Equations& equations) const;
  [[nodiscard]] Equations eliminate_surfels() const;
  void move_surfels(const Equations& equations, const Eigen::VectorXd& pose_steps, const Shutter& shutter_step);
  void step(double& damping, double& last);

  BundleCameras cameras_;
  Eigen::Isometry3d colour_from_depth_;
  std::vector<std::shared_ptr<const BundleView>> views_;  // copies share them
  std::vector<Eigen::Isometry3d> poses_;
  std::vector<PoseGraph::Edge> ties_;
  bool finds_readout_ = false;
  BundleShutter shutter_;
  std::vector<Surfel> surfels_;
  std::vector<std::uint32_t> first_, seen_by_;  // by surfel: where its views begin; the views
  double tolerance_ = 0;                        // metres that a surfel may lie off what a view measures
  double gap_sigma_ = 1, brightness_sigma_ = 1, readout_sigma_ = 0;
};

}  // namespace cairn
