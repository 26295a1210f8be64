// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "splats/exposure.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace cairn {
namespace {

constexpr std::size_t kMaxPoints = 20000;     // of the surface
constexpr int kIterations = 8;                // of the alternation: gains converge to 1 % from a range of 1:2
constexpr float kMinColor = 0.03f;            // of 0..1; darker and
constexpr float kMaxColor = 0.97f;            // brighter values are clipped
constexpr float kMinGain = 0.2f;              // and its inverse
constexpr std::size_t kMinObservations = 50;  // of a view

struct Observation {
  std::uint32_t view = 0;
  Eigen::Array3f color = Eigen::Array3f::Zero();
};

/// By point: unclipped colors in the views that see it.
std::vector<std::vector<Observation>> observe(const std::vector<TrainingView>& views, const Mesh& mesh) {
  const std::vector<Eigen::Isometry3f> poses = camera_from_world(views);
  const std::size_t step = mesh.triangles.size() / kMaxPoints + 1;
  std::vector<std::vector<Observation>> points(mesh.triangles.size() / step);
  tbb::parallel_for(std::size_t{0}, points.size(), [&](std::size_t i) {
    const auto& t = mesh.triangles[i * step];
    const Eigen::Vector3f center = (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3;
    for (std::size_t v = 0; v < views.size(); ++v)
      if (const auto seen = seen_in(views[v], poses[v], center)) {
        const Eigen::Array3f color = color_at(views[v], seen->pixel).array();
        if ((color > kMinColor).all() && (color < kMaxColor).all())
          points[i].push_back({.view = static_cast<std::uint32_t>(v), .color = color});
      }
  });
  std::erase_if(points, [](const auto& seen) { return seen.size() < 2; });
  return points;
}

}  // namespace

void estimate_gains(std::vector<TrainingView>& views, const Mesh& mesh) {
  for (TrainingView& view : views) view.gain.setOnes();
  const std::vector<std::vector<Observation>> points = observe(views, mesh);
  struct Sums {
    Eigen::Array3f seen_color = Eigen::Array3f::Zero(), color_color = seen_color;
    std::size_t count = 0;
  };
  std::vector<Eigen::Array3f> gains(views.size(), Eigen::Array3f::Ones());
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    std::vector<Sums> sums(views.size());
    for (const auto& point : points) {
      Eigen::Array3f weighted = Eigen::Array3f::Zero(), weights = weighted;
      for (const Observation& o : point) weighted += gains[o.view] * o.color, weights += gains[o.view].square();
      const Eigen::Array3f color = weighted / weights;
      for (const Observation& o : point) {
        Sums& s = sums[o.view];
        s.seen_color += o.color * color, s.color_color += color.square();
        ++s.count;
      }
    }
    Eigen::Array3f log_mean = Eigen::Array3f::Zero();
    for (std::size_t v = 0; v < views.size(); ++v) {
      if (sums[v].count >= kMinObservations)
        gains[v] = (sums[v].seen_color / sums[v].color_color).max(kMinGain).min(1 / kMinGain);
      log_mean += gains[v].log() / static_cast<float>(views.size());
    }
    for (Eigen::Array3f& gain : gains) gain *= (-log_mean).exp();
  }
  for (std::size_t v = 0; v < views.size(); ++v) views[v].gain = gains[v];
}

}  // namespace cairn
