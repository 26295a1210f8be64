// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Depth noise from residuals of planes. A plane is affine in pixel coordinates in inverse depth. Structure is rejected
// by its curvature: a quadratic surface fits it better than a plane does, but fits noise as well as a plane.
#include "cairn/io/measure_noise.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

namespace cairn {
namespace {

constexpr int kReferenceWidth = 640;              // pixels
constexpr std::array kPatchSides = {12, 24, 48};  // pixels at the reference width
constexpr int kMinPatchSide = 6;                  // pixels
constexpr double kMinMeasuredRatio = 0.85;        // of a patch's pixels
constexpr double kMaxOutlierRatio = 0.05;         // of a patch's measurements
constexpr double kOutlierSigmas = 4.5;            // of the first fit's residual
constexpr double kMaxSlope = 1;                   // tangent of the angle to the image plane
constexpr double kMinDepth = 0.1;                 // meters
constexpr double kMaxRelativeSigma = 0.1;         // of the depth
constexpr double kMaxCurvatureRatio = 1.12;       // of the residual variances of plane and quadratic surface
constexpr double kCurvatureMargin = 1.05;         // of that ratio, relative to its first quartile
constexpr double kBinRatio = 1.2;                 // geometric bins of depth from kMinDepth
constexpr int kBins = 32;                         // up to 34 m
constexpr int kMinPatches = 20;                   // per bin
constexpr float kMinPatchesRatio = 0.02f;         // of all patches, of a bin that deviates from the model
constexpr float kMaxDeviation = 1.4f;             // of such a bin, as a factor
constexpr int kMinPairs = 8;                      // patches of each of two sizes, per bin
constexpr double kMaxSharpest = 2;                // meters, of the model
constexpr std::size_t kMaxValues = 400000;        // number of depths inspected for quantization
constexpr std::size_t kMinRepetitions = 4;        // mean number of pixels per distinct depth of a quantized image
constexpr float kEdgeJump = 0.05f;                // of the depth

/// Planar patch: depth at its center, residual variances of depth from a plane and from a quadratic surface.
struct Patch {
  double depth, plane_variance, quadratic_variance;
};

/// Fits to square patches of one size, with polynomials orthonormal on the pixel grid: the first three span planes.
class PatchFit {
 public:
  explicit PatchFit(int side) : side_(side) {
    basis_.resize(side * side, 6);
    for (int i = 0; i < side * side; ++i) {
      const int column = i % side, row = i / side;
      const double x = 2.0 * column / (side - 1) - 1, y = 2.0 * row / (side - 1) - 1;
      basis_.row(i) << 1, x, y, x * x, x * y, y * y;
    }
    for (int k = 0; k < 6; ++k) {
      const Eigen::VectorXd along = basis_.leftCols(k).transpose() * basis_.col(k);
      basis_.col(k) -= basis_.leftCols(k) * along;
      basis_.col(k).normalize();
    }
  }

