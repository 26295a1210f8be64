// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "gravity/structure.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>

namespace cairn {
namespace {

constexpr int kPatchesPerRow = 40, kMinPatchSide = 4;  // per image row; pixels
constexpr int kSamplesPerSide = 8;                     // sampled pixels per side: pixels between them are correlated
constexpr double kMinMeasuredShare = 0.7;              // min. share of measured pixels in a patch
constexpr double kMaxFlatResidual = 3;     // max. residual of a flat patch, in standard deviations of depth noise
constexpr double kMinCosine = 0.25;        // min. cosine between normal and ray
constexpr double kNoiseCorrelation = 2;    // correlation of neighboring pixels: factor on the noise of a slope
constexpr double kHalfWeightAngle = 0.05;  // rad of angular noise at which a patch's weight is halved
// Cosines of 8 and 6 degrees: patches with similar normals.
constexpr float kSameNormalCosine = 0.9903f, kMeanNormalCosine = 0.9945f;
constexpr float kMinFacingShare = 0.01f;  // share of the area: smaller facings are dropped
constexpr int kMeanIterations = 3;        // iterations of the mean

struct Patch {
  Eigen::Vector3f normal;
  float area;
};

/// Plane fit of a patch: inverse depth is linear in the ray (x, y), 1/z = a x + b y + c, with nearly uniform noise. The
/// plane is a X + b Y + c Z = 1.
class PlaneFit {
 public:
  PlaneFit(double x, double y) : x_(x), y_(y) {}
  void add(double x, double y, double z) {
    const Eigen::Vector3d v(x - x_, y - y_, 1);
    const double q = 1 / z;
    squares_.noalias() += v * v.transpose();
    products_ += q * v;
    square_ += q * q;
    ++count_;
  }
  [[nodiscard]] int count() const { return count_; }
  /// The plane's (a, b, c), and the root mean square residual in inverse depth.
  [[nodiscard]] std::pair<Eigen::Vector3d, double> solve() const {
    const Eigen::Vector3d local = squares_.ldlt().solve(products_);
    const double rmse = std::sqrt(std::max(0.0, (square_ - local.dot(products_)) / count_));
    return {{local.x(), local.y(), local.z() - local.x() * x_ - local.y() * y_}, rmse};
  }

 private:
  double x_, y_;  // near the patch's center, for numerical accuracy
  Eigen::Matrix3d squares_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d products_ = Eigen::Vector3d::Zero();
  double square_ = 0;
  int count_ = 0;
};

/// Removes the dominant group of patches with similar normals from `left` and returns its facing. Empty if no patch is
/// left.
std::optional<Structure::Facing> take_facing(std::vector<Patch>& patches, const std::vector<float>& support,
                                             std::vector<std::size_t>& left) {
  if (left.empty()) return std::nullopt;
  const std::size_t seed = *std::max_element(left.begin(), left.end(),
                                             [&](std::size_t a, std::size_t b) { return support[a] < support[b]; });
  Eigen::Vector3f mean = patches[seed].normal;
  for (int i = 0; i < kMeanIterations; ++i) {
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    for (const std::size_t k : left)
      if (patches[k].normal.dot(mean) > kMeanNormalCosine) sum += patches[k].area * patches[k].normal;
    if (sum.norm() > 0) mean = sum.normalized();
  }
  Structure::Facing facing{.normal = mean, .area = 0};
  std::erase_if(left, [&](std::size_t k) {
    const bool is_member = k == seed || patches[k].normal.dot(mean) > kSameNormalCosine;
    if (is_member) facing.area += patches[k].area;
    return is_member;
  });
  return facing;
}

}  // namespace

StructureFinder::StructureFinder(const Rig& rig)
    : camera_(rig.depth),
      sensor_(rig.sensor),
      side_(std::max(kMinPatchSide, rig.depth.width / kPatchesPerRow)),
      step_(std::max(1, side_ / kSamplesPerSide)) {
  rays_.reserve(static_cast<std::size_t>(camera_.width) * static_cast<std::size_t>(camera_.height));
  for (int v = 0; v < camera_.height; ++v)
    for (int u = 0; u < camera_.width; ++u) rays_.emplace_back(camera_.undistorted_ray(u, v).cast<float>());
}

Structure StructureFinder::find(const std::vector<float>& depth) const {
  Structure structure;
  std::vector<Patch> patches;
  const int samples_per_row = (side_ + step_ - 1) / step_,
            min_count = static_cast<int>(kMinMeasuredShare * samples_per_row * samples_per_row);
  for (int top = 0; top + side_ <= camera_.height; top += side_)
    for (int left = 0; left + side_ <= camera_.width; left += side_) {
      const auto pixel = [&](int u, int v) {
        return static_cast<std::size_t>(top + v) * static_cast<std::size_t>(camera_.width) +
               static_cast<std::size_t>(left + u);
      };
      const Eigen::Vector2d center = rays_[pixel(side_ / 2, side_ / 2)].cast<double>();
      PlaneFit fit(center.x(), center.y());
      for (int v = 0; v < side_; v += step_)
        for (int u = 0; u < side_; u += step_) {
          const std::size_t i = pixel(u, v);
          if (const float z = depth[i]; z >= sensor_.min_depth && z <= sensor_.max_depth)
            fit.add(static_cast<double>(rays_[i].x()), static_cast<double>(rays_[i].y()), static_cast<double>(z));
        }
      if (fit.count() < min_count) continue;
      const auto [plane, rmse] = fit.solve();
      const Eigen::Vector3d ray(center.x(), center.y(), 1);
      const double z = 1 / plane.dot(ray), width = side_ * z / camera_.fx, height = side_ * z / camera_.fy;
      const double along = plane.dot(ray) / plane.norm(), cosine = along / ray.norm();
      if (!(z > 0 && std::isfinite(z) && cosine > 0)) continue;
      const double noise = static_cast<double>(sensor_.sigma(static_cast<float>(z)));
      const double slope_sigma = kNoiseCorrelation * noise * std::sqrt(12.0 / fit.count()) / width;
      const double area = width * height / std::max(along, kMinCosine) /
                          (1 + slope_sigma * slope_sigma / (kHalfWeightAngle * kHalfWeightAngle));
      if (cosine < kMinCosine || rmse * z * z > kMaxFlatResidual * noise) continue;
      structure.area += static_cast<float>(area);
      patches.push_back({(-plane / plane.norm()).cast<float>(), static_cast<float>(area)});
    }

  std::vector<float> support(patches.size(), 0);
  for (std::size_t i = 0; i < patches.size(); ++i)
    for (std::size_t k = 0; k < patches.size(); ++k)
      if (patches[i].normal.dot(patches[k].normal) > kMeanNormalCosine) support[i] += patches[k].area;
  std::vector<std::size_t> rest(patches.size());
  for (std::size_t i = 0; i < rest.size(); ++i) rest[i] = i;
  while (structure.facings.size() < Structure::kFacings) {
    const auto facing = take_facing(patches, support, rest);
    if (!facing) break;
    if (facing->area > kMinFacingShare * structure.area) structure.facings.push_back(*facing);
  }
  return structure;
}

}  // namespace cairn
