// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/io/find_color_camera.hpp"

#include <ceres/ceres.h>
#include <ceres/cubic_interpolation.h>
#include <ceres/rotation.h>
#include <tbb/parallel_for.h>
#include <tbb/task_group.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <deque>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "geometry/undistortion_map.hpp"

namespace cairn {
namespace {

constexpr float kJump = 0.04f;            // relative depth jump behind an edge
constexpr float kSmooth = 0.02f;          // maximum relative slope in front of an edge, over two pixels
constexpr float kMaxDepth = 4;            // meters
constexpr std::size_t kMaxPoints = 1500;  // maximum number of edge points per frame
constexpr std::size_t kMinPoints = 4000;  // minimum number of points in all frames
constexpr double kReferenceWidth = 640;   // reference width in pixels for kBlurs; wider color images are halved
constexpr double kContrast = 6;           // gray levels per pixel at which a color edge counts fully
constexpr double kMinImprovement = 1.1;   // required agreement, relative to the nominal camera
constexpr std::array kBlurs = {6.0, 3.0, 1.5, 0.8};          // pixels, from coarse to fine
constexpr std::array<std::size_t, 4> kSteps = {6, 4, 2, 1};  // point spacing; adjacent points share a blurred edge

using Parameters = std::array<double, 7>;  // rotation vector, translation in meters, focal scale - 1
// Typical deviation from the nominal camera, and the weight of its penalty as a share of the number of points.
constexpr Parameters kTypicalDeviation = {0.02, 0.02, 0.02, 0.03, 0.03, 0.03, 0.05};
constexpr double kPrior = 4e-4;
constexpr double kMaxDeviation = 4;  // bound in multiples of kTypicalDeviation; a solution at the bound is a failure

/// A point on the near side of a depth edge.
struct EdgePoint {
  Eigen::Vector3d position;  // in the nominal color camera's frame
  bool upright;              // vertical edge: depth jumps along a row
};

struct View {
  std::vector<EdgePoint> points;
  cv::Mat smoothed;  // brightness, undistorted
};

/// Edge strength across rows and across columns, 0 to 255.
struct EdgeImages {
  using Grid = ceres::Grid2D<std::uint8_t>;
  using Interpolator = ceres::BiCubicInterpolator<Grid>;

  cv::Mat upright, level;
  Grid upright_grid, level_grid;
  Interpolator at_upright, at_level;

  EdgeImages(const cv::Mat& smoothed, double blur)
      : upright(strength(smoothed, 1, 0, blur)),
        level(strength(smoothed, 0, 1, blur)),
        upright_grid(upright.data, 0, smoothed.rows, 0, smoothed.cols),
        level_grid(level.data, 0, smoothed.rows, 0, smoothed.cols),
        at_upright(upright_grid),
        at_level(level_grid) {}
  EdgeImages(const EdgeImages&) = delete;
  EdgeImages& operator=(const EdgeImages&) = delete;

  static cv::Mat strength(const cv::Mat& smoothed, int dx, int dy, double blur) {
    cv::Mat slope, strong;
    cv::Sobel(smoothed, slope, CV_16S, dx, dy);
    cv::convertScaleAbs(slope, strong, 255 / (8 * kContrast));
    cv::GaussianBlur(strong, strong, {}, blur);
    return strong;
  }
};

/// Residual of a depth edge: 1 minus the strength of the color edge at its pixel, 0 to 1.
struct MissingEdge {
  const EdgePoint* point;
  const EdgeImages* images;
  const Camera* camera;

  template <class T>
  bool operator()(const T* x, T* missing) const {
    T row, column, strength;
    if (!pixel(x, row, column)) return false;
    (point->upright ? images->at_upright : images->at_level).Evaluate(row, column, &strength);
    missing[0] = T(1) - strength * T(1.0 / 255);
    return true;
  }
  template <class T>
  bool pixel(const T* x, T& row, T& column) const {
    const std::array<T, 3> p = {T(point->position.x()), T(point->position.y()), T(point->position.z())};
    std::array<T, 3> q;
    ceres::AngleAxisRotatePoint(x, p.data(), q.data());
    for (std::size_t i = 0; i < 3; ++i) q[i] += x[3 + i];
    if (q[2] <= T(0)) return false;
    const T scale = (T(1) + x[6]) / q[2];
    column = camera->fx * scale * q[0] + camera->cx;
    row = camera->fy * scale * q[1] + camera->cy;
    return true;
  }
};

struct Prior {
  double weight;
  template <class T>
  bool operator()(const T* x, T* residual) const {
    for (std::size_t i = 0; i < kTypicalDeviation.size(); ++i) residual[i] = T(weight / kTypicalDeviation[i]) * x[i];
    return true;
  }
};

/// Residuals of all edge points by the 7 parameters, evaluated in parallel: each point writes its own row.
class MissingEdges : public ceres::SizedCostFunction<ceres::DYNAMIC, 7> {
 public:
  explicit MissingEdges(const std::vector<MissingEdge>& terms) : terms_(terms) {
    set_num_residuals(static_cast<int>(terms.size()));
  }
  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    using Jet = ceres::Jet<double, 7>;
    const double* x = parameters[0];
    double* rows = jacobians == nullptr ? nullptr : jacobians[0];
    std::array<Jet, 7> variables;
    for (int i = 0; i < 7; ++i) variables[static_cast<std::size_t>(i)] = Jet(x[i], i);
    std::atomic<bool> is_valid = true;
    tbb::parallel_for(std::size_t{0}, terms_.size(), [&](std::size_t i) {
      if (rows == nullptr) {
        if (!terms_[i](x, residuals + i)) is_valid = false;
        return;
      }
      Jet missing;
      if (!terms_[i](variables.data(), &missing)) is_valid = false;
      residuals[i] = missing.a;
      Eigen::Map<Eigen::Matrix<double, 7, 1>>(rows + 7 * i) = missing.v;
    });
    return is_valid;
  }