  /// Fits the patch whose first pixel is `corner`; nullopt for holes, outliers, a steep surface, a large residual.
  [[nodiscard]] std::optional<Patch> fit(const float* corner, const Camera& camera, const DepthNoise& steps) const {
    const int n = side_ * side_;
    Eigen::VectorXd inverse(n), used(n);
    for (int i = 0; i < n; ++i) {
      const float z = corner[(i / side_) * camera.width + i % side_];
      used[i] = z > 0 ? 1 : 0;
      inverse[i] = z > 0 ? 1.0 / static_cast<double>(z) : 0;
    }
    const double measured = used.sum();
    if (measured < kMinMeasuredRatio * n) return std::nullopt;
    Eigen::VectorXd plane = solve(inverse, used, 3);
    Eigen::VectorXd residual = (inverse - basis_.leftCols(3) * plane).cwiseProduct(used);
    const double depth = 1 / (plane[0] * basis_(0, 0));
    const double half_step = 0.5 * static_cast<double>(steps.step(static_cast<float>(depth))) / (depth * depth);
    const double limit = kOutlierSigmas * std::sqrt(residual.squaredNorm() / measured) + half_step;
    if (residual.cwiseAbs().maxCoeff() > limit) {
      used = (residual.cwiseAbs().array() > limit).select(0, used);
      if (used.sum() < (1 - kMaxOutlierRatio) * measured) return std::nullopt;
      inverse = inverse.cwiseProduct(used);
      plane = solve(inverse, used, 3);
      residual = (inverse - basis_.leftCols(3) * plane).cwiseProduct(used);
    }
    const double x_slope = camera.fx * plane[1] * (basis_(1, 1) - basis_(0, 1));  // of the polynomials x and y
    const double y_slope = camera.fy * plane[2] * (basis_(side_, 2) - basis_(0, 2));
    if (std::hypot(x_slope, y_slope) * depth > kMaxSlope) return std::nullopt;
    if (!(depth > kMinDepth) ||
        residual.squaredNorm() * depth * depth > kMaxRelativeSigma * kMaxRelativeSigma * measured)
      return std::nullopt;
    const Eigen::VectorXd curved = (inverse - basis_ * solve(inverse, used, 6)).cwiseProduct(used);
    // Least error of a measurement rounded to a step: uniform. Smaller residuals occur within a single step.
    const double floor = half_step * half_step / 3, count = used.sum(), to_depth = std::pow(depth, 4);
    return Patch{.depth = depth,
                 .plane_variance = to_depth * std::max(residual.squaredNorm() / (count - 3), floor),
                 .quadratic_variance = to_depth * std::max(curved.squaredNorm() / (count - 6), floor)};
  }

 private:
  /// Coefficients of the first `terms` polynomials; `values` are zero where `used` is.
  [[nodiscard]] Eigen::VectorXd solve(const Eigen::VectorXd& values, const Eigen::VectorXd& used, int terms) const {
    const auto basis = basis_.leftCols(terms);
    Eigen::VectorXd projected = basis.transpose() * values;
    if (used.minCoeff() > 0) return projected;
    const Eigen::MatrixXd normal = basis.transpose() * used.asDiagonal() * basis;
    return normal.ldlt().solve(projected);
  }

