// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "loop_closing/free_space_conflicts.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "volume/volume.hpp"

namespace cairn {
namespace {

constexpr int kTolerancePixels = 2;                            // thumbnail pixels of tolerance for pose errors
constexpr int kThumbnailStep = 8;                              // image pixels per thumbnail pixel
constexpr double kMaxViewDistance = 1.0, kMaxViewAngle = 0.5;  // m, rad: max. distance between compared views
// Meters: max. depth difference to agree, min. one to contradict.
constexpr float kMaxAgreeingDepthError = 0.1f, kMinContradictingDepth = 0.3f;
constexpr float kMaxDepth = 4.0f;        // m: depth beyond is too noisy
constexpr double kMinCommonShare = 0.1;  // min. share of the pixels seen by both
constexpr std::size_t kMaxComparedViews = 200;

constexpr int kPatchSize = 16;                    // pixels per side
constexpr int kSearchRange = 4, kSearchStep = 2;  // pixels: search range for a patch, and its step
constexpr float kMinPatternDeviation = 8;         // of 255: min. standard deviation of a patch's brightness
constexpr float kMinCorrelation = 0.4f;           // correlation
constexpr float kMinPatchCoverage = 0.9f;  // min. share of a patch's pixels for which both views see the same surface
// Meters, share of depth: max. difference on a surface.
constexpr float kMaxSurfaceDistance = 0.03f, kMaxSurfaceDistanceRatio = 0.01f;

std::vector<float> brightness_of(const Frame& frame) {
  std::vector<float> brightness;
  brightness.reserve(frame.color.size());
  for (const std::uint32_t c : frame.color)
    brightness.push_back(0.299f * static_cast<float>(c & 255) + 0.587f * static_cast<float>(c >> 8 & 255) +
                         0.114f * static_cast<float>(c >> 16 & 255));
  return brightness;
}

/// Subtracts the mean and returns the norm.
float deviation(Eigen::VectorXf& values) {
  values.array() -= values.mean();
  return values.norm();
}

}  // namespace

FreeSpaceConflicts::FreeSpaceConflicts(const Camera& camera, GetDepth get_depth, GetFrame get_frame)
    : camera_(camera),
      get_depth_(std::move(get_depth)),
      get_frame_(std::move(get_frame)),
      width_((camera.width - kThumbnailStep / 2 + kThumbnailStep - 1) / kThumbnailStep),
      height_((camera.height - kThumbnailStep / 2 + kThumbnailStep - 1) / kThumbnailStep) {
  for (int v = 0; v < height_; ++v)
    for (int u = 0; u < width_; ++u) {
      const int x = kThumbnailStep / 2 + kThumbnailStep * u, y = kThumbnailStep / 2 + kThumbnailStep * v;
      const Eigen::Vector2d ray = camera.undistorted_ray(x, y);
      rays_.emplace_back(static_cast<float>(ray.x()), static_cast<float>(ray.y()), 1.0f);
    }
}

const std::vector<std::uint16_t>& FreeSpaceConflicts::thumbnail(std::size_t keyframe) {
  const auto [at, is_new] = thumbnails_.try_emplace(keyframe);
  if (!is_new) return at->second;
  const std::vector<float> depth = get_depth_(keyframe);
  for (int v = 0; v < height_; ++v)
    for (int u = 0; u < width_; ++u) {
      const auto pixel = static_cast<std::size_t>((kThumbnailStep / 2 + kThumbnailStep * v) * camera_.width +
                                                  kThumbnailStep / 2 + kThumbnailStep * u);
      at->second.push_back(static_cast<std::uint16_t>(std::lround(1000 * std::clamp(depth[pixel], 0.0f, 65.0f))));
    }
  return at->second;
}

FreeSpaceConflicts::Count FreeSpaceConflicts::count(std::size_t from, std::size_t seen,
                                                    const Eigen::Isometry3d& from_seen) {
  const auto &a = thumbnail(from), &b = thumbnail(seen);
  const Eigen::Isometry3f motion = from_seen.cast<float>();
  Count count;
  for (std::size_t i = 0; i < b.size(); ++i) {
    const float depth = 1e-3f * static_cast<float>(b[i]);
    if (!(depth > 0) || depth > kMaxDepth) continue;
    const Eigen::Vector3f p = motion * (depth * rays_[i]);
    if (p.z() < kMaxAgreeingDepthError) continue;
    const Eigen::Vector2d distorted =
        camera_.distort(Eigen::Vector2d(p.head<2>().cast<double>() / static_cast<double>(p.z())));
    const int u = static_cast<int>(
                  std::lround((camera_.fx * distorted.x() + camera_.cx - kThumbnailStep / 2.0) / kThumbnailStep)),
              v = static_cast<int>(
                  std::lround((camera_.fy * distorted.y() + camera_.cy - kThumbnailStep / 2.0) / kThumbnailStep));
    if (u < 0 || u >= width_ || v < 0 || v >= height_) continue;
    // Small offsets at depth edges are no contradiction.
    bool agrees = false;
    float nearest = std::numeric_limits<float>::infinity();
    for (int y = std::max(0, v - kTolerancePixels); y <= std::min(height_ - 1, v + kTolerancePixels); ++y)
      for (int x = std::max(0, u - kTolerancePixels); x <= std::min(width_ - 1, u + kTolerancePixels); ++x) {
        const float other_depth = 1e-3f * static_cast<float>(a[static_cast<std::size_t>(y * width_ + x)]);
        nearest = std::min(nearest, other_depth);  // 0 where a pixel has no measurement
        agrees = agrees || (other_depth > 0 && std::abs(p.z() - other_depth) < kMaxAgreeingDepthError);
      }
    count.agree += agrees;
    count.differ += !agrees && nearest > 0 && p.z() < nearest - kMinContradictingDepth;
  }
  return count;
}

FreeSpaceConflicts::Compared FreeSpaceConflicts::compare(const Atlas& atlas, std::span<const std::size_t> first,
                                                         std::span<const std::size_t> second,
                                                         const Eigen::Isometry3d& move) {
  const auto cell = [](const Eigen::Isometry3d& pose) {
    return Brick((pose.translation() / kMaxViewDistance).array().floor().cast<int>().matrix());
  };
  std::unordered_map<Brick, std::vector<std::size_t>, BrickHash> at;
  for (const std::size_t k : first) at[cell(atlas.world_from_camera[k])].push_back(k);
  std::vector<std::pair<std::size_t, std::size_t>> views;
  for (const std::size_t k : second) {
    const Eigen::Isometry3d pose = move * atlas.world_from_camera[k];
    std::optional<std::size_t> nearest;
    double min_distance = kMaxViewDistance + kMaxViewAngle;
    for (int i = 0; i < 27; ++i) {
      const auto found = at.find(cell(pose) + Brick(i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1));
      if (found == at.end()) continue;
      for (const std::size_t other : found->second) {
        const Eigen::Isometry3d motion = pose.inverse() * atlas.world_from_camera[other];
        const double distance = motion.translation().norm(),
                     angle = std::acos(std::clamp(motion.linear()(2, 2), -1.0, 1.0));
        if (distance < kMaxViewDistance && angle < kMaxViewAngle && distance + angle < min_distance)
          min_distance = distance + angle, nearest = other;
      }
    }
    if (nearest) views.emplace_back(*nearest, k);
  }
  Compared compared;
  Count all;
  const std::size_t step = 1 + views.size() / kMaxComparedViews;
  for (std::size_t i = 0; i < views.size(); i += step) {
    const auto [a, b] = views[i];
    const Eigen::Isometry3d a_from_b = atlas.world_from_camera[a].inverse() * move * atlas.world_from_camera[b];
    const Count there = count(a, b, a_from_b), back = count(b, a, a_from_b.inverse());
    const int agree = there.agree + back.agree, differ = there.differ + back.differ;
    if (agree + differ < kMinCommonShare * static_cast<double>(2 * rays_.size())) continue;
    all.agree += agree, all.differ += differ;
    ++compared.views;
  }
  compared.share = all.agree + all.differ > 0 ? static_cast<double>(all.differ) / (all.agree + all.differ) : 0;
  return compared;
}

const FreeSpaceConflicts::Count& FreeSpaceConflicts::patterns(const Loop& loop) {
  const auto [found, is_new] = patterns_.try_emplace({loop.edge.i, loop.edge.j});
  Count& count = found->second;
  if (!is_new || !get_frame_) return count;
  const Frame first = get_frame_(loop.edge.i), second = get_frame_(loop.edge.j);
  const auto pixels = static_cast<std::size_t>(camera_.width) * static_cast<std::size_t>(camera_.height);
  if (first.color.size() != pixels || second.color.size() != pixels) return count;
  if (all_rays_.empty())
    for (int y = 0; y < camera_.height; ++y)
      for (int x = 0; x < camera_.width; ++x) {
        const Eigen::Vector2d ray = camera_.undistorted_ray(x, y);
        all_rays_.emplace_back(static_cast<float>(ray.x()), static_cast<float>(ray.y()), 1.0f);
      }
  const std::vector<float> a = brightness_of(first), b = brightness_of(second);
  const Eigen::Isometry3f motion = loop.edge.i_from_j.cast<float>();
  const auto at = [&](int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(camera_.width) + static_cast<std::size_t>(x);
  };
  std::vector<std::pair<int, int>> projected_pixels;  // of a patch's pixels, in the first view
  std::vector<float> values;
  for (int top = 0; top + kPatchSize <= camera_.height; top += kPatchSize)
    for (int left = 0; left + kPatchSize <= camera_.width; left += kPatchSize) {
      projected_pixels.clear(), values.clear();
      for (int y = top; y < top + kPatchSize; ++y)
        for (int x = left; x < left + kPatchSize; ++x) {
          const float depth = second.depth[at(x, y)];
          if (!(depth > 0)) continue;
          const Eigen::Vector3f p = motion * (depth * all_rays_[at(x, y)]);
          if (p.z() < kMaxAgreeingDepthError) continue;
          const Eigen::Vector2d to = camera_.project(p.cast<double>());
          const int u = static_cast<int>(std::lround(to.x())), v = static_cast<int>(std::lround(to.y()));
          if (u < kSearchRange || u + kSearchRange >= camera_.width || v < kSearchRange ||
              v + kSearchRange >= camera_.height)
            continue;
          const float seen = first.depth[at(u, v)];
          if (!(seen > 0) || std::abs(seen - p.z()) > kMaxSurfaceDistance + kMaxSurfaceDistanceRatio * p.z()) continue;
          projected_pixels.emplace_back(u, v);
          values.push_back(b[at(x, y)]);
        }
      if (static_cast<float>(values.size()) < kMinPatchCoverage * kPatchSize * kPatchSize) continue;
      Eigen::VectorXf pattern =
          Eigen::Map<const Eigen::VectorXf>(values.data(), static_cast<Eigen::Index>(values.size()));
      const float size = deviation(pattern);
      if (size < kMinPatternDeviation * std::sqrt(static_cast<float>(values.size()))) continue;
      bool is_similar = false;
      Eigen::VectorXf other(pattern.size());
      for (int dy = -kSearchRange; dy <= kSearchRange && !is_similar; dy += kSearchStep)
        for (int dx = -kSearchRange; dx <= kSearchRange && !is_similar; dx += kSearchStep) {
          for (std::size_t i = 0; i < projected_pixels.size(); ++i)
            other[static_cast<Eigen::Index>(i)] =
                a[at(projected_pixels[i].first + dx, projected_pixels[i].second + dy)];
          const float norm = deviation(other);
          is_similar = pattern.dot(other) > kMinCorrelation * size * norm;
        }
      ++(is_similar ? count.agree : count.differ);
    }
  return count;
}

FreeSpaceConflicts free_space_conflicts(const Rig& rig, const KeyframeStore& images) {
  const auto depth = [&images](std::size_t k) { return images.depth(k); };
  if (rig.color) return {rig.depth, depth};
  return {rig.depth, depth, [&images](std::size_t k) { return images.get(k); }};
}

}  // namespace cairn