 private:
  const std::vector<MissingEdge>& terms_;
};

/// All views at one blur.
class Level {
 public:
  /// Uses every `step`-th point.
  Level(const std::vector<View>& views, const Camera& camera, double blur, std::size_t step)
      : camera_(camera), images_(views.size()) {
    tbb::parallel_for(std::size_t{0}, views.size(),
                      [&](std::size_t i) { images_[i] = std::make_unique<EdgeImages>(views[i].smoothed, blur); });
    for (std::size_t k = 0; k < views.size(); ++k)
      for (std::size_t i = 0; i < views[k].points.size(); i += step)
        terms_.push_back({&views[k].points[i], images_[k].get(), &camera_});
  }

  /// Mean strength of color edges at the projected depth edges, 0 to 1.
  [[nodiscard]] double agreement(const Parameters& x) const {
    double sum = 0;
    std::size_t count = 0;
    for (const MissingEdge& term : terms_) {
      double row = 0, column = 0, missing = 0;
      if (!term.pixel(x.data(), row, column) || row < 0 || column < 0 || row > camera_.height - 1 ||
          column > camera_.width - 1)
        continue;
      term(x.data(), &missing);
      sum += 1 - missing;
      ++count;
    }
    return 2 * count < terms_.size() ? 0 : sum / static_cast<double>(count);
  }

  [[nodiscard]] Parameters refine(Parameters x) const {
    ceres::Problem problem;
    problem.AddResidualBlock(new MissingEdges(terms_), nullptr, x.data());
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<Prior, 7, 7>(new Prior{std::sqrt(kPrior * static_cast<double>(terms_.size()))}),
        nullptr, x.data());
    for (int i = 0; i < 7; ++i) {
      const double bound = kMaxDeviation * kTypicalDeviation[static_cast<std::size_t>(i)];
      problem.SetParameterLowerBound(x.data(), i, -bound);
      problem.SetParameterUpperBound(x.data(), i, bound);
    }
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    options.max_num_iterations = 25;
    options.function_tolerance = 1e-5;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    return x;
  }

 private:
  Camera camera_;
  std::vector<std::unique_ptr<EdgeImages>> images_;
  std::vector<MissingEdge> terms_;
};

class DepthEdges {
 public:
  explicit DepthEdges(const Rig& rig) : depth_(rig.depth), color_from_depth_(rig.depth_from_color().inverse()) {}

  [[nodiscard]] std::vector<EdgePoint> operator()(const std::vector<float>& depth) const {
    constexpr std::array<std::array<int, 2>, 4> kAround = {{{1, 0}, {-1, 0}, {0, 1}, {0, -1}}};
    const cv::Mat z(depth_.height, depth_.width, CV_32F, const_cast<float*>(depth.data()));
    std::vector<EdgePoint> all;
    for (int y = 4; y < depth_.height - 4; ++y)
      for (int x = 4; x < depth_.width - 4; ++x) {
        const float here = z.at<float>(y, x);
        if (here <= 0 || here > kMaxDepth) continue;
        for (const auto [dx, dy] : kAround) {
          const float next = z.at<float>(y + dy, x + dx), behind = z.at<float>(y + 2 * dy, x + 2 * dx),
                      before = z.at<float>(y - 2 * dy, x - 2 * dx);
          const bool jumps = behind > here * (1 + kJump) && (next <= 0 || next > here * (1 + kJump / 2));
          if (!jumps || std::abs(before - here) > kSmooth * here) continue;
          const Eigen::Vector2d ray = depth_.undistorted_ray(x + 0.5 * dx, y + 0.5 * dy);
          all.push_back({color_from_depth_ * (static_cast<double>(here) * ray.homogeneous()), dx != 0});
        }
      }
    const std::size_t step = (all.size() + kMaxPoints - 1) / kMaxPoints;
    std::vector<EdgePoint> selected;
    for (std::size_t i = 0; i < all.size(); i += step) selected.push_back(all[i]);
    return selected;
  }

 private:
  Camera depth_;
  Eigen::Isometry3d color_from_depth_;
};

