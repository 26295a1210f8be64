// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Joint bundle adjustment over depth and brightness: keyframe poses, the surface, and parameters shared by all views:
// rolling shutter and clock, cameras, and depth correction.
// The surface is a set of surfels. Each moves along its normal, and has its own brightness differences between its
// center and two lateral points, which makes exposure irrelevant (both as in Schöps, Sattler & Pollefeys 2019, "BAD
// SLAM"). BAD SLAM alternates between poses and surfels; here surfels are eliminated from the normal equations (Schur
// complement), so that one step updates all. Each kind of residual is weighted by its own scale.
#pragma once
#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "bundle/camera_change.hpp"
#include "bundle/view.hpp"
#include "cairn/mapping/depth_correction.hpp"
#include "cairn/mapping/pose_graph.hpp"

namespace cairn {

/// Row times, relative to the rig and the frames.
struct BundleShutter {
  double clock = 0;    // s by which the color camera's clock is ahead
  double readout = 0;  // s from an image's first row to its last, of both cameras
};

/// Covariance of views and surfels, with the first view fixed.
struct BundleCovariance {
  /// Of each view's pose: pose * retract(error); radians, then meters.
  std::vector<Matrix6d> of_views;
  /// Of each view's pose in the frame of the preceding view; zero for the first.
  std::vector<Matrix6d> of_steps;
  struct OfSurfel {
    Eigen::Vector3d position;           // in the world, meters
    double of_noise = 0, of_poses = 0;  // variances along its normal, m^2
  };
  std::vector<OfSurfel> of_surfels;
};

class Bundle {
 public:
  static constexpr double kCorrelatedObservations =
      30;  // observations that count as one, since neighbors have correlated errors
  static constexpr double kFirstTolerance = 0.08;  // m

  explicit Bundle(const Rig& rig);
  void add(const Frame& keyframe, const CameraMotion& motion, const Eigen::Isometry3d& world_from_camera);
  /// The same in two steps; the first may run for several keyframes concurrently.
  [[nodiscard]] BundleView view(const Frame& keyframe, const CameraMotion& motion) const;
  void add(BundleView view, const Eigen::Isometry3d& world_from_camera);
  /// Adds an odometry edge between two views. The edge is heavy-tailed, see weight_of_step().
  void add_edge(const PoseGraph::Edge& edge);
  void clear_edges() { edges_.clear(); }
  /// Bundle of every second view and the last. The edges between successive views are composed, by kind. Surfels are
  /// as sparse as for all views.
  [[nodiscard]] Bundle every_second() const;
  /// Takes over poses and shared unknowns of every_second() after its adjustment. A view between two of its views moves
  /// with both.
  void follow(const Bundle& second);
  /// Density of the surfels: coarse for convergence, fine for accuracy; medium for cameras, which converge slowly.
  enum class Detail { coarse, medium, fine };
  /// Adjusts all views except the first, which is fixed. The readout is 0 unless it is estimated. `goes_on` is called
  /// after each round; if it returns false, the current state is kept.
  void adjust(bool finds_readout, Detail detail, const std::function<bool()>& goes_on = {});

  [[nodiscard]] const std::vector<Eigen::Isometry3d>& world_from_view() const { return poses_; }
  [[nodiscard]] const BundleShutter& shutter() const { return shared_.shutter; }
  /// Enables estimation of the depth correction.
  void find_correction();
  void forget_correction();
  /// In the depth camera's own image; empty unless enabled.
  [[nodiscard]] const DepthCorrection& correction() const { return shared_.correction; }
  /// Enables estimation of focal lengths, principal points, a radial distortion term, and the color camera's pose.
  void find_cameras() { finds_cameras_ = true; }
  /// Rig of the constructor with the estimated cameras.
  [[nodiscard]] Rig rig() const;
  [[nodiscard]] double readout_sigma() const { return readout_sigma_; }  // s, of the last step
  [[nodiscard]] std::size_t views() const { return views_.size(); }
  [[nodiscard]] const std::vector<PoseGraph::Edge>& edges() const { return edges_; }
  [[nodiscard]] std::size_t surfels() const { return surfels_.size(); }
  [[nodiscard]] std::size_t observations() const { return seen_by_.size(); }
  /// Covariance from the curvature of the cost with the surfels of the last round, scaled by the measured contradiction
  /// between places of the scene. Empty if a view is unconstrained.
  [[nodiscard]] std::optional<BundleCovariance> covariance() const;
  /// Mean robust error of held-out surfels, each at the mean of its observations: prediction quality of poses and
  /// shutter. Lower is better; comparable between adjustments of the same views.
  [[nodiscard]] double held_out_error();

