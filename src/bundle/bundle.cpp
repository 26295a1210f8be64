// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "bundle/bundle.hpp"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "base/median.hpp"
#include "bundle/bicubic.hpp"
#include "geometry/student_t.hpp"
#include "graph/relative_pose.hpp"

namespace cairn {
namespace {

// Pixels of a view per side of a cell; one surfel per cell.
constexpr int kCoarseCell = 12, kMediumCell = 8, kFineCell = 4;
constexpr std::size_t kMaxCoarseViews = 16, kMaxFineViews = 8;  // per surfel
constexpr double kManyViews = 60;                               // cells grow with more views, to bound the work
constexpr double kMaxCoarsening = 3;                            // max. factor of this growth
constexpr double kMinRayCosine = 0.3,
                 kMinNormalCosine = 0.8;  // min. cosines of a normal with its ray, with a measured normal
constexpr double kLateralOffset = 2.5;    // pixels
constexpr double kMinDepth = 0.1;         // m
constexpr double kFinalTolerance = 0.02;  // m: final max. distance of a surfel from a measurement
constexpr double kToleranceDecay = 0.7;
constexpr int kMaxRounds = 20, kMaxFineRounds = 8;
constexpr int kSamplingInterval = 2;            // rounds
constexpr double kPoseConvergence = 2e-4;       // rad, m: convergence of the poses per round
constexpr double kMinImprovement = 0.005;       // min. relative reduction of the held-out surfels' error to continue
constexpr double kReadoutConvergence = 1e-4;    // s: convergence of the readout in these rounds
constexpr double kGateSigmas = 3;               // standard deviations allowed in addition to the tolerance
constexpr double kCutoffSigmas = 4;             // standard deviations, of gaps (Beaton & Tukey 1974)
constexpr double kDegreesOfFreedom = 5;         // of the t-distribution of brightness (Kerl, Sturm & Cremers 2013)
constexpr double kEdgeInformationFactor = 0.3;  // share of their information: tracking used the same images
constexpr double kMinGapSigma = 0.1;            // min. ratio to the depth noise of the sensor model
constexpr double kMinBrightnessSigma = 1;       // gray levels: min. noise of an image
constexpr std::size_t kScaleSamples = 5000;     // surfels to estimate the scales
constexpr std::size_t kScaleParts = 16;
constexpr std::size_t kHeldOutInterval = 5;  // interval of cells held out to judge the prediction

constexpr double kMargin = 0.1;            // share of the image by which the camera's motion may shift a point
constexpr int kTileCells = 8;              // cells per tile of a view; its surfels are stored consecutively
constexpr std::size_t kGroupSurfels = 64;  // surfels
constexpr double kDepthMargin = 0.5,
                 kDepthMarginFactor =
                     1.1;  // m, factor: depth beyond a view's measurements at which it may see a surfel

bool holds(const Camera& c, int x, int y) { return x >= 0 && y >= 0 && x < c.width && y < c.height; }

/// Row as a share of the image's height, from the image center, clamped slightly outside.
double row_share(const Camera& c, const Eigen::Vector2d& pixel) {
  return std::clamp((pixel.y() + 0.5) / c.height - 0.5, -0.6, 0.6);
}

Eigen::Vector2d pixel_of(const Camera& c, const CameraChange& change, const Eigen::Vector3d& point) {
  return c.project(change.to_nominal(point.hnormalized()).homogeneous());
}

/// Time derivative of a point in the camera's frame due to the camera's motion.
Eigen::Vector3d rate_of(const CameraMotion& motion, double delay, const Eigen::Vector3d& point) {
  const Vector6d velocity = motion.velocity + delay * motion.acceleration;
  return velocity.head<3>().cross(point) + velocity.tail<3>();
}

Eigen::Isometry3d then_from_camera(const CameraMotion& motion, double delay) {
  return delay == 0 ? Eigen::Isometry3d::Identity() : retract(motion.after(delay)).inverse();
}

double cost_of_gap(double e) {
  const double rest = std::max(0.0, 1 - e * e / (kCutoffSigmas * kCutoffSigmas));
  return kCutoffSigmas * kCutoffSigmas / 3 * (1 - rest * rest * rest);
}
double cost_of_brightness(double e) { return (kDegreesOfFreedom + 1) * std::log(1 + e * e / kDegreesOfFreedom); }

/// Standard deviation by the median of magnitudes.
double scale_of(std::vector<double> magnitudes, double min_scale) {
  return std::max(min_scale, 1.4826 * median(std::move(magnitudes)));
}

}  // namespace

Bundle::Bundle(const Rig& rig) : cameras_(rig) {
  shared_.color_from_depth = rig.depth_from_color().inverse();
  refresh();
}

Eigen::Vector2d Bundle::depth_pixel(const Eigen::Vector3d& point) const {
  return pixel_of(cameras_.depth, shared_.depth, point);
}

void Bundle::add(const Frame& keyframe, const CameraMotion& motion, const Eigen::Isometry3d& world_from_camera) {
  add(view(keyframe, motion), world_from_camera);
}

BundleView Bundle::view(const Frame& keyframe, const CameraMotion& motion) const {
  return bundle_view(cameras_, keyframe, motion);
}

void Bundle::add(BundleView view, const Eigen::Isometry3d& world_from_camera) {
  views_.push_back(std::make_shared<const BundleView>(std::move(view)));
  poses_.push_back(world_from_camera);
}

void Bundle::add_edge(const PoseGraph::Edge& edge) {
  edges_.push_back(edge);
  edges_.back().information *= kEdgeInformationFactor;
}

namespace {

/// By view: the edge to the next view; nullptr if there is none.
using Steps = std::vector<const PoseGraph::Edge*>;

/// Composition of the edges from view `from` to view `to`, at most two; empty if one is missing.
std::optional<PoseGraph::Edge> composed_edge(const Steps& steps, std::size_t from, std::size_t to) {
  if (std::any_of(steps.data() + from, steps.data() + to, [](const auto* edge) { return edge == nullptr; })) return {};
  RelativePose composed = along(*steps[from]);
  if (from + 1 < to) composed = compose(composed, along(*steps[from + 1]));
  return PoseGraph::Edge{.i_from_j = composed.pose,
                         .information = composed.covariance.inverse(),
                         .heavy_tailed = steps[from]->heavy_tailed};
}

}  // namespace

Bundle Bundle::every_second() const {
  std::array<Steps, 2> steps;  // of odometry and of a device, or adjusted ones, which are heavy-tailed
  steps.fill(Steps(views_.size(), nullptr));
  for (const auto& edge : edges_)
    if (edge.j == edge.i + 1) steps[edge.heavy_tailed ? 1 : 0][edge.i] = &edge;
  Bundle second(cameras_.rig);
  second.sampled_views_ = views_.size();
  const std::size_t last = views_.size() - 1;
  for (std::size_t k = 0, before = 0;; before = k, k = std::min(k + 2, last)) {
    second.views_.push_back(views_[k]), second.poses_.push_back(poses_[k]);
    const std::size_t view = second.views_.size() - 1;
    for (const Steps& kind : steps)
      if (auto edge = view > 0 ? composed_edge(kind, before, k) : std::nullopt) {
        edge->i = view - 1, edge->j = view;
        second.edges_.push_back(*edge);
      }
    if (k == last) return second;
  }
}

void Bundle::follow(const Bundle& second) {
  const auto before = poses_;
  const std::size_t last = views_.size() - 1;
  for (std::size_t view = 0; view < second.poses_.size(); ++view)
    poses_[std::min(2 * view, last)] = second.poses_[view];
  for (std::size_t k = 1; k < last; k += 2) {
    const Eigen::Isometry3d by_before = poses_[k - 1] * before[k - 1].inverse() * before[k],
                            by_next = poses_[k + 1] * before[k + 1].inverse() * before[k];
    poses_[k] = by_before * retract(0.5 * local_coordinates(by_before.inverse() * by_next));
  }
  shared_ = second.shared_, readout_sigma_ = second.readout_sigma_;
  places_ = second.places_, offsets_ = second.offsets_, tolerance_ = second.tolerance_;
  refresh();
}

/// Time at which a view's color camera saw a point, and the camera's pose then.
struct Bundle::Moment {
  double share = 0, delay = 0;  // of the readout; s after the depth image's time
  Eigen::Isometry3d then_from_camera;
  Eigen::Matrix3d color_turn;  // from the depth camera's frame at the view's time
};

std::optional<Bundle::Moment> Bundle::color_moment(const BundleView& view, const Eigen::Vector3d& in_camera) const {
  const Eigen::Vector3d still = shared_.color_from_depth * in_camera;
  if (still.z() < kMinDepth) return std::nullopt;
  Moment m;
  m.share = row_share(cameras_.color, pixel_of(cameras_.color, color_change(), still));
  m.delay = view.color_delay - shared_.shutter.clock + shared_.shutter.readout * m.share;
  m.then_from_camera = then_from_camera(view.motion, m.delay);
  m.color_turn = shared_.color_from_depth.linear() * m.then_from_camera.linear();
  return m;
}

/// Brightness of a point in a view, with its derivatives.
struct Bundle::BrightnessSample {
  double value = 0;
  Vector6d by_pose;
  Eigen::Vector3d by_point;  // in the depth camera's frame
  ByShared by_shared;