/// Smoothed, undistorted brightness of color images, at the resolution of kBlurs.
class GrayImages {
 public:
  explicit GrayImages(const Camera& camera) : raw_(camera), camera_(camera.rectified()) {
    for (int side = camera.width; side > kReferenceWidth * 1.5; side /= 2) camera_ = camera_.at_level(1);
    pixel_map_ = undistortion_map(raw_, camera_);
  }
  [[nodiscard]] const Camera& camera() const { return camera_; }
  [[nodiscard]] cv::Mat operator()(const std::vector<std::uint32_t>& color) const {
    const cv::Mat rgba(raw_.height, raw_.width, CV_8UC4, const_cast<std::uint32_t*>(color.data()));
    cv::Mat gray, undistorted;
    cv::cvtColor(rgba, gray, cv::COLOR_RGBA2GRAY);
    const double shrink = static_cast<double>(raw_.width) / camera_.width;
    if (shrink > 1) cv::GaussianBlur(gray, gray, {}, 0.5 * shrink);
    cv::remap(gray, undistorted, pixel_map_, {}, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
    cv::GaussianBlur(undistorted, undistorted, {}, 1.2);
    return undistorted;
  }

 private:
  Camera raw_, camera_;
  cv::Mat pixel_map_;
};

std::vector<View> views_of(Source& source, const GrayImages& gray, int frames) {
  const DepthEdges edges(source.rig());
  const auto pixels_of = [](const Camera& c) {
    return static_cast<std::size_t>(c.width) * static_cast<std::size_t>(c.height);
  };
  const std::size_t depth_pixels = pixels_of(source.rig().depth), color_pixels = pixels_of(source.rig().color_view());
  constexpr int kDefaultStep = 15;  // for sources of unknown length
  const int step = source.size() ? std::max(1, *source.size() / frames) : kDefaultStep;
  std::deque<View> views;  // keeps its elements in place
  tbb::task_group tasks;   // beside decoding
  for (int i = 0; static_cast<int>(views.size()) < frames; ++i) {
    if (i % step != 0 && source.next_timestamp()) {
      source.skip();
      continue;
    }
    auto frame = source.next();
    if (!frame) break;
    if (i % step == 0 && !frame->problem && frame->depth.size() == depth_pixels && frame->color.size() == color_pixels)
      tasks.run([&edges, &gray, &view = views.emplace_back(), seen = std::make_shared<Frame>(std::move(*frame))] {
        view = {edges(seen->depth), gray(seen->color)};
      });
  }
  tasks.wait();
  return {std::make_move_iterator(views.begin()), std::make_move_iterator(views.end())};
}

}  // namespace

std::optional<Rig> find_color_camera(Source& source, int frames) {
  const Rig nominal = source.rig();
  const GrayImages gray(nominal.color_view());
  const std::vector<View> views = views_of(source, gray, frames);
  std::size_t points = 0;
  for (const View& view : views) points += view.points.size();
  if (points < kMinPoints) return std::nullopt;

  // Detail below the size of a depth pixel carries no information.
  const double scale = std::max(gray.camera().width / kReferenceWidth, gray.camera().fx / nominal.depth.fx);
  Parameters x{};
  {
    const Level coarse(views, gray.camera(), kBlurs[0] * scale, kSteps[0]);
    double best = 0;
    for (const double focal_scale : {0.0, -0.04, 0.04, -0.08, 0.08, -0.12, 0.12}) {
      const Parameters other = {0, 0, 0, 0, 0, 0, focal_scale};
      if (const double a = coarse.agreement(other); a > best) best = a, x = other;
    }
  }
  double agreement_after = 0, agreement_before = 0;
  for (std::size_t i = 0; i < kBlurs.size(); ++i) {
    const Level level(views, gray.camera(), kBlurs[i] * scale, kSteps[i]);
    x = level.refine(x);
    agreement_after = level.agreement(x);
    agreement_before = level.agreement({});
  }
  bool within_bounds = true;
  for (std::size_t i = 0; i < x.size(); ++i)
    within_bounds &= std::abs(x[i]) < 0.99 * kMaxDeviation * kTypicalDeviation[i];
  if (!within_bounds || !(agreement_after > kMinImprovement * agreement_before)) return std::nullopt;
  ColorCamera color{.camera = nominal.color_view(), .color_from_depth = nominal.depth_from_color().inverse()};
  color.camera.fx *= 1 + x[6];
  color.camera.fy *= 1 + x[6];
  const Eigen::Vector3d rotation(x[0], x[1], x[2]);
  Eigen::Isometry3d correction = Eigen::Isometry3d::Identity();
  if (rotation.norm() > 0)
    correction.linear() = Eigen::AngleAxisd(rotation.norm(), rotation.normalized()).toRotationMatrix();
  correction.translation() << x[3], x[4], x[5];
  color.color_from_depth = correction * color.color_from_depth;
  Rig rig = nominal;
  rig.color = color;
  check(rig);
  return rig;
}

}  // namespace cairn
