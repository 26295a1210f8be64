// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <random>
#include <stdexcept>
#include <unsupported/Eigen/BVH>

#include "cairn/eval/evaluation.hpp"
#include "eval/frame_pose.hpp"
#include "eval/statistics.hpp"
#include "eval/view_comparison.hpp"
#include "geometry/velocity.hpp"

namespace cairn {
namespace {

constexpr std::array kRanges{0.0, 1.5, 2.5, 3.5, 5.0};  // meters, limits of the depth bands
constexpr float kMaxDepthError = 0.1f;                  // meters: beyond this distance, another surface
constexpr float kMinSheetGap = 0.005f, kMaxSheetGap = 0.05f, kMinNormalCosine = 0.7f;  // meters; cosine between normals
constexpr int kSheetSamples = 100000;

/// Triangles with a ray query along their normals.
class Sheets {
 public:
  explicit Sheets(const std::vector<Mesh>& parts) {
    for (const Mesh& part : parts)
      for (const auto& t : part.triangles)
        if (const Triangle triangle{{part.positions[t[0]], part.positions[t[1]], part.positions[t[2]]}};
            triangle.normal().squaredNorm() > 0)
          triangles_.push_back(triangle);
    std::vector<int> objects(triangles_.size());
    std::iota(objects.begin(), objects.end(), 0);
    std::vector<Eigen::AlignedBox3f> boxes(objects.size());
    for (std::size_t i = 0; i < boxes.size(); ++i)
      for (const auto& corner : triangles_[i].corners) boxes[i].extend(corner);
    tree_.init(objects.begin(), objects.end(), boxes.begin(), boxes.end());
  }

  /// Share of the surface with another sheet in front or behind, facing the same way.
  [[nodiscard]] double doubled() const {
    if (triangles_.empty()) return 0;
    std::vector<double> areas;
    areas.reserve(triangles_.size());
    double total = 0;
    for (const Triangle& t : triangles_) areas.push_back(total += static_cast<double>(t.normal().norm()));
    std::vector<char> has_another(kSheetSamples);
    tbb::parallel_for(0, kSheetSamples, [&](int i) {
      std::minstd_rand random(static_cast<unsigned>(i) + 1);
      random.discard(2);
      std::uniform_real_distribution<float> uniform;
      const auto at = std::upper_bound(areas.begin(), areas.end(), total * (i + 0.5) / kSheetSamples);
      const Triangle& t = triangles_[std::min(static_cast<std::size_t>(at - areas.begin()), areas.size() - 1)];
      float u = uniform(random), v = uniform(random);
      if (u + v > 1) u = 1 - u, v = 1 - v;
      const Eigen::Vector3f p = t.corners[0] + u * (t.corners[1] - t.corners[0]) + v * (t.corners[2] - t.corners[0]);
      has_another[static_cast<std::size_t>(i)] = intersects_sheet(p, t.normal().normalized());
    });
    return static_cast<double>(std::count(has_another.begin(), has_another.end(), 1)) / kSheetSamples;
  }