  /// `slope`: brightness gradient along a surface with this normal, in the depth camera's frame; null: the image's own
  /// gradient.
  [[nodiscard]] bool at_point(const Bundle& bundle, const BundleView& view, const Moment& moment,
                              const Eigen::Vector3d& in_camera, const Eigen::Vector3d& normal,
                              const Eigen::Vector3d* slope) {
    const Camera& camera = bundle.cameras_.color;
    const Shared& shared = bundle.shared_;
    const CameraChange& change = bundle.color_change();
    const Eigen::Vector3d y = moment.then_from_camera * in_camera, c = shared.color_from_depth * y;
    if (c.z() < kMinDepth) return false;
    const Eigen::Vector2d m = c.hnormalized();
    const Eigen::Vector2d pixel = pixel_of(camera, change, c);
    const int i = static_cast<int>(std::floor(pixel.x())) - 1, j = static_cast<int>(std::floor(pixel.y())) - 1;
    if (!holds(camera, i, j) || !holds(camera, i + 3, j + 3)) return false;
    // Bicubic, as bilinear slopes jump at pixel centers, where a view's surfels are sampled: this would bias the poses.
    const Bicubic image(view.brightness, camera.width, pixel);
    value = image.value();
    Eigen::Vector3d g;
    if (slope == nullptr) {
      const Eigen::Vector2d by_ray =
          change.to_nominal_by_ray(m).transpose() * image.slope().cwiseProduct(Eigen::Vector2d(camera.fx, camera.fy));
      g << by_ray / c.z(), -by_ray.dot(m) / c.z();
    } else {
      const Eigen::Vector3d along = moment.color_turn * *slope, n = moment.color_turn * normal;
      g = along - along.dot(c) / n.dot(c) * n;  // motion along the ray does not change the brightness
    }
    by_point = shared.color_from_depth.linear().transpose() * g;
    by_pose << -y.cross(by_point), -by_point;
    const double by_clock = by_point.dot(rate_of(view.motion, moment.delay, y));
    by_shared.head<2>() << by_clock, -moment.share * by_clock;
    if (!bundle.finds_cameras_) return true;
    by_shared.tail<kUnknowns - kDepthCamera>().setZero();
    by_shared.segment<CameraChange::kUnknowns>(bundle.cameras_.rig.color ? kColorCamera : kDepthCamera) =
        change.to_nominal_by_unknowns(m).transpose() * change.to_nominal_by_ray(m).inverse().transpose() *
        (c.z() * g.head<2>());
    if (bundle.cameras_.rig.color) by_shared.segment<6>(kColorPose) << c.cross(g), g;
    return true;
  }
};

/// Returns false if the view does not see the surfel.
bool Bundle::observe(const Surfel& s, std::size_t k, bool brightness, Seen& seen) const {
  seen.count = 0;
  const BundleView& view = *views_[k];
  const Camera& camera = cameras_.depth;
  const Eigen::Matrix3d camera_from_world = poses_[k].linear().transpose();
  const Eigen::Vector3d middle = camera_from_world * (s.position - poses_[k].translation());
  if (middle.z() < kMinDepth) return false;
  const Eigen::Vector2d still = depth_pixel(middle);
  if (std::abs(still.x() / camera.width - 0.5) > 0.5 + kMargin) return false;
  const double share = row_share(camera, still), delay = shared_.shutter.readout * share;
  const Eigen::Isometry3d then = then_from_camera(view.motion, delay);
  const Eigen::Vector3d x = then * middle, n = then.linear() * (camera_from_world * s.normal);
  if (x.z() < kMinDepth || -n.dot(x.normalized()) < kMinRayCosine) return false;
  const Eigen::Vector2d pixel = depth_pixel(x);
  const int u = static_cast<int>(std::lround(pixel.x())), v = static_cast<int>(std::lround(pixel.y()));
  if (!holds(camera, u, v)) return false;
  seen.pixel = at(camera, u, v);
  const double z = corrected_depth(view, seen.pixel);
  if (!(z > 0) || view.normals[at(camera, u, v)].cast<double>().dot(n) < kMinNormalCosine) return false;
  const Eigen::Vector3d &ray = rays_[seen.pixel], q = z * ray;
  const double sigma = static_cast<double>(cameras_.rig.sensor.sigma(static_cast<float>(x.z()))), gap = n.dot(x - q);
  if (std::abs(gap) > tolerance_ + kGateSigmas * sigma) return false;

  Residual& r = seen.residual[0];
  // Sigma at the predicted depth: noise of the measurement must not scale its own residual or derivative, which would
  // favor shorter depth.
  r.value = r.measured = gap / sigma;
  const double e = r.value / gap_sigma_, rest = std::max(0.0, 1 - e * e / (kCutoffSigmas * kCutoffSigmas));
  r.weight = rest * rest / (gap_sigma_ * gap_sigma_);
  r.by_pose << -q.cross(n) / sigma, -n / sigma;
  r.by_surfel = Eigen::Vector3d(1 / sigma, 0, 0);
  r.by_shared.head<2>() << 0, -share * n.dot(rate_of(view.motion, delay, x)) / sigma;
  if (finds_cameras_) {
    r.by_shared.tail<kUnknowns - kDepthCamera>().setZero();
    r.by_shared.segment<CameraChange::kUnknowns>(kDepthCamera) =
        -z / sigma * shared_.depth.from_nominal_by_unknowns(ray.head<2>()).transpose() * n.head<2>();
  }
  seen.by_offset = x.z() * x.z() * n.dot(ray) / sigma;
  seen.count = 1;
  if (brightness && !view.brightness.empty()) observe_brightness(s, k, seen);
  return true;
}

void Bundle::observe_brightness(const Surfel& s, std::size_t k, Seen& seen) const {
  const BundleView& view = *views_[k];
  const Eigen::Matrix3d camera_from_world = poses_[k].linear().transpose();
  const Eigen::Vector3d middle = camera_from_world * (s.position - poses_[k].translation());
  const Eigen::Vector3d n = camera_from_world * s.normal;
  // The lateral points use the time of the center: a row is read in a tenth of a millisecond.
  const std::optional<Moment> moment = color_moment(view, middle);
  if (!moment) return;
  BrightnessSample here, lateral;
  const auto sample_at = [&](BrightnessSample& sample, const Eigen::Vector3d& point, std::size_t i) {
    const Eigen::Vector3d slope = camera_from_world * s.slope[i];
    if (!sample.at_point(*this, view, *moment, point, n, s.has_slope ? &slope : nullptr)) return false;
    seen.slope[i] = poses_[k].linear() * (sample.by_point - n.dot(sample.by_point) * n);
    return true;
  };
  if (!sample_at(here, middle, 0)) return;
  for (std::size_t i = 0; i < 2; ++i) {
    if (!sample_at(lateral, middle + camera_from_world * s.lateral[i], i + 1)) {
      seen.count = 1;
      return;
    }
    Residual& b = seen.residual[static_cast<std::size_t>(seen.count++)];
    b.measured = lateral.value - here.value;
    b.value = b.measured - s.lateral_brightness[static_cast<Eigen::Index>(i)];
    const double off = b.value / brightness_sigma_;
    b.weight = (kDegreesOfFreedom + 1) / (kDegreesOfFreedom + off * off) / (brightness_sigma_ * brightness_sigma_);
    b.by_pose = lateral.by_pose - here.by_pose;
    b.by_surfel.setZero();
    b.by_surfel[0] = n.dot(lateral.by_point - here.by_point);
    b.by_surfel[static_cast<Eigen::Index>(1 + i)] = -1;
    b.by_shared.head(shared_unknowns()) =
        lateral.by_shared.head(shared_unknowns()) - here.by_shared.head(shared_unknowns());
  }
}

Bundle::Surfel Bundle::surfel_at(std::size_t k, int x, int y) const {
  const BundleView& view = *views_[k];
  const std::size_t pixel = at(cameras_.depth, x, y);
  const double z = corrected_depth(view, pixel);
  const Eigen::Vector3d q = z * rays_[pixel], n = view.normals[pixel].cast<double>();
  const double delay = shared_.shutter.readout * ((y + 0.5) / cameras_.depth.height - 0.5);
  Surfel s;
  const Eigen::Isometry3d world_from_then = poses_[k] * retract(view.motion.after(delay));
  s.position = world_from_then * q;
  s.normal = (world_from_then.linear() * n).normalized();
  const double radius = kLateralOffset * z / cameras_.depth.fx;
  s.lateral[0] = radius * s.normal.cross(poses_[k].linear().col(1)).normalized();
  s.lateral[1] = radius * s.normal.cross(s.lateral[0]).normalized();
  return s;
}

/// Creates a surfel in each cell of each view without a surfel of an earlier view, among the adjusted or the held-out
/// cells.
void Bundle::sample(Cells cells) {
  const Camera& camera = cameras_.depth;
  const int columns = camera.width / cell_, rows = camera.height / cell_;
  const auto cell_of = [&](int i, int j) {
    return static_cast<std::size_t>(j) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(i);
  };
  std::vector<std::vector<bool>> taken(views_.size(), std::vector<bool>(cell_of(0, rows), false));
  surfels_.clear();
  for (std::size_t k = 0; k < views_.size(); ++k) {
    const std::size_t begin = surfels_.size();
    const auto sample_cell = [&](int i, int j) {
      const std::size_t cell = cell_of(i, j);
      // Scattered, and the same in every adjustment of these views.
      const bool is_held_out = (cell * 7 + k * 3) % kHeldOutInterval == 0;
      if (taken[k][cell] || is_held_out != (cells == Cells::held_out)) return;
      const auto first = static_cast<int>(k % 60);
      const int x = i * cell_ + (first * 5 + i * 3) % cell_, y = j * cell_ + (first * 3 + j * 5) % cell_;
      if (!views_[k]->normals[at(camera, x, y)].isZero()) surfels_.push_back(surfel_at(k, x, y));
    };
    for (int top = 0; top < rows; top += kTileCells)
      for (int left = 0; left < columns; left += kTileCells)
        for (int j = top; j < std::min(top + kTileCells, rows); ++j)
          for (int i = left; i < std::min(left + kTileCells, columns); ++i) sample_cell(i, j);
    const std::vector<Group> sampled = groups(begin);
    tbb::parallel_for(k + 1, views_.size(), [&](std::size_t other) {
      Seen seen;
      for (const Group& group : sampled) {
        if (!may_see(other, group)) continue;
        for (std::size_t s = group.begin; s < group.end; ++s) {
          if (!is_seen(surfels_[s], other, seen)) continue;
          const Eigen::Vector2d pixel = depth_pixel(poses_[other].inverse() * surfels_[s].position);
          const int i = static_cast<int>(pixel.x()) / cell_, j = static_cast<int>(pixel.y()) / cell_;
          if (i >= 0 && j >= 0 && i < columns && j < rows) taken[other][cell_of(i, j)] = true;
        }
      }
    });
  }
}

std::vector<Bundle::Group> Bundle::groups(std::size_t begin) const {
  std::vector<Group> all;
  for (; begin < surfels_.size(); begin += kGroupSurfels) {
    Group group{
        .begin = begin, .end = std::min(begin + kGroupSurfels, surfels_.size()), .middle = Eigen::Vector3d::Zero()};
    for (std::size_t s = group.begin; s < group.end; ++s) group.middle += surfels_[s].position;
    group.middle /= static_cast<double>(group.end - group.begin);
    for (std::size_t s = group.begin; s < group.end; ++s)
      group.radius = std::max(group.radius, (surfels_[s].position - group.middle).norm());
    all.push_back(group);
  }
  return all;
}

/// Conservative visibility test: false only if the view sees none of the group's surfels.
bool Bundle::may_see(std::size_t k, const Group& group) const {
  const BundleView& view = *views_[k];
  const Eigen::Vector3d middle = poses_[k].inverse() * group.middle;
  const double farthest = kDepthMarginFactor * static_cast<double>(view.farthest) + kDepthMargin;
  if (middle.z() + group.radius < kMinDepth || middle.z() - group.radius > farthest) return false;
  // Frustum planes of the image with a margin.
  const Camera& c = cameras_.depth;
  const auto is_beyond = [&](double slope, double along) {
    return along - slope * middle.z() > group.radius * std::hypot(1, slope);
  };
  constexpr double kImageMargin = 2 * kMargin;
  return !is_beyond((c.width * (1 + kImageMargin) - c.cx) / c.fx, middle.x()) &&
         !is_beyond((c.width * kImageMargin + c.cx) / c.fx, -middle.x()) &&
         !is_beyond((c.height * (1 + kImageMargin) - c.cy) / c.fy, middle.y()) &&
         !is_beyond((c.height * kImageMargin + c.cy) / c.fy, -middle.y());
}

/// Associates surfels with the views that see them. Surfels seen by fewer than two views are dropped.
void Bundle::associate() {
  std::vector<std::vector<std::uint32_t>> all(surfels_.size());
  const std::vector<Group> near = groups(0);
  tbb::parallel_for(std::size_t{0}, near.size(), [&](std::size_t g) {
    std::vector<std::uint32_t> candidates, views;
    for (std::size_t k = 0; k < views_.size(); ++k)
      if (may_see(k, near[g])) candidates.push_back(static_cast<std::uint32_t>(k));
    Seen seen;
    for (std::size_t s = near[g].begin; s < near[g].end; ++s) {
      views.clear();
      for (const std::uint32_t k : candidates)
        if (is_seen(surfels_[s], k, seen)) views.push_back(k);
      const std::size_t count = std::min(views.size(), max_views_);
      for (std::size_t i = 0; i < count; ++i) all[s].push_back(views[i * views.size() / count]);
    }
  });
  std::vector<Surfel> kept;
  first_.assign(1, 0);
  seen_by_.clear();
  for (std::size_t s = 0; s < surfels_.size(); ++s) {
    if (all[s].size() < 2) continue;
    kept.push_back(surfels_[s]);
    seen_by_.insert(seen_by_.end(), all[s].begin(), all[s].end());
    first_.push_back(static_cast<std::uint32_t>(seen_by_.size()));
  }
  surfels_ = std::move(kept);
}

/// Moves each surfel to the weighted mean of its observations.
void Bundle::update_surfels() {
  const Camera& camera = cameras_.depth;
  tbb::parallel_for(std::size_t{0}, surfels_.size(), [&](std::size_t i) {
    Surfel& s = surfels_[i];
    s.has_slope = false;
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    Eigen::Vector2d lateral = Eigen::Vector2d::Zero();
    std::array<Eigen::Vector3d, 3> slope;
    slope.fill(Eigen::Vector3d::Zero());
    double gap = 0, information = 0, count = 0;
    Seen seen;
    for (std::uint32_t o = first_[i]; o < first_[i + 1]; ++o) {
      const std::size_t k = seen_by_[o];
      if (!observe(s, k, true, seen)) continue;
      const Residual& r = seen.residual[0];
      gap += r.weight * r.value * r.by_surfel[0], information += r.weight * r.by_surfel[0] * r.by_surfel[0];
      if (seen.count == 3) {
        lateral += Eigen::Vector2d(seen.residual[1].measured, seen.residual[2].measured), ++count;
        for (std::size_t p = 0; p < slope.size(); ++p) slope[p] += seen.slope[p];
      }
      const Eigen::Vector2d pixel = depth_pixel(poses_[k].inverse() * s.position);
      const int u = static_cast<int>(std::lround(pixel.x())), v = static_cast<int>(std::lround(pixel.y()));
      if (holds(camera, u, v))
        normal += r.by_surfel[0] * r.by_surfel[0] *
                  (poses_[k].linear() * views_[k]->normals[at(camera, u, v)].cast<double>());
    }
    if (information > 0) s.position -= gap / information * s.normal;
    if (normal.norm() > 0) {
      s.normal = normal.normalized();
      const double radius = s.lateral[0].norm();
      s.lateral[0] = radius * (s.lateral[0] - s.normal.dot(s.lateral[0]) * s.normal).normalized();
      s.lateral[1] = radius * s.normal.cross(s.lateral[0]).normalized();
    }
    if (count > 0 && !s.is_seen) s.lateral_brightness = lateral / count, s.is_seen = true;
    if (count > 0) {
      s.has_slope = true;
      for (std::size_t p = 0; p < slope.size(); ++p) s.slope[p] = slope[p] / count;
    }
  });
}

void Bundle::measure_scales() {
  const std::size_t step = 1 + surfels_.size() / kScaleSamples, sampled = (surfels_.size() + step - 1) / step;
  struct Magnitudes {
    std::vector<double> gaps, differences;
  };
  std::vector<Magnitudes> parts(kScaleParts);
  tbb::parallel_for(std::size_t{0}, kScaleParts, [&](std::size_t part) {
    Seen seen;
    for (std::size_t i = part * sampled / kScaleParts; i < (part + 1) * sampled / kScaleParts; ++i)
      for (std::uint32_t o = first_[i * step]; o < first_[i * step + 1]; ++o) {
        if (!observe(surfels_[i * step], seen_by_[o], true, seen)) continue;
        parts[part].gaps.push_back(std::abs(seen.residual[0].value));
        for (int r = 1; r < seen.count; ++r)
          parts[part].differences.push_back(std::abs(seen.residual[static_cast<std::size_t>(r)].value));
      }
  });
  Magnitudes all;
  for (const Magnitudes& part : parts) {
    all.gaps.insert(all.gaps.end(), part.gaps.begin(), part.gaps.end());
    all.differences.insert(all.differences.end(), part.differences.begin(), part.differences.end());
  }
  gap_sigma_ = scale_of(std::move(all.gaps), kMinGapSigma);
  brightness_sigma_ = scale_of(std::move(all.differences), kMinBrightnessSigma);
}

Vector6d Bundle::error_of(const PoseGraph::Edge& edge) const {
  return local_coordinates(edge.i_from_j.inverse() * poses_[edge.i].inverse() * poses_[edge.j]);
}

void Bundle::Cost::add(const Bundle& bundle, const Seen& seen) {
  gaps += cost_of_gap(seen.residual[0].value / bundle.gap_sigma_), ++gap_count;
  for (int i = 1; i < seen.count; ++i)
    differences += cost_of_brightness(seen.residual[static_cast<std::size_t>(i)].value / bundle.brightness_sigma_),
        ++difference_count;
}

void Bundle::Cost::add(const Cost& other) {
  gaps += other.gaps, gap_count += other.gap_count;
  differences += other.differences, difference_count += other.difference_count;
}

/// Means, so that observations lost in a hole after a step do not lower the cost.
double Bundle::Cost::mean() const {
  return (gap_count > 0 ? gaps / gap_count : 0) + (difference_count > 0 ? 2 * differences / difference_count : 0);
}

double Bundle::cost_of_edges() const {
  double sum = 0;
  for (const auto& edge : edges_) {
    const Vector6d e = error_of(edge);
    sum += cost_of_step(e.dot(edge.information * e));
  }
  return sum;
}

double Bundle::cost_of(const Cost& observations) const {
  return static_cast<double>(seen_by_.size()) / kCorrelatedObservations * observations.mean() + cost_of_edges();
}

namespace {

/// Repeats the last motion of all views while its direction persists (Polyak 1964): slow modes, such as the scale of
/// the map with the depth correction, otherwise take tens of rounds.
class Momentum {
 public:
  void apply(std::vector<Eigen::Isometry3d>& poses) {
    std::vector<Vector6d> motion;
    for (std::size_t k = 0; k < before_.size(); ++k)
      motion.push_back(local_coordinates(before_[k].inverse() * poses[k]));
    before_ = poses;
    double product = 0;
    for (std::size_t k = 0; k < motion_.size(); ++k) product += motion[k].dot(motion_[k]);
    motion_ = std::move(motion);
    if (product <= 0) return;
    for (std::size_t k = 0; k < poses.size(); ++k) poses[k] = poses[k] * retract(motion_[k]);
  }

