// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Bundle adjustment over depth and brightness: poses of keyframes, the surface that they see, and what all views share:
// the moments at which their rows were taken, the cameras, and what depth errs by, all together.
//
// The surface is a set of surfels. Each may move along its normal; what brightness differs by from its middle to two
// places beside it is its own, too, so that exposure does not matter (both as in Schöps, Sattler & Pollefeys 2019, "BAD
// SLAM"). There poses and surfels take turns; here surfels are eliminated from the normal equations (Schur complement),
// so that one step moves all. Both kinds of residuals are weighted by the scale of their own.
#pragma once
#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "adjust/camera_change.hpp"
#include "adjust/view.hpp"
#include "cairn/depth_correction.hpp"
#include "cairn/pose_graph.hpp"

namespace cairn {

/// When rows were taken, beside what the rig and the frames say.
struct BundleShutter {
  double clock = 0;    // seconds that the colour camera's clock is ahead
  double readout = 0;  // seconds from an image's first row to its last, of both cameras
};

/// How surely views and surfels lie where they are, with the first view where it is.
struct BundleCovariance {
  /// Of each view's pose: pose * retract(error); radians, then metres.
  std::vector<Matrix6d> of_views;
  /// The same of each view's pose in the frame of the view before it; zero for the first.
  std::vector<Matrix6d> of_steps;
  struct OfSurfel {
    Eigen::Vector3d position;           // in the world, metres
    double of_noise = 0, of_poses = 0;  // variances along its normal, m^2
  };
  std::vector<OfSurfel> of_surfels;
};

class Bundle {
 public:
  static constexpr double kTogether = 30;          // observations that count as one: neighbours err alike
  static constexpr double kFirstTolerance = 0.08;  // metres

  explicit Bundle(const Rig& rig);
  void add(const Frame& keyframe, const CameraMotion& motion, const Eigen::Isometry3d& world_from_camera);
  /// The same in two steps, of which the first may run for several keyframes at once.
  [[nodiscard]] BundleView view(const Frame& keyframe, const CameraMotion& motion) const;
  void add(BundleView view, const Eigen::Isometry3d& world_from_camera);
  /// Binds two views by how they were tracked against each other: it may have slipped, see weight_of_step().
  void tie(const PoseGraph::Edge& edge);
  void forget_ties() { ties_.clear(); }
  /// How close the surfels lie: few of them find the way, all of them the place.
  enum class Detail { coarse, fine };
  /// The first view stays where it is. A readout that is not asked for is 0. After each round `goes_on` is asked; where
  /// it says no, all stays as it is then.
  void adjust(bool finds_readout, Detail detail, const std::function<bool()>& goes_on = {});

  [[nodiscard]] const std::vector<Eigen::Isometry3d>& world_from_view() const { return poses_; }
  [[nodiscard]] const BundleShutter& shutter() const { return shared_.shutter; }
  /// From here on, what the depth camera errs by is found as well.
  void find_correction();
  /// Of the depth camera's own image; empty where it was not asked for.
  [[nodiscard]] const DepthCorrection& correction() const { return shared_.correction; }
  /// From here on, focal lengths, principal points, a radial term of lenses, and where the colour camera is are found
  /// as well.
  void find_cameras() { finds_cameras_ = true; }
  /// That of the constructor, with the cameras as they were found.
  [[nodiscard]] Rig rig() const;
  [[nodiscard]] double readout_sigma() const { return readout_sigma_; }  // seconds, of the last step
  [[nodiscard]] std::size_t surfels() const { return surfels_.size(); }
  [[nodiscard]] std::size_t observations() const { return seen_by_.size(); }
  /// By the curvature of what was minimised with the surfels of the last round, scaled by how much the places of the
  /// scene contradict each other; none where nothing holds a view.
  [[nodiscard]] std::optional<BundleCovariance> covariance() const;
  /// Mean robust error of surfels that the adjustment did not use, each put where the views that see it say: how well
  /// poses and shutter predict. Lower is better; comparable between adjustments of the same views.
  [[nodiscard]] double held_out_error();

 private:
  struct Surfel {
    Eigen::Vector3d position, normal;
    std::array<Eigen::Vector3d, 2> beside;                        // from its middle
    Eigen::Vector2d brightness_beside = Eigen::Vector2d::Zero();  // less that of its middle
    /// What brightness changes by along the surface, 1/m: in the middle and beside it. The mean of all views: what one
    /// image says is noise, that would hold surfels where they lie in it.
    std::array<Eigen::Vector3d, 3> slope;
    bool is_seen = false, has_slope = false;  // whether brightness_beside and slope are known
  };
  /// Unknowns that all views share; nodes of the correction follow on those that are looked for.
  enum Unknown {
    kClock,
    kReadout,
    kDepthCamera,
    kColourCamera = kDepthCamera + CameraChange::kUnknowns,
    kColourPose = kColourCamera + CameraChange::kUnknowns,
    kUnknowns = kColourPose + 6
  };
  using ByShared = Eigen::Matrix<double, kUnknowns, 1>;  // of those that are not looked for, anything
  struct Shared {
    BundleShutter shutter;
    CameraChange depth, colour;  // where colour is registered, it is the depth camera's
    Eigen::Isometry3d colour_from_depth;
    DepthCorrection correction;
  };
  /// What one view tells of one surfel: a gap along the normal, and two differences of brightness.
  struct Residual {
    double value = 0, weight = 0, measured = 0;
    Vector6d by_pose;
    Eigen::Vector3d by_surfel;  // along its normal, and its brightness_beside
    ByShared by_shared;
  };
  struct Seen {
    std::array<Residual, 3> residual;
    int count = 0;          // 1: the gap alone
    std::size_t pixel = 0;  // of the depth camera
    double by_offset = 0;   // the gap, by 1/m of the depth correction there
    std::array<Eigen::Vector3d, 3> slope;
  };
  /// What an observation shares with its surfel's place and a node of the correction, by the node's share of the pixel.
  struct WithNodes {
    std::size_t pixel = 0;
    double value = 0;
  };
  struct Look;
  struct Moment;
  struct Equations;
  struct Part;
  struct Solver;
  struct ByPlace;
  struct Cost {
    double gaps = 0, gap_count = 0, differences = 0, difference_count = 0;
    void add(const Bundle& bundle, const Seen& seen);
    void add(const Cost& other);
    [[nodiscard]] double mean() const;
  };

