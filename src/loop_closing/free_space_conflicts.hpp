// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Free-space test for a candidate alignment of two maps: a surface of one map must not be in the free space of the
// other.
#pragma once
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "cairn/mapping/camera.hpp"
#include "cairn/mapping/frame.hpp"
#include "map/atlas.hpp"

namespace cairn {

/// Compares images of keyframes with nearby views of the same place. Similar rooms are distinguished by their
/// surroundings and by the pictures on their walls.
class FreeSpaceConflicts {
 public:
  /// Returns a keyframe's depth image, meters.
  using GetDepth = std::function<std::vector<float>(std::size_t keyframe)>;
  /// Returns a keyframe's images.
  using GetFrame = std::function<Frame(std::size_t keyframe)>;
  /// `get_frame`: empty if color is not registered to depth.
  FreeSpaceConflicts(const Camera& camera, GetDepth get_depth, GetFrame get_frame = {});

  struct Compared {
    int views = 0;     // keyframes of the second map with a comparable keyframe of the first
    double share = 0;  // contradicting share of the pixels that agree or contradict
  };
  /// Compares two lists of keyframes; the poses of the second one are moved by `move`.
  [[nodiscard]] Compared compare(const Atlas& atlas, std::span<const std::size_t> first,
                                 std::span<const std::size_t> second, const Eigen::Isometry3d& move);

  struct Count {
    int agree = 0, differ = 0;
  };
  /// Counts patches on the surface common to the two views of a loop closure, if they have a pattern in the second
  /// view. A patch agrees if the first view has the same pattern within some pixels, up to brightness and contrast.
  [[nodiscard]] const Count& patterns(const Loop& loop);

 private:
  [[nodiscard]] const std::vector<std::uint16_t>& thumbnail(std::size_t keyframe);
  [[nodiscard]] Count count(std::size_t from, std::size_t seen, const Eigen::Isometry3d& from_seen);

  Camera camera_;
  GetDepth get_depth_;
  GetFrame get_frame_;
  int width_, height_;  // of a thumbnail
  std::vector<Eigen::Vector3f> rays_;
  std::map<std::size_t, std::vector<std::uint16_t>> thumbnails_;  // millimeters
  std::vector<Eigen::Vector3f> all_rays_;                         // by pixel
  std::map<std::pair<std::size_t, std::size_t>, Count> patterns_;
};

/// Free-space test over a map's keyframes.
[[nodiscard]] FreeSpaceConflicts free_space_conflicts(const Rig& rig, const KeyframeStore& images);

}  // namespace cairn