 private:
  struct Triangle {
    std::array<Eigen::Vector3f, 3> corners;
    [[nodiscard]] Eigen::Vector3f normal() const {
      return (corners[1] - corners[0]).cross(corners[2] - corners[0]);  // length: twice the area
    }
  };
  /// Returns true if the line along a normal intersects another triangle of similar normal, at a distance from
  /// kMinSheetGap to kMaxSheetGap.
  [[nodiscard]] bool intersects_sheet(const Eigen::Vector3f& p, const Eigen::Vector3f& n) const {
    struct Line {
      const std::vector<Triangle>& triangles;
      const Eigen::Vector3f &p, &n;
      Eigen::AlignedBox3f bounds;
      bool found = false;
      bool intersectVolume(const Eigen::AlignedBox3f& box) const { return box.intersects(bounds); }
      bool intersectObject(int i) {
        const Triangle& t = triangles[static_cast<std::size_t>(i)];
        const Eigen::Vector3f other = t.normal();
        const float along = other.dot(n);
        if (along < kMinNormalCosine * other.norm()) return false;
        const float gap = other.dot(t.corners[0] - p) / along;
        if (std::abs(gap) < kMinSheetGap || std::abs(gap) > kMaxSheetGap) return false;
        const Eigen::Vector3f hit = p + gap * n;
        for (std::size_t k = 0; k < 3; ++k)
          if ((t.corners[(k + 1) % 3] - t.corners[k]).cross(hit - t.corners[k]).dot(other) < 0) return false;
        return found = true;
      }
    } line{triangles_, p, n, {}};
    line.bounds.extend(p - kMaxSheetGap * n);
    line.bounds.extend(p + kMaxSheetGap * n);
    Eigen::BVIntersect(tree_, line);
    return line.found;
  }
  std::vector<Triangle> triangles_;
  Eigen::KdBVH<float, 3, int> tree_;
};

/// Depth errors by range band.
class DepthErrors {
 public:
  void add(const std::vector<ViewComparison::Pixel>& pixels) {
    for (const auto& [seen, drawn] : pixels) {
      const auto z = static_cast<double>(seen);
      const auto band = std::upper_bound(kRanges.begin(), kRanges.end(), z) - kRanges.begin() - 1;
      if (band + 1 >= static_cast<std::ptrdiff_t>(kRanges.size())) continue;
      Band& b = bands_[static_cast<std::size_t>(band)];
      ++b.seen;
      if (drawn == 0) continue;
      const float error = drawn - seen;
      if (std::abs(error) > kMaxDepthError)
        ++b.elsewhere;
      else
        b.errors.push_back(static_cast<double>(std::abs(error)));
    }
  }
  [[nodiscard]] std::vector<MapError::Range> ranges() const {
    std::vector<MapError::Range> ranges;
    for (std::size_t i = 0; i < bands_.size(); ++i)
      if (const Band& b = bands_[i]; b.seen > 0)
        ranges.push_back({.from = kRanges[i],
                          .to = kRanges[i + 1],
                          .depth = statistics(b.errors),
                          .elsewhere = static_cast<double>(b.elsewhere) / static_cast<double>(b.seen),
                          .covered = static_cast<double>(b.errors.size()) / static_cast<double>(b.seen)});
    return ranges;
  }

 private:
  struct Band {
    std::vector<double> errors;
    std::size_t seen = 0, elsewhere = 0;
  };
  std::array<Band, kRanges.size() - 1> bands_;
};

bool is_one_of(const std::vector<double>& times, double time) {
  const auto next = std::lower_bound(times.begin(), times.end(), time - kMaxTimestampDifference);
  return next != times.end() && *next <= time + kMaxTimestampDifference;
}

}  // namespace

MapError evaluate_map(const std::vector<Mesh>& parts, Source& recording, const Trajectory& world_from_camera,
                      std::vector<double> keyframes, int step, bool only_held_out, double clock_offset) {
  std::sort(keyframes.begin(), keyframes.end());
  MapError error;
  DepthErrors depth;
  ViewComparison views(parts, recording.rig());
  for (int i = 0; auto frame = recording.next();) {
    const auto pose = frame_pose(world_from_camera, frame->timestamp);
    if (only_held_out && !frame->held_out) continue;
    if (frame->problem || !pose || is_one_of(keyframes, frame->timestamp) || i++ % step != 0) continue;
    const Rig& rig = recording.rig();
    rig.depth_correction.apply(rig.depth.width, rig.depth.height, frame->depth);
    const Vector6d velocity = velocity_at(world_from_camera, frame->timestamp);
    depth.add(views.compare_depth(*frame, *pose, velocity));
    const double delay = frame->color_delay - clock_offset;
    if (!frame->color.empty()) views.compare_color(std::move(*frame), *pose, velocity, delay);
    ++error.frames;
  }
  if (error.frames == 0)
    throw std::runtime_error(std::string(only_held_out ? "no held-out frame" : "no frame of the recording") +
                             " has a pose in the map's trajectory: was the map made from another recording?");
  error.ranges = depth.ranges();
  error.psnr = views.psnr();
  error.psnr_with_gain = views.psnr_with_gain();
  error.doubled = Sheets(parts).doubled();
  return error;
}

LoopDrift evaluate_loop_drift(const std::vector<MeasuredLoop>& loops, const Trajectory& world_from_camera) {
  std::vector<double> shifts, turns;
  for (const MeasuredLoop& loop : loops) {
    const auto from = frame_pose(world_from_camera, loop.from), to = frame_pose(world_from_camera, loop.to);
    if (!from || !to) continue;
    const Eigen::Isometry3d drift = (from->inverse() * *to).inverse() * loop.i_from_j;
    shifts.push_back(drift.translation().norm());
    turns.push_back(Eigen::AngleAxisd(drift.linear()).angle());
  }
  return {statistics(std::move(shifts)), statistics(std::move(turns))};
}

}  // namespace cairn