  [[nodiscard]] bool look(const Surfel& surfel, std::size_t view, bool brightness, Seen& seen) const;
  [[nodiscard]] const CameraChange& colour_change() const {
    return cameras_.rig.colour ? shared_.colour : shared_.depth;
  }
  [[nodiscard]] std::optional<Moment> colour_moment(const BundleView& view, const Eigen::Vector3d& in_camera) const;
  void look_at_brightness(const Surfel& surfel, std::size_t view, Seen& seen) const;
  [[nodiscard]] bool is_seen(const Surfel& surfel, std::size_t view, Seen& seen) const {
    return look(surfel, view, false, seen);
  }
  /// Surfels that follow on each other, and a ball around them.
  struct Group {
    std::size_t begin = 0, end = 0;
    Eigen::Vector3d middle;
    double radius = 0;
  };
  [[nodiscard]] std::vector<Group> groups(std::size_t begin) const;
  [[nodiscard]] bool may_see(std::size_t view, const Group& group) const;
  [[nodiscard]] double corrected_depth(const BundleView& view, std::size_t pixel) const {
    const auto z = static_cast<double>(view.depth[pixel]);
    return offsets_.empty() ? z : z / (1 + z * static_cast<double>(offsets_[pixel]));
  }
  [[nodiscard]] Eigen::Vector2d depth_pixel(const Eigen::Vector3d& point) const;
  void refresh();
  [[nodiscard]] int shared_unknowns() const { return finds_cameras_ ? kUnknowns : kDepthCamera; }
  void move_shared(const Eigen::VectorXd& step);
  void add_priors(Equations& equations) const;
  void add_priors_of_nodes(Equations& equations) const;
  [[nodiscard]] Surfel surfel_at(std::size_t view, int x, int y) const;
  enum class Cells { adjusted, held_out };
  void sample(Cells cells);
  void associate();
  void settle_surfels();
  void measure_scales();
  [[nodiscard]] Vector6d error_of(const PoseGraph::Edge& tie) const;
  [[nodiscard]] double cost_of_ties() const;
  void find_pairs();
  void linearise(std::size_t surfel, Equations& equations, Part& part) const;
  [[nodiscard]] WithNodes add_nodes(const Seen& seen, std::size_t view, Part& part) const;
  void eliminate(std::size_t surfel, const Equations& equations, Part& part) const;
  void eliminate_with_nodes(std::size_t surfel, const Equations& equations, Part& part) const;
  [[nodiscard]] Equations no_equations() const;
  [[nodiscard]] Equations linearise() const;
  [[nodiscard]] ByPlace linearise_by_places() const;
  [[nodiscard]] BundleCovariance covariance_of_views(const Solver& solver) const;
  [[nodiscard]] double squared_pulls(const ByPlace& by, const Solver& solver,
                                     const std::vector<Matrix6d>& covariance) const;
  void move_surfels(const Equations& equations, const Eigen::VectorXd& pose_steps, const Eigen::VectorXd& shared_step);
  [[nodiscard]] bool move(const Equations& equations, double damping);
  void descend();

  BundleCameras cameras_;
  std::vector<std::shared_ptr<const BundleView>> views_;  // copies share them
  std::vector<Eigen::Isometry3d> poses_;
  std::vector<PoseGraph::Edge> ties_;
  std::vector<Eigen::Vector3d> rays_;    // by pixel of the depth camera without its lens
  std::vector<Eigen::Vector2f> places_;  // in the camera's own image, by pixel of the depth camera without its lens
  std::vector<float> offsets_;           // of it, by pixel of the depth camera without its lens; empty: none
  bool finds_readout_ = false, finds_cameras_ = false;
  Shared shared_;
  std::vector<Surfel> surfels_;
  std::vector<std::uint32_t> first_, seen_by_;                  // by surfel: where its views begin; the views
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs_;  // of views that share surfels: the later, the earlier
  std::vector<std::uint32_t> pair_of_;                          // by pair of views: their number in pairs_
  int cell_ = 4;                                                // pixels of a view, of which one becomes a surfel
  double tolerance_ = kFirstTolerance;                          // metres that a surfel may lie off what a view measures
  double gap_sigma_ = 1, brightness_sigma_ = 1, readout_sigma_ = 0;
};

}  // namespace cairn
