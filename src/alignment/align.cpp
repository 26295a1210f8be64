// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "alignment/align.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "shaders/noise.h"
#include "spirv/icp_reduce.comp.h"
#include "spirv/photometric_reduce.comp.h"
#include "spirv/pose_step.comp.h"

namespace cairn {
namespace {

/// Specialization constants of the reduction kernels.
std::vector<float> constants_of(const SensorModel& sensor, bool is_rolling) {
  const auto numbers = shader::constants_of(sensor);
  std::vector<float> all(numbers.begin(), numbers.end());
  all.push_back(std::bit_cast<float>(is_rolling ? 1u : 0u));
  return all;
}

constexpr double kConverged = 1e-4;        // rad and m: some hundredths of a pixel, a hundredth of a voxel
constexpr double kConvergedCoarse = 4e-4;  // at level 0; doubled at each coarser level
constexpr float kCutoffSigmas = 4.0f;      // standard deviations of the depth noise
constexpr float kInitialSigma = 0.05f;     // of brightness, initial value
constexpr double kMinRotationRate = 0.3;   // rad/s: min. rotation rate to estimate the clock offset
constexpr double kNoOverlapCost = 6.0;     // cost of a clock offset without overlap of the images

Matrix6d matrix_of(const shader::NormalEquations& p) {
  Matrix6d a;
  a << p.rr0.x, p.rr0.y, p.rr0.z, p.rt0.x, p.rt0.y, p.rt0.z,  //
      0, p.rr1.x, p.rr1.y, p.rt1.x, p.rt1.y, p.rt1.z,         //
      0, 0, p.rr1.z, p.rt2.x, p.rt2.y, p.rt2.z,               //
      0, 0, 0, p.tt0.x, p.tt0.y, p.tt0.z,                     //
      0, 0, 0, 0, p.tt1.x, p.tt1.y,                           //
      0, 0, 0, 0, 0, p.tt1.z;
  a.triangularView<Eigen::StrictlyLower>() = a.transpose();
  return a;
}

Eigen::Isometry3d isometry(const shader::Rigid& r) {
  Eigen::Matrix3f turn;
  turn << Eigen::Vector3f(r.x), Eigen::Vector3f(r.y), Eigen::Vector3f(r.z);
  Eigen::Isometry3d t(Eigen::Quaterniond(turn.cast<double>()).normalized());
  t.translation() = Eigen::Vector3f(r.t).cast<double>();
  return t;
}

shader::Groups groups(std::uint32_t count) { return {count, 1, 1}; }

/// Reason why an alignment is unreliable, or none.
FrameCause failure_cause(const Alignment& alignment, double live, const Camera& finest, const TrackOptions& options) {
  if (live < 0.02 * finest.width * finest.height) return FrameCause::little_depth;
  if (alignment.fit.overlap < 0.05) return FrameCause::out_of_view;
  if (alignment.fit.inlier_share < options.min_inlier_share) return FrameCause::too_few_inliers;
  if (alignment.fit.rmse > options.max_rmse) return FrameCause::large_residuals;
  return FrameCause::none;
}

}  // namespace

/// Tiling of the image, one workgroup per tile. The finest level has the same tiling when pixels are subsampled.
struct Aligner::Tiling {
  Tiling(const Camera& camera, bool is_finest, bool for_cpu) {
    const std::uint32_t block = is_finest ? 8 * shader::kSparse : 8, across = for_cpu ? 4 : 8, down = for_cpu ? 8 : 16;
    const auto in_blocks = [&](int pixels, std::uint32_t parts) {
      return block * ((static_cast<std::uint32_t>(pixels) + block * parts - 1) / (block * parts));
    };
    size = {in_blocks(camera.width, across), in_blocks(camera.height, down)};
    const auto groups_along = [](int pixels, std::uint32_t tile) {
      return (static_cast<std::uint32_t>(pixels) + tile - 1) / tile;
    };
    groups = groups_along(camera.width, size.x) * groups_along(camera.height, size.y);
  }
  static constexpr std::uint32_t kMaxTiles = 8 * 16;
  shader::uvec2 size;
  std::uint32_t groups;
};

/// Inputs of an alignment.
struct Aligner::Views {
  const FramePyramid& live;
  const SurfacePrediction& model;
  const PhotometricKeyframe* keyframe;  // null: geometry alone
  const ColorMoment& moment;
  AlignmentRange range;
  const ShutterCorrection& correction;