  int side_;
  Eigen::MatrixXd basis_;
};

double quantile(std::vector<double> values, double ratio) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(ratio * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

double median(const std::vector<double>& values) { return quantile(values, 0.5); }

std::vector<Patch> fit_patches(const std::vector<std::vector<float>>& images, const Camera& camera,
                               const DepthNoise& steps, int side) {
  const PatchFit fit(side);
  std::vector<std::vector<Patch>> found(images.size());
  tbb::parallel_for(std::size_t{0}, images.size(), [&](std::size_t i) {
    for (int y = 0; y + side <= camera.height; y += side)
      for (int x = 0; x + side <= camera.width; x += side)
        if (const auto patch = fit.fit(&images[i][static_cast<std::size_t>(y * camera.width + x)], camera, steps))
          found[i].push_back(*patch);
  });
  std::vector<Patch> all;
  for (const auto& patches : found) all.insert(all.end(), patches.begin(), patches.end());
  return all;
}

int bin_of(double depth) {
  return std::clamp(static_cast<int>(std::log(depth / kMinDepth) / std::log(kBinRatio)), 0, kBins - 1);
}

/// Depth and residual variance of a bin: medians over its planar patches.
struct Bin {
  double depth = 0, variance = 0;
  int patches = 0;
};
using Bins = std::array<Bin, kBins>;

Bins planar_variances(const std::vector<Patch>& patches, int side) {
  std::vector<double> ratios;
  for (const Patch& p : patches)
    if (p.quadratic_variance > 0) ratios.push_back(p.plane_variance / p.quadratic_variance);
  // Independent noise: the ratio's standard deviation is sqrt(6) / n. Correlated noise is curved too.
  const double spread = 3 * std::sqrt(6.0) / (side * side);
  const double limit = std::max({kMaxCurvatureRatio, 1 + spread, kCurvatureMargin * quantile(ratios, 0.25)});
  std::array<std::vector<double>, kBins> depths, variances;
  for (const Patch& p : patches) {
    if (p.plane_variance > limit * p.quadratic_variance) continue;
    const auto bin = static_cast<std::size_t>(bin_of(p.depth));
    depths[bin].push_back(p.depth);
    variances[bin].push_back(p.plane_variance);
  }
  Bins bins;
  for (std::size_t i = 0; i < kBins; ++i)
    bins[i] = {
        .depth = median(depths[i]), .variance = median(variances[i]), .patches = static_cast<int>(depths[i].size())};
  return bins;
}

/// Median over depth of the ratio of two patch sizes' variances, at least 1; nullopt without common bins.
std::optional<double> variance_growth(const Bins& small, const Bins& large) {
  std::vector<std::pair<double, double>> ratios;  // with weights
  double total = 0;
  for (std::size_t i = 0; i < kBins; ++i) {
    if (small[i].patches < kMinPairs || large[i].patches < kMinPairs || small[i].variance <= 0) continue;
    ratios.emplace_back(large[i].variance / small[i].variance, std::sqrt(static_cast<double>(large[i].patches)));
    total += ratios.back().second;
  }
  if (ratios.empty()) return std::nullopt;
  std::sort(ratios.begin(), ratios.end());
  double sum = 0;
  for (const auto& [ratio, weight] : ratios)
    if ((sum += weight) >= total / 2) return std::max(ratio, 1.0);
  return std::max(ratios.back().first, 1.0);
}

/// Ratio of the noise's variance to the residual variance of the smallest patches, and the area of correlation.
struct Correlation {
  double variance_ratio = 1, area_px = 1;
};

/// Extrapolation to an infinite patch: a plane fitted to n pixels removes 3 A / n of the variance of noise with the
/// area of correlation A.
Correlation correlation_of(const std::vector<Bins>& sizes, const std::vector<int>& sides) {
  Correlation result;
  double last = 1;
  int side = sides[0];
  for (std::size_t i = 1; i < sizes.size(); ++i) {
    const auto growth = variance_growth(sizes[i - 1], sizes[i]);
    if (!growth) break;
    last = *growth, side = sides[i];
    result.variance_ratio *= last;
  }
  const double extrapolation = 1 + (1 - 1 / last) / 3;
  result.variance_ratio *= extrapolation;
  result.area_px = std::max(1.0, (1 - 1 / extrapolation) * side * side / 3);
  return result;
}

/// Weighted fit of floor and growth, both at least 0, to relative errors; returns the mean squared relative error.
double fit_growth(const std::vector<DepthNoise::Sample>& samples, const std::vector<double>& weights,
                  SensorModel& model) {
  const auto errors = [&](double floor, double growth) {
    double sum = 0, total = 0;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const double d = static_cast<double>(samples[i].depth - model.sharpest),
                   s = static_cast<double>(samples[i].sigma);
      sum += weights[i] * std::pow((floor + growth * d * d) / s - 1, 2);
      total += weights[i];
    }
    return sum / total;
  };
  double ff = 0, fg = 0, gg = 0, f = 0, g = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double d = static_cast<double>(samples[i].depth - model.sharpest), s = static_cast<double>(samples[i].sigma);
    const double a = 1 / s, b = d * d / s, w = weights[i];
    ff += w * a * a, fg += w * a * b, gg += w * b * b, f += w * a, g += w * b;
  }
  constexpr double kPrior = 1e-6;  // determines both terms where all samples have one depth
  ff *= 1 + kPrior, gg *= 1 + kPrior;
  const double determinant = ff * gg - fg * fg;
  double floor = (f * gg - g * fg) / determinant, growth = (g * ff - f * fg) / determinant;
  constexpr double kMinFloor = 1e-5;  // meters
  if (!(growth >= 0)) growth = 0, floor = f / ff;
  if (!(floor >= kMinFloor)) floor = kMinFloor, growth = std::max(0.0, (g - floor * fg) / gg);
  model.floor = static_cast<float>(floor), model.growth = static_cast<float>(growth);
  return errors(floor, growth);
}

SensorModel fit_model(const std::vector<DepthNoise::Sample>& samples) {
  std::vector<double> base, weights;
  for (const auto& s : samples) base.push_back(std::sqrt(std::min(s.patches, 400)));
  weights = base;
  SensorModel best;
  constexpr int kRounds = 4, kSteps = 40;
  for (int round = 0; round < kRounds; ++round) {
    double least = std::numeric_limits<double>::infinity();
    for (int i = 0; i <= kSteps; ++i) {
      SensorModel model;
      model.sharpest = static_cast<float>(kMaxSharpest * i / kSteps);
      constexpr double kMinImprovement = 0.98;  // an equal fit has its minimum at 0
      const double error = fit_growth(samples, weights, model);
      if (error < kMinImprovement * least) least = error, best = model;
    }
    constexpr double kHuber = 0.1;  // relative error
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const double error = std::abs(static_cast<double>(best.sigma(samples[i].depth) / samples[i].sigma) - 1);
      weights[i] = base[i] * std::min(1.0, kHuber / std::max(error, 1e-9));
    }
  }
  return best;
}

