// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Whether two maps that are laid to each other may lie so: what one saw through, the other has not seen a surface in.
#pragma once
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "cairn/camera.hpp"
#include "cairn/frame.hpp"
#include "map/atlas.hpp"

namespace cairn {

/// Compares images of keyframes that look at the same place from near. Rooms that look alike are told from each other
/// by what is around them, and by what somebody has hung on their walls.
class ViewsApart {
 public:
  /// Gives a keyframe's depth image, metres.
  using GetDepth = std::function<std::vector<float>(std::size_t keyframe)>;
  /// Gives a keyframe's images.
  using GetFrame = std::function<Frame(std::size_t keyframe)>;
  /// `get_frame`: none where colour is not registered to depth.
  ViewsApart(const Camera& camera, GetDepth get_depth, GetFrame get_frame = {});

  struct Compared {
    int views = 0;     // of keyframes of the second map that had one of the first to be compared with
    double share = 0;  // of the pixels that tell whether they agree, those that do not
  };
  /// Two lists of keyframes; those of the second one lie at `move` times their poses in the atlas.
  [[nodiscard]] Compared compare(const Atlas& atlas, std::span<const std::size_t> first,
                                 std::span<const std::size_t> second, const Eigen::Isometry3d& move);

  struct Count {
    int agree = 0, differ = 0;
  };
  /// Patches of the same surface in the two views of a loop, of those that have a pattern in the second one: how many
  /// have it in the first one as well, whatever its brightness and contrast are, within some pixels.
  [[nodiscard]] const Count& patterns(const Loop& loop);

 private:
  [[nodiscard]] const std::vector<std::uint16_t>& thumbnail(std::size_t keyframe);
  [[nodiscard]] Count count(std::size_t from, std::size_t seen, const Eigen::Isometry3d& from_seen);

  Camera camera_;
  GetDepth get_depth_;
  GetFrame get_frame_;
  int width_, height_;  // of a thumbnail
  std::vector<Eigen::Vector3f> rays_;
  std::map<std::size_t, std::vector<std::uint16_t>> thumbnails_;  // millimetres
  std::vector<Eigen::Vector3f> all_rays_;                         // by pixel
  std::map<std::pair<std::size_t, std::size_t>, Count> patterns_;
};

/// Of a map's keyframes.
[[nodiscard]] ViewsApart views_of(const Rig& rig, const KeyframeStore& images);

}  // namespace cairn
