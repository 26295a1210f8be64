// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/views_apart.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "volume/volume.hpp"

namespace cairn {
namespace {

constexpr int kBeside = 2;                      // pixels of a thumbnail that poses may be off by
constexpr int kStep = 8;                        // pixels
constexpr double kNear = 1.0, kTurned = 0.5;    // metres, radians between views that are compared
constexpr float kSame = 0.1f, kThrough = 0.3f;  // metres that depth may differ by; from which on one looked through
constexpr float kFar = 4.0f;                    // metres: beyond it depth is too rough
constexpr double kEnough = 0.1;                 // of the pixels that must be seen by both
constexpr std::size_t kMostViews = 200;

}  // namespace

ViewsApart::ViewsApart(const Camera& camera, GetDepth get_depth)
    : camera_(camera),
      get_depth_(std::move(get_depth)),
      width_((camera.width - kStep / 2 + kStep - 1) / kStep),
      height_((camera.height - kStep / 2 + kStep - 1) / kStep) {
  for (int v = 0; v < height_; ++v)
    for (int u = 0; u < width_; ++u) {
      const int x = kStep / 2 + kStep * u, y = kStep / 2 + kStep * v;
      const Eigen::Vector2d ray = camera.undistorted_ray(x, y);
      rays_.emplace_back(static_cast<float>(ray.x()), static_cast<float>(ray.y()), 1.0f);
    }
}

const std::vector<std::uint16_t>& ViewsApart::thumbnail(std::size_t keyframe) {
  const auto [at, is_new] = thumbnails_.try_emplace(keyframe);
  if (!is_new) return at->second;
  const std::vector<float> depth = get_depth_(keyframe);
  for (int v = 0; v < height_; ++v)
    for (int u = 0; u < width_; ++u) {
      const auto pixel = static_cast<std::size_t>((kStep / 2 + kStep * v) * camera_.width + kStep / 2 + kStep * u);
      at->second.push_back(static_cast<std::uint16_t>(std::lround(1000 * std::clamp(depth[pixel], 0.0f, 65.0f))));
    }
  return at->second;
}

ViewsApart::Count ViewsApart::count(std::size_t from, std::size_t seen, const Eigen::Isometry3d& from_seen) {
  const auto &a = thumbnail(from), &b = thumbnail(seen);
  const Eigen::Isometry3f motion = from_seen.cast<float>();
  Count count;
  for (std::size_t i = 0; i < b.size(); ++i) {
    const float depth = 1e-3f * static_cast<float>(b[i]);
    if (!(depth > 0) || depth > kFar) continue;
    const Eigen::Vector3f p = motion * (depth * rays_[i]);
    if (p.z() < kSame) continue;
    const Eigen::Vector2d bent =
        camera_.distort(Eigen::Vector2d(p.head<2>().cast<double>() / static_cast<double>(p.z())));
    const int u = static_cast<int>(std::lround((camera_.fx * bent.x() + camera_.cx - kStep / 2.0) / kStep)),
              v = static_cast<int>(std::lround((camera_.fy * bent.y() + camera_.cy - kStep / 2.0) / kStep));
    if (u < 0 || u >= width_ || v < 0 || v >= height_) continue;
    // What lies a little beside, at the rim of something, contradicts nothing.
    bool agrees = false;
    float nearest = std::numeric_limits<float>::infinity();
    for (int y = std::max(0, v - kBeside); y <= std::min(height_ - 1, v + kBeside); ++y)
      for (int x = std::max(0, u - kBeside); x <= std::min(width_ - 1, u + kBeside); ++x) {
        const float known = 1e-3f * static_cast<float>(a[static_cast<std::size_t>(y * width_ + x)]);
        nearest = std::min(nearest, known);  // none where nothing was measured
        agrees = agrees || (known > 0 && std::abs(p.z() - known) < kSame);
      }
    count.agree += agrees;
    count.differ += !agrees && nearest > 0 && p.z() < nearest - kThrough;
  }
  return count;
}

ViewsApart::Compared ViewsApart::compare(const Atlas& atlas, std::span<const std::size_t> first,
                                         std::span<const std::size_t> second, const Eigen::Isometry3d& move) {
  const auto cell = [](const Eigen::Isometry3d& pose) {
    return Brick((pose.translation() / kNear).array().floor().cast<int>().matrix());
  };
  std::unordered_map<Brick, std::vector<std::size_t>, BrickHash> at;
  for (const std::size_t k : first) at[cell(atlas.world_from_camera[k])].push_back(k);
  std::vector<std::pair<std::size_t, std::size_t>> views;
  for (const std::size_t k : second) {
    const Eigen::Isometry3d pose = move * atlas.world_from_camera[k];
    std::optional<std::size_t> nearest;
    double least = kNear + kTurned;
    for (int i = 0; i < 27; ++i) {
      const auto known = at.find(cell(pose) + Brick(i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1));
      if (known == at.end()) continue;
      for (const std::size_t other : known->second) {
        const Eigen::Isometry3d motion = pose.inverse() * atlas.world_from_camera[other];
        const double shift = motion.translation().norm(),
                     turn = std::acos(std::clamp(motion.linear()(2, 2), -1.0, 1.0));
        if (shift < kNear && turn < kTurned && shift + turn < least) least = shift + turn, nearest = other;
      }
    }
    if (nearest) views.emplace_back(*nearest, k);
  }
  Compared compared;
  Count all;
  const std::size_t step = 1 + views.size() / kMostViews;
  for (std::size_t i = 0; i < views.size(); i += step) {
    const auto [a, b] = views[i];
    const Eigen::Isometry3d a_from_b = atlas.world_from_camera[a].inverse() * move * atlas.world_from_camera[b];
    const Count there = count(a, b, a_from_b), back = count(b, a, a_from_b.inverse());
    const int agree = there.agree + back.agree, differ = there.differ + back.differ;
    if (agree + differ < kEnough * static_cast<double>(2 * rays_.size())) continue;
    all.agree += agree, all.differ += differ;
    ++compared.views;
  }
  compared.share = all.agree + all.differ > 0 ? static_cast<double>(all.differ) / (all.agree + all.differ) : 0;
  return compared;
}

}  // namespace cairn
