// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "track/align.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "shaders/noise.h"
#include "spirv/icp_reduce.comp.h"
#include "spirv/photometric_reduce.comp.h"

namespace cairn {
namespace {

constexpr std::uint32_t kWorkgroup = 64;
constexpr std::uint32_t kTilesAcross = 4, kTilesDown = 8;
constexpr std::uint32_t kMaxGroups = kTilesAcross * kTilesDown;
constexpr std::uint32_t kMaxSums = kMaxGroups * kWorkgroup;  // a subgroup has at least one thread
constexpr double kConverged = 1e-4;   // radians and metres: some hundredths of a pixel, a hundredth of a voxel
constexpr std::uint32_t kSparse = 2;  // of the finest level's pixels, in a row and a column, until all are looked at
constexpr double kConvergedCoarse = 4e-4;  // at level 0; twice that at each coarser one
constexpr double kMinBrightnessSigma = 1.0 / 255;
constexpr float kCut = 4.0f;             // standard deviations of the depth noise
constexpr double kMinDepthSigma = 0.1;   // standard deviations of the depth noise
constexpr double kWeakGeometry = 0.002;  // share of a direction in the sum of all
constexpr double kAgreeing = 0.75;       // share of inliers
constexpr double kUnobserved = 1e-5;     // of the strongest direction
// Brightness residuals of neighbouring pixels go together, so that many tell as little as one. What the sensor's noise
// explains of their variance depends on interpolation only; the rest is calibration, shutter and shading, which whole
// objects share.
constexpr double kBrightnessNoise = 0.015;  // standard deviation, brightness in 0..1
constexpr double kNoiseTogether = 10;       // residuals that count as one
constexpr double kSystematicTogether = 60;
constexpr double kTurning = 0.3;  // radians a second: the camera's turning tells when its images were taken
constexpr double kMinPhotometricShare = 0.05;  // of the pixels must have a brightness in both images

void add(const shader::NormalEquations& p, Matrix6d& a, Vector6d& b) {
  a(0, 0) += p.rr0.x, a(0, 1) += p.rr0.y, a(0, 2) += p.rr0.z;
  a(1, 1) += p.rr1.x, a(1, 2) += p.rr1.y, a(2, 2) += p.rr1.z;
  a(0, 3) += p.rt0.x, a(0, 4) += p.rt0.y, a(0, 5) += p.rt0.z;
  a(1, 3) += p.rt1.x, a(1, 4) += p.rt1.y, a(1, 5) += p.rt1.z;
  a(2, 3) += p.rt2.x, a(2, 4) += p.rt2.y, a(2, 5) += p.rt2.z;
  a(3, 3) += p.tt0.x, a(3, 4) += p.tt0.y, a(3, 5) += p.tt0.z;
  a(4, 4) += p.tt1.x, a(4, 5) += p.tt1.y, a(5, 5) += p.tt1.z;
  b += (Vector6d() << p.br.x, p.br.y, p.br.z, p.bt.x, p.bt.y, p.bt.z).finished();
}

void symmetrise(Matrix6d& a) { a.triangularView<Eigen::StrictlyLower>() = a.transpose(); }

/// The geometric term, or what of it pairs live normals with the model's.
struct Geometry {
  Matrix6d a = Matrix6d::Zero();
  Vector6d b = Vector6d::Zero();
  double squared = 0, inliers = 0, seen = 0, live = 0;
};
Geometry sum_of(const std::vector<shader::IcpSums>& parts) {
  Geometry sum;
  for (const auto& p : parts) {
    add(p.normal, sum.a, sum.b);
    sum.squared += p.squared, sum.inliers += p.inliers, sum.seen += p.seen, sum.live += p.live;
  }
  symmetrise(sum.a);
  return sum;
}

struct Photometry {
  Matrix6d a = Matrix6d::Zero();  // in the keyframe's frame
  Vector6d b = Vector6d::Zero();
  double squared = 0, seen = 0, fitting = 0, weight = 0, live = 0, key = 0, live_live = 0, live_key = 0;
};
Photometry sum_of(const std::vector<shader::PhotometricSums>& parts) {
  Photometry sum;
  for (const auto& p : parts) {
    add(p.normal, sum.a, sum.b);
    sum.squared += p.squared, sum.seen += p.seen, sum.fitting += p.fitting;
    sum.weight += p.weight, sum.live += p.live, sum.key += p.key;
    sum.live_live += p.live_live, sum.live_key += p.live_key;
  }
  symmetrise(sum.a);
  return sum;
}

/// Directions of the pose, rotations measured by what they move at the scene's distance.
struct Directions {
  explicit Directions(const Matrix6d& a) {
    const double lever =
        std::sqrt(a.topLeftCorner<3, 3>().trace() / std::max(a.bottomRightCorner<3, 3>().trace(), 1e-12));
    scale << Eigen::Vector3d::Constant(1 / std::max(lever, 1e-3)), Eigen::Vector3d::Ones();
    const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(scale.asDiagonal() * a * scale.asDiagonal());
    values = solver.eigenvalues().cwiseMax(0.0);
    vectors = solver.eigenvectors();
  }
  Vector6d scale, values;
  Matrix6d vectors;
};

/// What of the pose the geometry observes: a projection of its equations that takes out the directions that it does
/// not. Noise of the normals would hold them where they are (Zhang, Kaess & Singh 2016, sec. III, on the matrix that
/// pairs live normals with the model's: noise is in the one or in the other, structure in both).
struct Observed {
  Matrix6d projection = Matrix6d::Identity();
  int weak = 0;
};
Observed observed_by_geometry(const Matrix6d& crossed) {
  const Directions d(crossed);
  const double total = d.values.sum();
  Matrix6d keep = Matrix6d::Zero();
  Observed observed;
  for (int i = 0; i < 6; ++i) {
    if (d.values[i] < kWeakGeometry * total)
      ++observed.weak;
    else
      keep += d.vectors.col(i) * d.vectors.col(i).transpose();
  }
  if (observed.weak > 0) observed.projection = d.scale.cwiseInverse().asDiagonal() * keep * d.scale.asDiagonal();
  return observed;
}

/// Solves a x = b; x has no part along directions that `a` does not observe.
std::optional<Vector6d> solve(const Matrix6d& a, const Vector6d& b, int& unobserved) {
  const Directions d(a);
  const double strongest = d.values.maxCoeff();
  if (!(strongest > 0) || !std::isfinite(strongest)) return std::nullopt;
  const Vector6d rhs = d.vectors.transpose() * d.scale.asDiagonal() * b;
  Vector6d y = Vector6d::Zero();
  unobserved = 0;
  for (int i = 0; i < 6; ++i) {
    if (d.values[i] > kUnobserved * strongest)
      y[i] = rhs[i] / d.values[i];
    else
      ++unobserved;
  }
  const Vector6d x = d.scale.asDiagonal() * d.vectors * y;
  if (!x.allFinite()) return std::nullopt;
  return x;
}

/// Gain and bias by weighted linear regression of the keyframe's brightness on the live one's.
void fit_exposure(const Photometry& p, double& gain, double& bias) {
  const double mean_live = p.live / p.weight, mean_key = p.key / p.weight;
  const double spread = p.live_live / p.weight - mean_live * mean_live;
  const double together = p.live_key / p.weight - mean_live * mean_key;
  gain = spread > 1e-4 ? std::clamp(together / spread, 0.3, 3.0) : 1.0;
  bias = mean_key - gain * mean_live;
}

/// Why an alignment is not to be trusted, if it is not.
FrameCause distrust(const Alignment& alignment, double live, const Camera& finest, const TrackOptions& options) {
  if (live < 0.02 * finest.width * finest.height) return FrameCause::little_depth;
  if (alignment.fit.overlap < 0.05) return FrameCause::out_of_view;
  if (alignment.fit.inlier_share < options.min_inlier_share) return FrameCause::too_few_inliers;
  if (alignment.fit.rmse > options.max_rmse) return FrameCause::large_residuals;
  return FrameCause::none;
}

}  // namespace

/// How the image is cut: a workgroup a tile.
struct Aligner::Tiling {
  explicit Tiling(const Camera& camera, std::uint32_t pixel_stride = 1) : stride(pixel_stride) {
    const auto in_steps = [&](int pixels, std::uint32_t parts) {
      const std::uint32_t step = 8 * stride;
      return step * ((static_cast<std::uint32_t>(pixels) + step * parts - 1) / (step * parts));
    };
    size = {in_steps(camera.width, kTilesAcross), in_steps(camera.height, kTilesDown)};
    const auto groups_along = [](int pixels, std::uint32_t tile) {
      return (static_cast<std::uint32_t>(pixels) + tile - 1) / tile;
    };
    groups = groups_along(camera.width, size.x) * groups_along(camera.height, size.y);
  }
  [[nodiscard]] std::uint32_t threads() const { return groups * kWorkgroup; }
  shader::uvec2 size;
  std::uint32_t stride;  // pixels between those that are looked at
  std::uint32_t groups;
};

/// What is aligned with what.
struct Aligner::Views {
  const Surface& live;
  const SurfacePrediction& model;
  const PhotometricKeyframe* keyframe;  // null: geometry alone
  const ColourMoment& moment;
  Reach reach;
  Matrix6d keyframe_motion;  // a motion in the model's frame as one in the keyframe's
};

struct Aligner::Brightness {
  double gain = 1, bias = 0, sigma = 0.05;
};

/// What is known of the pose so far.
struct Aligner::Estimate {
  Eigen::Isometry3d model_from_live;
  Brightness brightness;
  // Of the last iteration:
  Geometry geometry, crossed;  // crossed: where it was asked for
  Photometry photometry;
  Matrix6d information = Matrix6d::Zero();
  int degenerate_directions = 0, unobserved = 0;
  bool uses_brightness = false;
  // Directions of the pose that geometry may move:
  enum { undecided, without_weak, with_all } directions = undecided;
  Observed observed;
  int iterations = 0;
  std::uint32_t stride = 1;  // between the pixels that are looked at
};

PhotometricKeyframe::PhotometricKeyframe(gpu::Device& device, const Camera& camera, const TrackOptions& options)
    : device_(device) {
  for (int level = 0; level < options.levels; ++level) {
    const Camera c = camera.at_level(level);
    const std::uint64_t pixels = std::uint64_t{8} * static_cast<std::uint64_t>(c.width * c.height);
    packed_.emplace_back(device, level >= options.finest_level ? pixels : 8);
  }
}

void PhotometricKeyframe::set(const Surface& surface, const Eigen::Isometry3d& submap_from_camera,
                              const ColourMoment& moment) {
  gpu::Batch batch(device_);
  for (std::size_t level = 0; level < std::min(surface.packed.size(), packed_.size()); ++level)
    if (surface.packed[level] != nullptr) batch.copy(*surface.packed[level], packed_[level]);
  batch.run();
  submap_from_camera_ = submap_from_camera;
  moment_ = moment;
  is_set_ = true;
}

PhotometricKeyframe::Saved PhotometricKeyframe::save() const {
  Saved saved{.submap_from_camera = submap_from_camera_, .moment = moment_, .levels = {}};
  if (!is_set_) return saved;
  gpu::Batch batch(device_);
  saved.levels.resize(packed_.size());
  for (std::size_t i = 0; i < packed_.size(); ++i) {
    saved.levels[i].resize(packed_[i].size() / 4);
    if (packed_[i]) batch.download(packed_[i], saved.levels[i]);
  }
  batch.run();
  return saved;
}

void PhotometricKeyframe::restore(const Saved& saved) {
  submap_from_camera_ = saved.submap_from_camera;
  moment_ = saved.moment;
  // One that was saved with other levels is done without, until the next.
  is_set_ = saved.levels.size() == packed_.size();
  for (std::size_t i = 0; is_set_ && i < packed_.size(); ++i)
    is_set_ = !packed_[i] || saved.levels[i].size() * 4 == packed_[i].size();
  if (!is_set_) return;
  gpu::Batch batch(device_);
  for (std::size_t i = 0; i < packed_.size(); ++i)
    if (packed_[i]) batch.upload(packed_[i], saved.levels[i]);
  batch.run();
}

Eigen::Isometry3d PhotometricKeyframe::submap_from_colour(double clock_offset) const {
  return submap_from_camera_ * retract(moment_.velocity * (moment_.stamp_delay - clock_offset));
}

Aligner::Aligner(gpu::Device& device, const TrackOptions& options, const SensorModel& sensor)
    : device_(device),
      options_(options),
      geometry_parts_(std::max(1u, kWorkgroup / std::max(1u, device.info().subgroup_size))),
      photometric_parts_(geometry_parts_),
      geometry_sums_(device, kMaxSums * sizeof(shader::IcpSums)),
      crossed_sums_(device, kMaxSums * sizeof(shader::IcpSums)),
      photometric_sums_(device, kMaxSums * sizeof(shader::PhotometricSums)),
      icp_(device, "icp_reduce", icp_reduce_comp, shader::constants_of(sensor)),
      photometric_(device, "photometric_reduce", photometric_reduce_comp) {}

shader::PhotometricReducePush Aligner::photometric_push(const Camera& camera, const PhotometricKeyframe& keyframe,
                                                        const Eigen::Isometry3d& submap_from_live,
                                                        const ColourMoment& moment, const Brightness& brightness,
                                                        const Tiling& tiling) const {
  const Vector6d colour_motion = -moment.velocity * moment.delay();
  return {.camera = shader::pinhole(camera),
          .keyframe_from_live =
              shader::rigid(keyframe.submap_from_colour(moment.clock_offset).inverse() * submap_from_live),
          .rotation = Eigen::Vector3f(colour_motion.head<3>().cast<float>()),
          .translation = Eigen::Vector3f(colour_motion.tail<3>().cast<float>()),
          .tile = tiling.size,
          .stride = tiling.stride,
          .gain = static_cast<float>(brightness.gain),
          .bias = static_cast<float>(brightness.bias),
          .inverse_sigma = static_cast<float>(1 / brightness.sigma)};
}

std::vector<double> Aligner::clock_offset_costs(const Surface& live, const PhotometricKeyframe& keyframe,
                                                const Eigen::Isometry3d& submap_from_live, const ColourMoment& moment,
                                                const Brightness& brightness) {
  const int level = options_.levels - 1;
  const auto l = static_cast<std::size_t>(level);
  const Camera& camera = live.levels[l]->camera;
  const Tiling tiling(camera);
  const std::size_t count = tiling.groups * photometric_parts_;
  std::vector<std::vector<shader::PhotometricSums>> sums(kClockOffsets.size(),
                                                         std::vector<shader::PhotometricSums>(count));
  gpu::Batch batch(device_);
  for (std::size_t k = 0; k < kClockOffsets.size(); ++k) {
    ColourMoment candidate = moment;
    candidate.clock_offset = kClockOffsets[k];
    photometric_(batch, {tiling.threads(), 1, 1},
                 photometric_push(camera, keyframe, submap_from_live, candidate, brightness, tiling),
                 {&live.levels[l]->points, live.packed[l], &keyframe.level(level), &photometric_sums_});
    batch.download(photometric_sums_, sums[k]);
  }
  batch.run();
  std::vector<double> costs;
  for (const auto& candidate : sums) {
    double squared = 0, seen = 0;
    for (const auto& p : candidate) squared += p.squared, seen += p.seen;
    costs.push_back(seen > 0 ? squared / (seen * brightness.sigma * brightness.sigma) : 6.0);
  }
  return costs;
}

int Aligner::coarsest(Reach reach) const { return reach == Reach::wide ? options_.levels - 1 : options_.finest_level; }

Alignment Aligner::align(const Surface& live, const SurfacePrediction& model, const Eigen::Isometry3d& guess,
                         const PhotometricKeyframe* keyframe, const ColourMoment& moment, Reach reach) {
  const bool has_brightness = options_.photometric && keyframe != nullptr && keyframe->is_set() && !live.packed.empty();
  Views views{live, model, has_brightness ? keyframe : nullptr, moment, reach, Matrix6d::Zero()};
  if (has_brightness)
    views.keyframe_motion =
        adjoint(keyframe->submap_from_colour(moment.clock_offset).inverse() * model.submap_from_camera);
  const Eigen::Isometry3d start = model.submap_from_camera.inverse() * guess;
  Estimate estimate{.model_from_live = start};
  while (!descend(views, estimate)) {
    // The coarse levels have slid along what they did not observe, or were wrong to leave it: once more.
    estimate.model_from_live = start;
    estimate.brightness = {};
  }
  return judge(views, estimate);
}

/// Iterates from the coarsest level to the finest. False when, close enough for normals to pair up, the directions that
/// geometry may move turn out to be others than the coarse levels took.
bool Aligner::descend(const Views& views, Estimate& estimate) {
  const bool has_coarser = coarsest(views.reach) > options_.finest_level;
  for (int level = coarsest(views.reach); level >= options_.finest_level; --level) {
    const bool is_finest = level == options_.finest_level;
    const int most = is_finest ? options_.iterations_finest : options_.iterations_coarse;
    bool is_near = !is_finest || !has_coarser;  // from there on all pixels are looked at
    for (int i = 0; i < most; ++i) {
      const bool looks_for_weak = estimate.directions != Estimate::with_all && is_finest && i == 0;
      estimate.stride = is_near || looks_for_weak ? 1 : kSparse;
      linearise(views, level, looks_for_weak, estimate);
      ++estimate.iterations;
      if (looks_for_weak && !find_degenerate_directions(views.keyframe != nullptr && has_coarser, estimate))
        return false;
      const bool goes_on = step(views, level, estimate);
      if (is_near && !goes_on) break;
      is_near |= !goes_on || i + 2 >= most;
    }
  }
  return true;
}

/// The normal equations of both terms at the estimate, and `crossed`, the geometry's by pairs of normals.
void Aligner::linearise(const Views& views, int level, bool crossed, Estimate& estimate) {
  const auto l = static_cast<std::size_t>(level);
  const VertexNormalMap& live = *views.live.levels[l];
  const Tiling tiling(live.camera, estimate.stride);
  shader::IcpReducePush push{.camera = shader::pinhole(live.camera),
                             .model_from_live = shader::rigid(estimate.model_from_live),
                             .tile = tiling.size,
                             .stride = tiling.stride,
                             .max_distance = options_.max_distance * static_cast<float>(1 << level),
                             .min_cosine = std::cos(options_.max_angle),
                             .huber = options_.huber,
                             .cut = views.reach == Reach::wide ? 0.0f : kCut,
                             .crossed = 0};
  const auto reduce_geometry = [&](gpu::Batch& batch, const gpu::Buffer& sums, std::vector<shader::IcpSums>& to) {
    to.resize(tiling.groups * geometry_parts_);
    icp_(batch, {tiling.threads(), 1, 1}, push, {&live.points, &views.model.levels[l]->points, &sums});
    batch.download(sums, to);
  };
  for (bool as_told = false; !as_told;) {
    gpu::Batch batch(device_);
    push.crossed = 0;
    reduce_geometry(batch, geometry_sums_, geometry_read_);
    push.crossed = 1;
    if (crossed) reduce_geometry(batch, crossed_sums_, crossed_read_);
    photometric_read_.resize(views.keyframe != nullptr ? tiling.groups * photometric_parts_ : 0);
    if (views.keyframe != nullptr) {
      photometric_(
          batch, {tiling.threads(), 1, 1},
          photometric_push(live.camera, *views.keyframe, views.model.submap_from_camera * estimate.model_from_live,
                           views.moment, estimate.brightness, tiling),
          {&live.points, views.live.packed[l], &views.keyframe->level(level), &photometric_sums_});
      batch.download(photometric_sums_, photometric_read_);
    }
    batch.run();
    // A device may run the shaders with another subgroup size than it told: once more, with all sums.
    const std::uint32_t geometry_parts = geometry_read_[0].parts;
    const std::uint32_t photometric_parts = views.keyframe != nullptr ? photometric_read_[0].parts : photometric_parts_;
    as_told = geometry_parts == geometry_parts_ && photometric_parts == photometric_parts_;
    geometry_parts_ = geometry_parts, photometric_parts_ = photometric_parts;
  }
  estimate.geometry = sum_of(geometry_read_);
  if (crossed) estimate.crossed = sum_of(crossed_read_);
  estimate.photometry = sum_of(photometric_read_);
}

/// False when the coarse levels have to be done again with other directions, which is possible where `can_repeat`.
bool Aligner::find_degenerate_directions(bool can_repeat, Estimate& e) {
  // Normals of surfaces that do not lie on each other yet say nothing about noise. Those of a young map disagree even
  // then; brightness that fits to its noise without the weak directions tells that they lie.
  const bool agree = e.geometry.inliers > kAgreeing * e.geometry.seen;
  const bool close = e.crossed.inliers > kAgreeing * e.geometry.seen;
  const bool proved = e.directions == Estimate::without_weak && e.brightness.sigma < kBrightnessNoise;
  const bool trial = e.directions == Estimate::undecided && can_repeat;
  e.observed = agree || (close && (proved || trial)) ? observed_by_geometry(e.crossed.a) : Observed{};
  if (!can_repeat) return true;
  if (e.directions == Estimate::undecided ? e.observed.weak == 0 : agree || proved) return true;
  e.directions = e.directions == Estimate::undecided ? Estimate::without_weak : Estimate::with_all;
  return false;
}

/// One step of Gauss-Newton, each term in units of the scale of its own residuals. False: the level is done.
bool Aligner::step(const Views& views, int level, Estimate& e) const {
  Matrix6d a = e.geometry.a;
  Vector6d b = e.geometry.b;
  e.degenerate_directions = e.geometry.inliers >= 6 ? e.observed.weak : 6;
  if (e.geometry.inliers >= 6) {
    a = e.observed.projection * a * e.observed.projection.transpose();
    b = e.observed.projection * b;
    const double variance = std::max(e.geometry.squared / e.geometry.inliers, kMinDepthSigma * kMinDepthSigma);
    a /= variance, b /= variance;
  } else {
    a.setZero(), b.setZero();
  }
  const Camera& camera = views.live.levels[static_cast<std::size_t>(level)]->camera;
  e.uses_brightness = e.photometry.seen * e.stride * e.stride > kMinPhotometricShare * camera.width * camera.height;
  if (e.uses_brightness) {
    // Kerl, Sturm & Cremers 2013, eq. 15: one step of the fixed point an iteration.
    e.brightness.sigma = std::max(std::sqrt(e.photometry.squared / e.photometry.seen), kMinBrightnessSigma);
    const double all = e.brightness.sigma * e.brightness.sigma;
    const double noise = std::min(all, kBrightnessNoise * kBrightnessNoise);
    const double variance = kNoiseTogether * noise + kSystematicTogether * (all - noise);
    a += views.keyframe_motion.transpose() * e.photometry.a * views.keyframe_motion / variance;
    b += views.keyframe_motion.transpose() * e.photometry.b / variance;
    fit_exposure(e.photometry, e.brightness.gain, e.brightness.bias);
  }
  e.information = a;
  const std::optional<Vector6d> x = solve(a, b, e.unobserved);
  if (!x) return false;
  e.model_from_live = retract(*x) * e.model_from_live;
  const bool is_last = level == options_.finest_level && e.stride == 1;
  return x->norm() >= (is_last ? kConverged : kConvergedCoarse * (1 << level));
}

/// The pose, how well the images fit at it, and whether it is to be trusted.
Alignment Aligner::judge(const Views& views, const Estimate& e) {
  Alignment result{
      .submap_from_camera = views.model.submap_from_camera * e.model_from_live,
      .information = e.information,
      .fit = {
          .degenerate_directions = e.degenerate_directions, .unobserved = e.unobserved, .iterations = e.iterations}};
  // Products of rotations drift away from orthonormal ones.
  result.submap_from_camera.linear() =
      Eigen::Quaterniond(result.submap_from_camera.linear()).normalized().toRotationMatrix();
  const Geometry& g = e.geometry;
  result.fit.inlier_share = g.seen > 0 ? g.inliers / g.seen : 0.0;
  result.fit.overlap = g.live > 0 ? g.seen / g.live : 0.0;
  result.fit.rmse = g.inliers > 0 ? std::sqrt(g.squared / g.inliers) : 0.0;
  if (e.uses_brightness) {
    result.fit.photometric_share = e.photometry.fitting / e.photometry.seen;
    result.fit.photometric_rmse = e.brightness.sigma;
    result.gain = e.brightness.gain, result.bias = e.brightness.bias;
    if (views.moment.velocity.head<3>().norm() > kTurning)
      result.clock_offset_costs =
          clock_offset_costs(views.live, *views.keyframe, result.submap_from_camera, views.moment, e.brightness);
  }
  const Camera& finest = views.live.levels[static_cast<std::size_t>(options_.finest_level)]->camera;
  result.lost = distrust(result, g.live, finest, options_);
  return result;
}

}  // namespace cairn
