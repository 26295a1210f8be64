// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "track/align.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "spirv/icp_reduce.comp.h"
#include "spirv/photometric_reduce.comp.h"

namespace cairn {
namespace {

constexpr std::uint32_t kWorkgroup = 64;
constexpr std::uint32_t kTilesAcross = 4, kTilesDown = 8;
constexpr std::uint32_t kMaxGroups = kTilesAcross * kTilesDown;
constexpr std::uint32_t kMaxSums = kMaxGroups * kWorkgroup;  // a subgroup has at least one thread
constexpr double kConverged = 1e-4;        // radians and metres: some hundredths of a pixel, a hundredth of a voxel
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

/// How the image is cut: a workgroup a tile.
struct Tiling {
  explicit Tiling(const Camera& camera) {
    const auto in_eights = [](int pixels, std::uint32_t parts) {
      return 8 * ((static_cast<std::uint32_t>(pixels) + 8 * parts - 1) / (8 * parts));
    };
    size = {in_eights(camera.width, kTilesAcross), in_eights(camera.height, kTilesDown)};
    const auto groups_along = [](int pixels, std::uint32_t tile) {
      return (static_cast<std::uint32_t>(pixels) + tile - 1) / tile;
    };
    groups = groups_along(camera.width, size.x) * groups_along(camera.height, size.y);
  }
  [[nodiscard]] std::uint32_t threads() const { return groups * kWorkgroup; }
  shader::uvec2 size;
  std::uint32_t groups;
};

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

}  // namespace

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

Aligner::Aligner(gpu::Device& device, const TrackOptions& options)
    : device_(device),
      options_(options),
      geometry_parts_(std::max(1u, kWorkgroup / std::max(1u, device.info().subgroup_size))),
      photometric_parts_(geometry_parts_),
      geometry_sums_(device, kMaxSums * sizeof(shader::IcpSums)),
      crossed_sums_(device, kMaxSums * sizeof(shader::IcpSums)),
      photometric_sums_(device, kMaxSums * sizeof(shader::PhotometricSums)),
      icp_(device, "icp_reduce", icp_reduce_comp),
      photometric_(device, "photometric_reduce", photometric_reduce_comp) {}

shader::PhotometricReducePush Aligner::photometric_push(const Camera& camera, const PhotometricKeyframe& keyframe,
                                                        const Eigen::Isometry3d& submap_from_live,
                                                        const ColourMoment& moment,
                                                        const Brightness& brightness) const {
  const Vector6d colour_motion = -moment.velocity * moment.delay();
  return {.camera = shader::pinhole(camera),
          .keyframe_from_live =
              shader::rigid(keyframe.submap_from_colour(moment.clock_offset).inverse() * submap_from_live),
          .rotation = Eigen::Vector3f(colour_motion.head<3>().cast<float>()),
          .translation = Eigen::Vector3f(colour_motion.tail<3>().cast<float>()),
          .tile = Tiling(camera).size,
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
                 photometric_push(camera, keyframe, submap_from_live, candidate, brightness),
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

Alignment Aligner::align(const Surface& live, const SurfacePrediction& model, const Eigen::Isometry3d& guess,
                         const PhotometricKeyframe* keyframe, const ColourMoment& moment, Reach reach) {
  Alignment result;
  const bool has_brightness = options_.photometric && keyframe != nullptr && keyframe->is_set() && !live.packed.empty();
  const Eigen::Isometry3d start = model.submap_from_camera.inverse() * guess;
  Eigen::Isometry3d model_from_live = start;
  const Eigen::Isometry3d keyframe_from_model =
      has_brightness ? keyframe->submap_from_colour(moment.clock_offset).inverse() * model.submap_from_camera
                     : model_from_live;
  const Matrix6d keyframe_motion = adjoint(keyframe_from_model);
  Brightness brightness;
  Geometry geometry;
  Photometry photometry;
  Observed observed;
  enum { undecided, without_weak, with_all } directions = undecided;  // of the geometry
  bool uses_brightness = false;

  const int coarsest = reach == Reach::wide ? options_.levels - 1 : options_.finest_level;
  for (int level = coarsest; level >= options_.finest_level; --level) {
    const auto l = static_cast<std::size_t>(level);
    const Camera& camera = live.levels[l]->camera;
    const Tiling tiling(camera);
    std::vector<shader::IcpSums> geometry_sums(tiling.groups * geometry_parts_);
    std::vector<shader::IcpSums> crossed_sums(geometry_sums.size());
    std::vector<shader::PhotometricSums> photometric_sums(has_brightness ? tiling.groups * photometric_parts_ : 0);
    const int most = level == options_.finest_level ? options_.iterations_finest : options_.iterations_coarse;
    for (int i = 0; i < most; ++i) {
      gpu::Batch batch(device_);
      shader::IcpReducePush push{.camera = shader::pinhole(camera),
                                 .model_from_live = shader::rigid(model_from_live),
                                 .tile = tiling.size,
                                 .max_distance = options_.max_distance * static_cast<float>(1 << level),
                                 .min_cosine = std::cos(options_.max_angle),
                                 .huber = options_.huber,
                                 .cut = reach == Reach::wide ? 0.0f : kCut,
                                 .crossed = 0};
      icp_(batch, {tiling.threads(), 1, 1}, push, {&live.levels[l]->points, &model.levels[l]->points, &geometry_sums_});
      batch.download(geometry_sums_, geometry_sums);
      const bool looks_for_weak =
          directions != with_all && level == options_.finest_level && i == 0;  // close enough for normals to pair up
      if (looks_for_weak) {
        push.crossed = 1;
        icp_(batch, {tiling.threads(), 1, 1}, push,
             {&live.levels[l]->points, &model.levels[l]->points, &crossed_sums_});
        batch.download(crossed_sums_, crossed_sums);
      }
      if (has_brightness) {
        photometric_(
            batch, {tiling.threads(), 1, 1},
            photometric_push(camera, *keyframe, model.submap_from_camera * model_from_live, moment, brightness),
            {&live.levels[l]->points, live.packed[l], &keyframe->level(level), &photometric_sums_});
        batch.download(photometric_sums_, photometric_sums);
      }
      batch.run();
      const bool as_told = geometry_sums[0].parts == geometry_parts_ &&
                           (!has_brightness || photometric_sums[0].parts == photometric_parts_);
      if (!as_told) {  // the device runs the shaders with another subgroup size than it told: once more, with all sums
        geometry_parts_ = geometry_sums[0].parts;
        geometry_sums.resize(tiling.groups * geometry_parts_), crossed_sums.resize(geometry_sums.size());
        if (has_brightness) {
          photometric_parts_ = photometric_sums[0].parts;
          photometric_sums.resize(tiling.groups * photometric_parts_);
        }
        --i;
        continue;
      }
      ++result.iterations;

      geometry = {};
      for (const auto& p : geometry_sums) {
        add(p.normal, geometry.a, geometry.b);
        geometry.squared += p.squared, geometry.inliers += p.inliers, geometry.seen += p.seen, geometry.live += p.live;
      }
      symmetrise(geometry.a);
      if (looks_for_weak) {
        Matrix6d crossed = Matrix6d::Zero();
        Vector6d unused = Vector6d::Zero();
        double near = 0;
        for (const auto& p : crossed_sums) add(p.normal, crossed, unused), near += p.inliers;
        symmetrise(crossed);
        // Normals of surfaces that do not lie on each other yet say nothing about noise. Those of a young map disagree
        // even then; brightness that fits to its noise without the weak directions tells that they lie.
        const bool agree = geometry.inliers > kAgreeing * geometry.seen, close = near > kAgreeing * geometry.seen;
        const bool can_repeat = has_brightness && level < coarsest;
        const bool proved = directions == without_weak && brightness.sigma < kBrightnessNoise;
        const bool trial = directions == undecided && can_repeat;
        observed = agree || (close && (proved || trial)) ? observed_by_geometry(crossed) : Observed{};
        // The coarse levels have slid along what they did not observe, or were wrong to leave it: once more.
        const bool repeat = can_repeat && (directions == undecided ? observed.weak > 0 : !agree && !proved);
        if (repeat) {
          directions = directions == undecided ? without_weak : with_all;
          model_from_live = start;
          brightness = {};
          level = coarsest + 1;
          break;
        }
      }
      photometry = {};
      for (const auto& p : photometric_sums) {
        add(p.normal, photometry.a, photometry.b);
        photometry.squared += p.squared, photometry.seen += p.seen, photometry.fitting += p.fitting;
        photometry.weight += p.weight, photometry.live += p.live, photometry.key += p.key;
        photometry.live_live += p.live_live, photometry.live_key += p.live_key;
      }
      symmetrise(photometry.a);

      // Each term in units of the scale of its own residuals.
      Matrix6d a = geometry.a;
      Vector6d b = geometry.b;
      result.degenerate_directions = geometry.inliers >= 6 ? observed.weak : 6;
      if (geometry.inliers >= 6) {
        a = observed.projection * a * observed.projection.transpose();
        b = observed.projection * b;
        const double variance = std::max(geometry.squared / geometry.inliers, kMinDepthSigma * kMinDepthSigma);
        a /= variance, b /= variance;
      } else {
        a.setZero(), b.setZero();
      }
      uses_brightness = photometry.seen > kMinPhotometricShare * camera.width * camera.height;
      if (uses_brightness) {
        // Kerl, Sturm & Cremers 2013, eq. 15: one step of the fixed point an iteration.
        brightness.sigma = std::max(std::sqrt(photometry.squared / photometry.seen), kMinBrightnessSigma);
        const double all = brightness.sigma * brightness.sigma;
        const double noise = std::min(all, kBrightnessNoise * kBrightnessNoise);
        const double variance = kNoiseTogether * noise + kSystematicTogether * (all - noise);
        a += keyframe_motion.transpose() * photometry.a * keyframe_motion / variance;
        b += keyframe_motion.transpose() * photometry.b / variance;
        // Gain and bias by weighted linear regression of the keyframe's brightness on the live one's.
        const double w = photometry.weight, mean_live = photometry.live / w, mean_key = photometry.key / w;
        const double spread = photometry.live_live / w - mean_live * mean_live;
        const double together = photometry.live_key / w - mean_live * mean_key;
        brightness.gain = spread > 1e-4 ? std::clamp(together / spread, 0.3, 3.0) : 1.0;
        brightness.bias = mean_key - brightness.gain * mean_live;
      }
      result.information = a;
      const std::optional<Vector6d> x = solve(a, b, result.unobserved);
      if (!x) break;
      model_from_live = retract(*x) * model_from_live;
      if (x->norm() < (level == options_.finest_level ? kConverged : kConvergedCoarse * (1 << level))) break;
    }
  }

  result.submap_from_camera = model.submap_from_camera * model_from_live;
  // Products of rotations drift away from orthonormal ones.
  result.submap_from_camera.linear() =
      Eigen::Quaterniond(result.submap_from_camera.linear()).normalized().toRotationMatrix();
  result.inlier_share = geometry.seen > 0 ? geometry.inliers / geometry.seen : 0.0;
  result.overlap = geometry.live > 0 ? geometry.seen / geometry.live : 0.0;
  result.rmse = geometry.inliers > 0 ? std::sqrt(geometry.squared / geometry.inliers) : 0.0;
  if (uses_brightness) {
    result.photometric_share = photometry.fitting / photometry.seen;
    result.photometric_rmse = brightness.sigma;
    result.gain = brightness.gain, result.bias = brightness.bias;
    if (moment.velocity.head<3>().norm() > kTurning)
      result.clock_offset_costs = clock_offset_costs(live, *keyframe, result.submap_from_camera, moment, brightness);
  }

  const Camera& finest = live.levels[static_cast<std::size_t>(options_.finest_level)]->camera;
  if (geometry.live < 0.02 * finest.width * finest.height)
    result.lost = "too little depth";
  else if (result.overlap < 0.05)
    result.lost = "the map is out of view";
  else if (result.inlier_share < options_.min_inlier_share)
    result.lost = "too few points fit the map";
  else if (result.rmse > options_.max_rmse)
    result.lost = "points fit the map badly";
  return result;
}

}  // namespace cairn