/// Steps between distinct depths, by bins. Constant, growing with depth^2, or both: the larger of two terms.
void measure_steps(const std::vector<float>& sorted, DepthNoise& noise) {
  for (std::size_t begin = 0, end = 0; begin < sorted.size(); begin = end) {
    const int bin = bin_of(static_cast<double>(sorted[begin]));
    std::vector<double> gaps, inverse_gaps;
    for (end = begin + 1; end < sorted.size() && bin_of(static_cast<double>(sorted[end])) == bin; ++end) {
      const auto near = static_cast<double>(sorted[end - 1]), far = static_cast<double>(sorted[end]);
      if (far > near) gaps.push_back(far - near), inverse_gaps.push_back(1 / near - 1 / far);
    }
    constexpr std::size_t kMinSteps = 4, kMinShare = 100;  // of a bin; of all values, as a divisor
    if (gaps.size() < kMinSteps ||
        end - begin < std::max(kMinRepetitions * (gaps.size() + 1), sorted.size() / kMinShare))
      continue;
    const double limit = 2 * median(gaps);  // wider gaps lack values
    double sum = 0, inverse_sum = 0, count = 0;
    for (std::size_t i = 0; i < gaps.size(); ++i)
      if (gaps[i] <= limit) sum += gaps[i], inverse_sum += inverse_gaps[i], ++count;
    const auto step = static_cast<float>(sum / count), inverse = static_cast<float>(inverse_sum / count);
    noise.depth_step = noise.depth_step > 0 ? std::min(noise.depth_step, step) : step;
    noise.inverse_depth_step = noise.inverse_depth_step > 0 ? std::min(noise.inverse_depth_step, inverse) : inverse;
  }
}

/// Holes, range and quantization.
void measure_values(const std::vector<std::vector<float>>& images, DepthNoise& noise) {
  const std::size_t pixels = images.size() * images[0].size();
  const std::size_t stride = pixels / kMaxValues + 1;
  std::vector<float> values;
  values.reserve(pixels / stride + 1);
  std::size_t inspected = 0, next = 0;
  for (const auto& image : images) {
    for (; next < image.size(); next += stride, ++inspected)
      if (image[next] > 0) values.push_back(image[next]);
    next -= image.size();
  }
  noise.holes = 1 - static_cast<float>(values.size()) / static_cast<float>(inspected);
  if (values.empty()) return;
  std::sort(values.begin(), values.end());
  noise.nearest = values[values.size() / 20], noise.farthest = values[values.size() - 1 - values.size() / 20];
  measure_steps(values, noise);
}

