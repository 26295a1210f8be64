// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "loop_closing/pairs.hpp"

#include <algorithm>
#include <deque>
#include <optional>
#include <utility>

namespace cairn {
namespace {

// Rad, m: max. distance between covisible keyframes.
constexpr double kMaxCovisibleAngle = 0.6, kMaxCovisibleDistance = 0.8;

/// Cache of the last images; consecutive pairs share keyframes.
class Cache {
 public:
  explicit Cache(const KeyframeStore& images) : images_(images) {}
  const Frame& operator()(std::size_t keyframe) {
    for (const auto& [cached_keyframe, frame] : frames_)
      if (cached_keyframe == keyframe) return frame;
    if (frames_.size() == kMaxFrames) frames_.pop_front();
    return frames_.emplace_back(keyframe, images_.get(keyframe)).second;
  }

 private:
  static constexpr std::size_t kMaxFrames = 24;  // 2.4 MB each
  const KeyframeStore& images_;
  std::deque<std::pair<std::size_t, Frame>> frames_;
};

}  // namespace

std::vector<std::size_t> covisible_keyframes(const Atlas& atlas, const std::vector<std::size_t>& component,
                                             std::size_t keyframe) {
  const Eigen::Isometry3d camera_from_world = atlas.world_from_camera[keyframe].inverse();
  std::vector<std::pair<double, std::size_t>> neighbors;
  for (std::size_t j = keyframe + 1; j < atlas.keyframes.size(); ++j) {
    if (component[keyframe] != component[j]) continue;
    const double shift = (camera_from_world * atlas.world_from_camera[j].translation()).norm() / kMaxCovisibleDistance;
    if (shift >= 1) continue;
    const Eigen::AngleAxisd rotation(camera_from_world.linear() * atlas.world_from_camera[j].linear());
    const double turn = rotation.angle() / kMaxCovisibleAngle;
    if (turn < 1) neighbors.emplace_back(j == keyframe + 1 ? 0.0 : turn + shift, j);
  }
  std::sort(neighbors.begin(), neighbors.end());
  std::vector<std::size_t> keyframes;
  keyframes.reserve(neighbors.size());
  for (const auto& [distance, j] : neighbors) keyframes.push_back(j);
  return keyframes;
}

std::vector<Loop> align_pairs(const std::vector<KeyframePair>& pairs, const KeyframeStore& images,
                              SurfaceMatcher& matcher, const std::function<void(std::size_t)>& before) {
  Cache image(images);
  std::vector<Loop> loops;
  std::optional<std::size_t> from;  // current reference of the matcher
  for (std::size_t number = 0; number < pairs.size(); ++number) {
    const KeyframePair& pair = pairs[number];
    if (before) before(number);
    std::optional<Match> found;
    if (pair.feature_inliers > 0) {
      const Frame first = image(pair.from);
      found = matcher.match_symmetric(first, image(pair.to), pair.from_to);
      from.reset();
    } else {
      if (from != pair.from) matcher.set_reference(image(pair.from));
      from = pair.from;
      found = matcher.match(image(pair.to), pair.from_to);
    }
    if (!found) continue;
    loops.push_back({.edge = {.i = pair.from,
                              .j = pair.to,
                              .i_from_j = found->reference_from_query,
                              .information = found->information,
                              .is_loop_closure = true},
                     .feature_inliers = pair.feature_inliers,
                     .inlier_share = found->inlier_share,
                     .rmse = found->rmse});
  }
  return loops;
}

}  // namespace cairn