  [[nodiscard]] const Camera& camera(int level) const { return live.levels[static_cast<std::size_t>(level)]->camera; }
  /// For a color camera's clock ahead by `clock_offset`.
  [[nodiscard]] shader::Rigid keyframe_from_model(double clock_offset) const {
    return shader::rigid(keyframe->submap_from_color(clock_offset).inverse() * model.submap_from_camera);
  }
  [[nodiscard]] bool estimates_clock_offset() const {
    return keyframe != nullptr && moment.velocity.head<3>().norm() > kMinRotationRate;
  }
};

PhotometricKeyframe::PhotometricKeyframe(gpu::Device& device, const Camera& camera, const TrackOptions& options)
    : device_(device) {
  for (int level = 0; level < options.levels; ++level) {
    const Camera c = camera.at_level(level);
    const std::uint64_t pixels = std::uint64_t{8} * static_cast<std::uint64_t>(c.width * c.height);
    packed_.emplace_back(device, level >= options.finest_level ? pixels : 8);
  }
}

void PhotometricKeyframe::set(const FramePyramid& surface, const Eigen::Isometry3d& submap_from_camera,
                              const ColorMoment& moment) {
  gpu::Batch batch(device_);
  for (std::size_t level = 0; level < std::min(surface.packed.size(), packed_.size()); ++level)
    if (surface.packed[level] != nullptr) batch.copy(*surface.packed[level], packed_[level]);
  batch.submit();
  submap_from_camera_ = submap_from_camera;
  moment_ = moment;
  is_set_ = true;
}

PhotometricKeyframe::SavedState PhotometricKeyframe::save() const {
  SavedState saved{.submap_from_camera = submap_from_camera_, .moment = moment_, .levels = {}};
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

void PhotometricKeyframe::restore(const SavedState& saved) {
  submap_from_camera_ = saved.submap_from_camera;
  moment_ = saved.moment;
  // A reference saved with different levels is discarded, until the next one is set.
  is_set_ = saved.levels.size() == packed_.size();
  for (std::size_t i = 0; is_set_ && i < packed_.size(); ++i)
    is_set_ = !packed_[i] || saved.levels[i].size() * 4 == packed_[i].size();
  if (!is_set_) return;
  gpu::Batch batch(device_);
  for (std::size_t i = 0; i < packed_.size(); ++i)
    if (packed_[i]) batch.upload(packed_[i], saved.levels[i]);
  batch.submit();
}

Eigen::Isometry3d PhotometricKeyframe::submap_from_color(double clock_offset) const {
  return submap_from_camera_ * retract(moment_.velocity * (moment_.stamp_delay - clock_offset));
}

Aligner::Aligner(gpu::Device& device, const TrackOptions& options, const SensorModel& sensor, bool is_rolling)
    : device_(device),
      options_(options),
      is_cpu_(device.info().type == "cpu"),
      workgroup_(gpu::preferred_workgroup_size(device, 64)),
      parts_(std::max(1u, workgroup_ / std::max(1u, device.info().subgroup_size))),
      state_(device, sizeof(shader::AlignState)),
      geometry_sums_(device, std::uint64_t{Tiling::kMaxTiles} * workgroup_ * sizeof(shader::IcpSums)),
      crossed_sums_(device, geometry_sums_.size()),
      photometric_sums_(device, std::uint64_t{Tiling::kMaxTiles} * workgroup_ * sizeof(shader::PhotometricSums)),
      clock_sums_(device, kClockOffsets.size() * photometric_sums_.size()),
      icp_(device, "icp_reduce", icp_reduce_comp, constants_of(sensor, is_rolling), workgroup_),
      photometric_(device, "photometric_reduce", photometric_reduce_comp, constants_of(sensor, is_rolling), workgroup_),
      step_(device, "pose_step", pose_step_comp, {}, gpu::preferred_workgroup_size(device, 128)) {
  expected_iterations_.fill(4);
}

Aligner::Tiling Aligner::tiling(const Views& views, int level) const {
  return {views.camera(level), level == options_.finest_level, is_cpu_};
}

int Aligner::coarsest(AlignmentRange range) const {
  return range == AlignmentRange::coarse_to_fine ? options_.levels - 1 : options_.finest_level;
}

int Aligner::max_iterations(int level) const {
  return level == options_.finest_level ? options_.iterations_finest : options_.iterations_coarse;
}

Alignment Aligner::align(const FramePyramid& live, const SurfacePrediction& model, const Eigen::Isometry3d& guess,
                         const PhotometricKeyframe* keyframe, const ColorMoment& moment, AlignmentRange range,
                         const ShutterCorrection& correction) {
  const bool has_brightness = options_.photometric && keyframe != nullptr && keyframe->is_set() && !live.packed.empty();
  const Views views{live, model, has_brightness ? keyframe : nullptr, moment, range, correction};
  const Eigen::Isometry3d start = model.submap_from_camera.inverse() * guess;
  Alignment result;
  shader::AlignState state = begin(views, start);
  state.keep_rr0 = state.keep_tt0 = {1, 0, 0}, state.keep_rr1 = state.keep_tt1 = {1, 0, 1};
  state.lever = 1;
  for (;;) {
    run(views, state, result.clock_offset_costs);
    for (const std::uint32_t count : state.iterations) result.fit.iterations += static_cast<int>(count);
    if (state.outcome == shader::kDone) break;
    // The coarse levels have drifted along unobserved directions, or have excluded observed ones: repeat from the
    // start.
    const shader::AlignState before = state;
    state = begin(views, start);
    state.directions = before.directions;
    state.keep_rr0 = before.keep_rr0, state.keep_rr1 = before.keep_rr1;
    state.keep_rt0 = before.keep_rt0, state.keep_rt1 = before.keep_rt1, state.keep_rt2 = before.keep_rt2;
    state.keep_tt0 = before.keep_tt0, state.keep_tt1 = before.keep_tt1;
    state.lever = before.lever, state.weak = before.weak;
  }
  assess(views, state, result);
  return result;
}

/// Initial state, at the coarsest level.
shader::AlignState Aligner::begin(const Views& views, const Eigen::Isometry3d& model_from_live) const {
  const int level = coarsest(views.range);
  const bool is_finest = level == options_.finest_level;
  const auto l = static_cast<std::uint32_t>(level);
  shader::AlignState state{};
  state.model_from_live = shader::rigid(model_from_live);
  state.model_from_corrected =
      shader::rigid(views.model.submap_from_camera.inverse() * views.correction.submap_from_camera);
  state.readout = static_cast<float>(views.correction.readout);
  state.gain = 1, state.sigma = kInitialSigma;
  state.stride = 1;
  state.level = l;
  state.is_near = 1;
  state.sums[l] = groups(tiling(views, level).groups);
  state.steps[l] = groups(1);
  state.crossed = groups(is_finest ? state.sums[l].x : 0);
  return state;
}

/// Iterates from the coarsest level to the finest. Records as many iterations as were needed last time, and more only
/// if those were not enough.
void Aligner::run(const Views& views, shader::AlignState& state, std::vector<double>& clock_offset_costs) {
  gpu::Batch batch(device_);
  batch.upload(state_, std::span<const shader::AlignState>(&state, 1));
  std::vector<std::vector<shader::PhotometricSums>> clock_sums;
  for (bool is_first = true; is_first || state.outcome == shader::kAtWork; is_first = false) {
    for (int level = static_cast<int>(state.level); level >= options_.finest_level; --level) {
      const int done = level == static_cast<int>(state.level) ? static_cast<int>(state.iteration) : 0;
      const int count = std::min(max_iterations(level) - done, expected_iterations_[static_cast<std::size_t>(level)]);
      for (int i = 0; i < count; ++i) iterate(batch, views, level, done + i == 0);
    }
    clock_sums.clear();
    if (views.estimates_clock_offset()) clock_sums = evaluate_clock_offsets(batch, views);
    batch.download(state_, std::span<shader::AlignState>(&state, 1));
    batch.run();
  }
  for (std::size_t level = 0; level < expected_iterations_.size(); ++level)
    expected_iterations_[level] =
        std::max(static_cast<int>(state.iterations[level]) + 1, expected_iterations_[level] - 1);
  if (state.outcome == shader::kDone && state.uses_brightness != 0)
    clock_offset_costs = costs_of(clock_sums, static_cast<double>(state.sigma));
}

/// Records one iteration: the sums of both terms at the estimate, and the resulting step. `may_check_degeneracy`: also
/// records the geometry's sums by pairs of normals.
void Aligner::iterate(gpu::Batch& batch, const Views& views, int level, bool may_check_degeneracy) {
  const auto l = static_cast<std::size_t>(level);
  const bool is_finest = level == options_.finest_level;
  const VertexNormalMap& live = *views.live.levels[l];
  const Tiling tiles = tiling(views, level);
  shader::IcpReducePush push{.camera = shader::pinhole(live.camera),
                             .tile = tiles.size,
                             .max_distance = options_.max_distance * static_cast<float>(1 << level),
                             .min_cosine = std::cos(options_.max_angle),
                             .huber = options_.huber,
                             .cut = views.range == AlignmentRange::coarse_to_fine ? 0.0f : kCutoffSigmas,
                             .crossed = 0};
  const std::uint64_t sums_at = offsetof(shader::AlignState, sums) + l * sizeof(shader::Groups);
  const auto reduce_geometry = [&](std::uint64_t groups_at, const gpu::Buffer& sums) {
    icp_.indirect(batch, state_, groups_at, push, {&live.points, &views.model.levels[l]->points, &state_, &sums});
  };
  reduce_geometry(sums_at, geometry_sums_);
  push.crossed = 1;
  if (is_finest && may_check_degeneracy) reduce_geometry(offsetof(shader::AlignState, crossed), crossed_sums_);
  if (views.keyframe != nullptr)
    photometric_.indirect(
        batch, state_, sums_at, photometric_push(views, level, tiles, views.moment.clock_offset, 0),
        {&live.points, views.live.packed[l], &views.keyframe->level(level), &state_, &photometric_sums_});
  const double converged_coarse = kConvergedCoarse * (1 << level);
  step_.indirect(
      batch, state_, offsetof(shader::AlignState, steps) + l * sizeof(shader::Groups),
      {.keyframe_from_model = views.keyframe != nullptr ? views.keyframe_from_model(views.moment.clock_offset)
                                                        : shader::rigid(Eigen::Isometry3d::Identity()),
       .level = static_cast<std::uint32_t>(level),
       .finest = static_cast<std::uint32_t>(options_.finest_level),
       .has_coarser = coarsest(views.range) > options_.finest_level,
       .has_brightness = views.keyframe != nullptr,
       .max_iterations = static_cast<std::uint32_t>(max_iterations(level)),
       .groups = tiles.groups,
       .next_groups = is_finest ? 0 : tiling(views, level - 1).groups,
       .clock_groups = views.estimates_clock_offset() ? tiling(views, options_.levels - 1).groups : 0,
       .pixels = static_cast<float>(live.camera.width * live.camera.height),
       .converged = static_cast<float>(is_finest ? kConverged : converged_coarse),
       .converged_sparse = static_cast<float>(converged_coarse)},
      {&geometry_sums_, &crossed_sums_, &photometric_sums_, &state_});
}

shader::PhotometricReducePush Aligner::photometric_push(const Views& views, int level, const Tiling& tiles,
                                                        double clock_offset, std::uint32_t first) const {
  const Vector6d color_motion = -views.moment.velocity * (views.moment.stamp_delay - clock_offset);
  return {.camera = shader::pinhole(views.camera(level)),
          .keyframe_from_model = views.keyframe_from_model(clock_offset),
          .rotation = Eigen::Vector3f(color_motion.head<3>().cast<float>()),
          .translation = Eigen::Vector3f(color_motion.tail<3>().cast<float>()),
          .tile = tiles.size,
          .first = first};
}

/// Records the photometric sums for each clock offset at the final pose, if the iterations converge.
std::vector<std::vector<shader::PhotometricSums>> Aligner::evaluate_clock_offsets(gpu::Batch& batch,
                                                                                  const Views& views) {
  const int level = options_.levels - 1;
  const auto l = static_cast<std::size_t>(level);
  const Tiling tiles = tiling(views, level);
  const std::uint32_t stride = tiles.groups * workgroup_;
  std::vector<std::vector<shader::PhotometricSums>> sums(kClockOffsets.size(),
                                                         std::vector<shader::PhotometricSums>(tiles.groups * parts_));
  for (std::size_t k = 0; k < kClockOffsets.size(); ++k) {
    const auto first = static_cast<std::uint32_t>(k) * stride;
    photometric_.indirect(
        batch, state_, offsetof(shader::AlignState, clocks),
        photometric_push(views, level, tiles, kClockOffsets[k], first),
        {&views.live.levels[l]->points, views.live.packed[l], &views.keyframe->level(level), &state_, &clock_sums_});
    batch.download(clock_sums_, sums[k], first * sizeof(shader::PhotometricSums));
  }
  return sums;
}

std::vector<double> Aligner::costs_of(const std::vector<std::vector<shader::PhotometricSums>>& clock_sums,
                                      double sigma) {
  if (clock_sums.empty()) return {};
  // A device may run the shaders with a different subgroup size than reported; the actual size is known from here on.
  if (const std::uint32_t parts = clock_sums[0][0].parts; parts != parts_) {
    parts_ = parts;
    return {};
  }
  std::vector<double> costs;
  for (const auto& candidate : clock_sums) {
    double squared = 0, seen = 0;
    for (const auto& p : candidate) squared += p.squared, seen += p.seen;
    costs.push_back(seen > 0 ? squared / (seen * sigma * sigma) : kNoOverlapCost);
  }
  return costs;
}

/// Fills in the pose, its fit, and the reason if the alignment is unreliable.
void Aligner::assess(const Views& views, const shader::AlignState& s, Alignment& result) const {
  result.submap_from_camera = views.model.submap_from_camera * isometry(s.model_from_live);
  result.information = matrix_of(s.normal);
  result.fit.degenerate_directions = static_cast<int>(s.degenerate_directions);
  result.fit.unobserved = static_cast<int>(s.unobserved);
  const double squared = s.squared, inliers = s.inliers, seen = s.seen, live = s.live;
  result.fit.inlier_share = seen > 0 ? inliers / seen : 0.0;
  result.fit.overlap = live > 0 ? seen / live : 0.0;
  result.fit.rmse = inliers > 0 ? std::sqrt(squared / inliers) : 0.0;
  if (s.uses_brightness != 0) {
    result.fit.photometric_share = static_cast<double>(s.photometric_fitting) / static_cast<double>(s.photometric_seen);
    result.fit.photometric_rmse = s.sigma;
    result.gain = s.gain, result.bias = s.bias;
  }
  result.lost = failure_cause(result, live, views.camera(options_.finest_level), options_);
}

}  // namespace cairn