/// Share of depth edges along rows with a pixel between front and back, among edges with smooth surfaces on both sides.
float flying_share(const std::vector<std::vector<float>>& images, int width) {
  std::size_t flying = 0, clean = 0;
  for (const auto& image : images)
    for (std::size_t row = 0; row < image.size(); row += static_cast<std::size_t>(width))
      for (std::size_t i = row + 2; i + 3 < row + static_cast<std::size_t>(width); ++i) {
        const float* z = &image[i];
        const auto jumps = [&](int a, int b) {
          const float difference = std::abs(z[b] - z[a]);
          if (z[a - 1] <= 0 || z[a] <= 0 || z[b] <= 0 || z[b + 1] <= 0) return false;
          return difference > kEdgeJump * std::min(z[a], z[b]) && std::abs(z[a] - z[a - 1]) < 0.2f * difference &&
                 std::abs(z[b + 1] - z[b]) < 0.2f * difference;
        };
        if (jumps(0, 1)) ++clean;
        if (!jumps(-1, 1)) continue;
        const float share = (z[0] - z[-1]) / (z[1] - z[-1]);
        if (share > 0.2f && share < 0.8f) ++flying;
      }
  return flying + clean > 0 ? static_cast<float>(flying) / static_cast<float>(flying + clean) : 0.0f;
}

}  // namespace

std::optional<float> DepthNoise::sigma(float depth) const {
  constexpr float kMargin = 1.1f;
  if (samples.empty() || depth < samples.front().depth / kMargin || depth > samples.back().depth * kMargin)
    return std::nullopt;
  const auto above = std::find_if(samples.begin(), samples.end(), [&](const Sample& s) { return s.depth >= depth; });
  if (above == samples.begin()) return above->sigma;
  const auto below = above - 1;
  if (above == samples.end()) return below->sigma;
  const float share = std::log(depth / below->depth) / std::log(above->depth / below->depth);
  return below->sigma * std::pow(above->sigma / below->sigma, share);
}

DepthNoise measure_depth_noise(const std::vector<std::vector<float>>& images, const Camera& camera) {
  DepthNoise noise;
  noise.frames = static_cast<int>(images.size());
  if (images.empty()) return noise;
  const std::size_t pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  for (const auto& image : images)
    if (image.size() != pixels)
      throw std::runtime_error(
          fmt::format("depth image of {} pixels: the camera has {}x{}", image.size(), camera.width, camera.height));
  measure_values(images, noise);
  noise.flying = flying_share(images, camera.width);
  std::vector<int> sides;
  std::vector<Bins> sizes;
  const int smallest = std::max(kMinPatchSide, (kPatchSides[0] * camera.width + kReferenceWidth / 2) / kReferenceWidth);
  for (const int side : kPatchSides) {
    sides.push_back(smallest * side / kPatchSides[0]);
    sizes.push_back(planar_variances(fit_patches(images, camera, noise, sides.back()), sides.back()));
  }
  const Correlation correlation = correlation_of(sizes, sides);
  noise.correlation_px = static_cast<float>(std::sqrt(correlation.area_px));
  for (const Bin& bin : sizes[0]) {
    noise.patches += bin.patches;
    if (bin.patches < kMinPatches || bin.variance <= 0) continue;
    noise.samples.push_back({.depth = static_cast<float>(bin.depth),
                             .sigma = static_cast<float>(std::sqrt(bin.variance * correlation.variance_ratio)),
                             .patches = bin.patches});
  }
  if (noise.samples.empty()) return noise;
  noise.model = fit_model(noise.samples);
  // Few patches of an unusual surface, such as a carpet or a plant.
  const auto deviates = [&](const DepthNoise::Sample& s) {
    const float ratio = s.sigma / noise.model.sigma(s.depth);
    return static_cast<float>(s.patches) < kMinPatchesRatio * static_cast<float>(noise.patches) &&
           (ratio > kMaxDeviation || ratio < 1 / kMaxDeviation);
  };
  if (std::erase_if(noise.samples, deviates) > 0 && !noise.samples.empty()) noise.model = fit_model(noise.samples);
  return noise;
}

}  // namespace cairn
