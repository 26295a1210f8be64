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

constexpr int kBeside = 2;                      // thumbnail pixels of tolerance for pose errors
constexpr int kStep = 8;                        // image pixels per thumbnail pixel
constexpr double kNear = 1.0, kTurned = 0.5;    // m, rad: max. distance between compared views
constexpr float kSame = 0.1f, kThrough = 0.3f;  // m: max. depth difference to agree, min. one to contradict
constexpr float kFar = 4.0f;                    // m: depth beyond is too noisy
constexpr double kEnough = 0.1;                 // min. share of the pixels seen by both
constexpr std::size_t kMostViews = 200;

constexpr int kPatch = 16;           // pixels per side
constexpr int kAside = 4, kHop = 2;  // pixels: search range for a patch, and its step
constexpr float kPattern = 8;        // of 255: min. standard deviation of a patch's brightness
constexpr float kAlike = 0.4f;       // correlation
constexpr float kCovered = 0.9f;     // min. share of a patch's pixels for which both views see the same surface
constexpr float kSurface = 0.03f, kSurfaceShare = 0.01f;  // m, share of depth: max. difference on a surface

std::vector<float> brightness_of(const Frame& frame) {
  std::vector<float> brightness;
  brightness.reserve(frame.colour.size());
  for (const std::uint32_t c : frame.colour)
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

ViewsApart::ViewsApart(const Camera& camera, GetDepth get_depth, GetFrame get_frame)
    : camera_(camera),
      get_depth_(std::move(get_depth)),
      get_frame_(std::move(get_frame)),
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
    // Small offsets at depth edges are no contradiction.
    bool agrees = false;
    float nearest = std::numeric_limits<float>::infinity();
    for (int y = std::max(0, v - kBeside); y <= std::min(height_ - 1, v + kBeside); ++y)
      for (int x = std::max(0, u - kBeside); x <= std::min(width_ - 1, u + kBeside); ++x) {
        const float known = 1e-3f * static_cast<float>(a[static_cast<std::size_t>(y * width_ + x)]);
        nearest = std::min(nearest, known);  // 0 where a pixel has no measurement
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

const ViewsApart::Count& ViewsApart::patterns(const Loop& loop) {
  const auto [known, is_new] = patterns_.try_emplace({loop.edge.i, loop.edge.j});
  Count& count = known->second;
  if (!is_new || !get_frame_) return count;
  const Frame first = get_frame_(loop.edge.i), second = get_frame_(loop.edge.j);
  const auto pixels = static_cast<std::size_t>(camera_.width) * static_cast<std::size_t>(camera_.height);
  if (first.colour.size() != pixels || second.colour.size() != pixels) return count;
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
  std::vector<std::pair<int, int>> places;  // of a patch's pixels, in the first view
  std::vector<float> own;
  for (int top = 0; top + kPatch <= camera_.height; top += kPatch)
    for (int left = 0; left + kPatch <= camera_.width; left += kPatch) {
      places.clear(), own.clear();
      for (int y = top; y < top + kPatch; ++y)
        for (int x = left; x < left + kPatch; ++x) {
          const float depth = second.depth[at(x, y)];
          if (!(depth > 0)) continue;
          const Eigen::Vector3f p = motion * (depth * all_rays_[at(x, y)]);
          if (p.z() < kSame) continue;
          const Eigen::Vector2d to = camera_.project(p.cast<double>());
          const int u = static_cast<int>(std::lround(to.x())), v = static_cast<int>(std::lround(to.y()));
          if (u < kAside || u + kAside >= camera_.width || v < kAside || v + kAside >= camera_.height) continue;
          const float seen = first.depth[at(u, v)];
          if (!(seen > 0) || std::abs(seen - p.z()) > kSurface + kSurfaceShare * p.z()) continue;
          places.emplace_back(u, v);
          own.push_back(b[at(x, y)]);
        }
      if (static_cast<float>(own.size()) < kCovered * kPatch * kPatch) continue;
      Eigen::VectorXf pattern = Eigen::Map<const Eigen::VectorXf>(own.data(), static_cast<Eigen::Index>(own.size()));
      const float size = deviation(pattern);
      if (size < kPattern * std::sqrt(static_cast<float>(own.size()))) continue;
      bool is_alike = false;
      Eigen::VectorXf other(pattern.size());
      for (int dy = -kAside; dy <= kAside && !is_alike; dy += kHop)
        for (int dx = -kAside; dx <= kAside && !is_alike; dx += kHop) {
          for (std::size_t i = 0; i < places.size(); ++i)
            other[static_cast<Eigen::Index>(i)] = a[at(places[i].first + dx, places[i].second + dy)];
          const float norm = deviation(other);
          is_alike = pattern.dot(other) > kAlike * size * norm;
        }
      ++(is_alike ? count.agree : count.differ);
    }
  return count;
}

ViewsApart views_of(const Rig& rig, const KeyframeStore& images) {
  const auto depth = [&images](std::size_t k) { return images.depth(k); };
  if (rig.colour) return {rig.depth, depth};
  return {rig.depth, depth, [&images](std::size_t k) { return images.get(k); }};
}

}  // namespace cairn