 private:
  struct Surfel {
    Eigen::Vector3d position, normal;
    std::array<Eigen::Vector3d, 2> lateral;                        // offsets of the lateral points from the center
    Eigen::Vector2d lateral_brightness = Eigen::Vector2d::Zero();  // minus the brightness of the center
    /// Brightness gradient along the surface, 1/m: at the center and the lateral points. Mean of all views, since the
    /// noise of a single image would bind surfels to this image.
    std::array<Eigen::Vector3d, 3> slope;
    bool is_seen = false, has_slope = false;  // true if lateral_brightness and slope are set
  };
  /// Indices of the shared unknowns; nodes of the correction follow the enabled ones.
  enum Unknown {
    kClock,
    kReadout,
    kDepthCamera,
    kColorCamera = kDepthCamera + CameraChange::kUnknowns,
    kColorPose = kColorCamera + CameraChange::kUnknowns,
    kUnknowns = kColorPose + 6
  };
  using ByShared = Eigen::Matrix<double, kUnknowns, 1>;  // undefined for disabled unknowns
  struct Shared {
    BundleShutter shutter;
    CameraChange depth, color;  // with registered color, the depth camera's applies
    Eigen::Isometry3d color_from_depth;
    DepthCorrection correction;
  };
  /// Residual of a surfel in a view: a gap along the normal, or a difference of brightness.
  struct Residual {
    double value = 0, weight = 0, measured = 0;
    Vector6d by_pose;
    Eigen::Vector3d by_surfel;  // by its position along the normal, and by its lateral_brightness
    ByShared by_shared;
  };
  struct Seen {
    std::array<Residual, 3> residual;
    int count = 0;          // 1: the gap alone
    std::size_t pixel = 0;  // of the depth camera
    double by_offset = 0;   // derivative of the gap by the depth correction in 1/m at the pixel
    std::array<Eigen::Vector3d, 3> slope;
  };
  /// Coupling of an observation's surfel position with the correction's nodes, to be multiplied by each node's
  /// interpolation weight.
  struct WithNodes {
    std::size_t pixel = 0;
    double value = 0;
  };
  struct BrightnessSample;
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

  [[nodiscard]] bool observe(const Surfel& surfel, std::size_t view, bool brightness, Seen& seen) const;
  [[nodiscard]] const CameraChange& color_change() const { return cameras_.rig.color ? shared_.color : shared_.depth; }
  [[nodiscard]] std::optional<Moment> color_moment(const BundleView& view, const Eigen::Vector3d& in_camera) const;
  void observe_brightness(const Surfel& surfel, std::size_t view, Seen& seen) const;
  [[nodiscard]] bool is_seen(const Surfel& surfel, std::size_t view, Seen& seen) const {
    return observe(surfel, view, false, seen);
  }
  /// Consecutive surfels with a bounding sphere.
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
  void update_surfels();
  void measure_scales();
  [[nodiscard]] Vector6d error_of(const PoseGraph::Edge& edge) const;
  [[nodiscard]] double cost_of_edges() const;
  [[nodiscard]] double cost_of(const Cost& observations) const;
  void find_pairs();
  void linearize(std::size_t surfel, Equations& equations, Part& part) const;
  [[nodiscard]] WithNodes add_nodes(const Seen& seen, std::size_t view, Part& part) const;
  void eliminate(std::size_t surfel, const Equations& equations, Part& part) const;
  void eliminate_with_nodes(std::size_t surfel, const Equations& equations, Part& part) const;
  [[nodiscard]] Equations no_equations() const;
  [[nodiscard]] Equations linearize() const;
  [[nodiscard]] double cost(const Equations& before) const;
  [[nodiscard]] ByPlace linearize_by_places() const;
  [[nodiscard]] BundleCovariance covariance_of_views(const Solver& solver) const;
  [[nodiscard]] double variance_factor(const ByPlace& by, const Solver& solver,
                                       const std::vector<Matrix6d>& covariance) const;
  void move_surfels(const Equations& equations, const Eigen::VectorXd& pose_steps, const Eigen::VectorXd& shared_step);
  [[nodiscard]] bool move(const Equations& equations, double damping);
  void descend();

  BundleCameras cameras_;
  std::vector<std::shared_ptr<const BundleView>> views_;  // shared by copies
  std::vector<Eigen::Isometry3d> poses_;
  std::vector<PoseGraph::Edge> edges_;
  std::vector<Eigen::Vector3d> rays_;    // by pixel of the rectified depth camera
  std::vector<Eigen::Vector2f> places_;  // in the camera's own image, by pixel of the rectified depth camera
  std::vector<float> offsets_;           // of the depth correction, by pixel of the rectified depth camera; empty: none
  std::size_t sampled_views_ = 0;        // views of the bundle that every_second() was taken from; 0: none
  bool finds_readout_ = false, finds_cameras_ = false;
  Shared shared_;
  std::vector<Surfel> surfels_;
  std::vector<std::uint32_t> first_, seen_by_;                  // by surfel: start of its views; the views
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs_;  // pairs of views with common surfels: later, earlier
  std::vector<std::uint32_t> pair_of_;                          // index into pairs_, by pair of views
  int cell_ = 4;                        // pixels of a view per side of a cell; one surfel per cell
  std::size_t max_views_ = 8;           // per surfel
  double tolerance_ = kFirstTolerance;  // m: max. distance of a surfel from a measurement
  double gap_sigma_ = 1, brightness_sigma_ = 1, readout_sigma_ = 0;
};

}  // namespace cairn