 private:
  std::vector<Eigen::Isometry3d> before_;  // poses before the last motion
  std::vector<Vector6d> motion_;           // by view
};

}  // namespace

void Bundle::adjust(bool finds_readout, Detail detail, const std::function<bool()>& goes_on) {
  finds_readout_ = finds_readout;
  if (!finds_readout) shared_.shutter.readout = 0;
  if (views_.size() < 2) return;
  const bool is_fine = detail == Detail::fine;
  const double coarsening = std::clamp(
      std::sqrt(static_cast<double>(std::max(views_.size(), sampled_views_)) / kManyViews), 1.0, kMaxCoarsening);
  cell_ = static_cast<int>(coarsening * (is_fine ? kFineCell : detail == Detail::medium ? kMediumCell : kCoarseCell));
  max_views_ = is_fine ? kMaxFineViews : kMaxCoarseViews;
  if (is_fine) tolerance_ = kFinalTolerance;
  Momentum momentum;
  std::optional<double> error;
  if (!is_fine && tolerance_ <= kFinalTolerance && !finds_cameras_) error = held_out_error();
  double readout = shared_.shutter.readout;
  for (int round = 0; round < (is_fine ? kMaxFineRounds : kMaxRounds); ++round) {
    if (detail == Detail::coarse) momentum.apply(poses_);
    if (round % kSamplingInterval == 0) sample(Cells::adjusted);
    associate();
    if (surfels_.empty()) return;
    find_pairs();
    measure_scales();
    update_surfels();
    measure_scales();
    const auto before = poses_;
    descend();
    double moved = 0;
    for (std::size_t k = 0; k < poses_.size(); ++k)
      moved = std::max(moved, local_coordinates(before[k].inverse() * poses_[k]).cwiseAbs().maxCoeff());

    if (goes_on && !goes_on()) return;
    const bool is_narrow = tolerance_ <= kFinalTolerance;
    tolerance_ = std::max(kFinalTolerance, kToleranceDecay * tolerance_);
    if (!is_narrow) continue;
    if (moved < kPoseConvergence) return;
    if (finds_cameras_) continue;  // cameras still converge after the prediction has
    if (!is_fine && (round + 1) % kSamplingInterval != 0) continue;
    const double now = held_out_error();
    const bool is_readout_converged = std::abs(shared_.shutter.readout - readout) < kReadoutConvergence;
    if (error && is_readout_converged && now > (1 - kMinImprovement) * *error) return;
    error = now, readout = shared_.shutter.readout;
  }
}

double Bundle::held_out_error() {
  const std::vector<Surfel> used = surfels_;
  const std::vector<std::uint32_t> first = first_, seen_by = seen_by_;
  const double gap_sigma = gap_sigma_, brightness_sigma = brightness_sigma_, tolerance = tolerance_;
  tolerance_ = kFinalTolerance;
  sample(Cells::held_out);
  associate();
  gap_sigma_ = 1, brightness_sigma_ = 2;  // fixed, for comparable errors
  update_surfels();
  update_surfels();
  Cost cost;
  Seen seen;
  for (std::size_t s = 0; s < surfels_.size(); ++s)
    for (std::uint32_t o = first_[s]; o < first_[s + 1]; ++o)
      if (observe(surfels_[s], seen_by_[o], true, seen)) cost.add(*this, seen);
  const double error = cost.mean();
  surfels_ = used, first_ = first, seen_by_ = seen_by;
  gap_sigma_ = gap_sigma, brightness_sigma_ = brightness_sigma, tolerance_ = tolerance;
  return error;
}

}  // namespace cairn
