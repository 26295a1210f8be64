// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Unknowns shared by all views: row times, cameras, and the depth correction.
#include <tbb/parallel_for.h>

#include <algorithm>
#include <vector>

#include "bundle/bundle_equations.hpp"

namespace cairn {
namespace {

constexpr int kNodesAcross = 14;                            // across the camera's own image; equal spacing down
constexpr int kMinWidth = 64, kMinHeight = 48;              // pixels: min. size of an image for the correction
constexpr double kClockPrior = 0.02, kReadoutPrior = 0.02;  // s; standard deviations, like all priors
constexpr double kStretchPrior = 0.02, kShiftPrior = 0.02, kBendPrior = 0.1;
constexpr double kRotationPrior = 0.02, kPositionPrior = 0.01;  // rad, m
constexpr double kOffsetPrior = 0.005;                          // 1/m
constexpr double kSmoothnessPrior = 0.002;                      // 1/m, of the difference of neighbors
constexpr double kMinNodeInformation =
    1e4;  // m^2: a node with a standard deviation above a hundredth of 1/m stays at zero
constexpr double kFixedInformation = 1e14;

constexpr double information_of(double sigma) { return 1 / (sigma * sigma); }

}  // namespace

Rig Bundle::rig() const {
  Rig rig = cameras_.rig;
  rig.depth = shared_.depth.applied_to(rig.depth);
  if (rig.color) *rig.color = {shared_.color.applied_to(rig.color->camera), shared_.color_from_depth};
  return rig;
}

void Bundle::find_correction() {
  const Camera& own = cameras_.rig.depth;
  if (own.width < kMinWidth || own.height < kMinHeight) return;
  DepthCorrection& c = shared_.correction;
  c.columns = kNodesAcross, c.rows = std::max(2, kNodesAcross * own.height / own.width);
  c.offsets.assign(static_cast<std::size_t>(c.columns * c.rows), 0.0f);
  places_.clear();
  for (int y = 0; y < cameras_.depth.height; ++y)
    for (int x = 0; x < cameras_.depth.width; ++x) places_.push_back(cameras_.measured_at(x, y));
  offsets_.assign(places_.size(), 0);
  tolerance_ = kFirstTolerance;
}

void Bundle::forget_correction() {
  shared_.correction = {};
  places_.clear(), offsets_.clear();
}

/// Updates the lookup tables by pixel.
void Bundle::refresh() {
  const Camera& camera = cameras_.depth;
  rays_.resize(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
  tbb::parallel_for(0, camera.height, [&](int y) {
    for (int x = 0; x < camera.width; ++x)
      rays_[at(camera, x, y)] = shared_.depth.from_nominal(camera.ray(x, y).head<2>()).homogeneous();
  });
  for (std::size_t i = 0; i < offsets_.size(); ++i) offsets_[i] = shared_.correction.at(places_[i].x(), places_[i].y());
}

void Bundle::move_shared(const Eigen::VectorXd& step) {
  shared_.shutter.clock += step[kClock], shared_.shutter.readout += step[kReadout];
  if (finds_cameras_) {
    shared_.depth.value += step.segment<CameraChange::kUnknowns>(kDepthCamera);
    shared_.color.value += step.segment<CameraChange::kUnknowns>(kColorCamera);
    shared_.color_from_depth = retract(step.segment<6>(kColorPose)) * shared_.color_from_depth;
  }
  std::vector<float>& offsets = shared_.correction.offsets;
  for (std::size_t i = 0; i < offsets.size(); ++i)
    offsets[i] += static_cast<float>(step[shared_unknowns() + static_cast<int>(i)]);
  refresh();
}

/// Zero-mean priors.
void Bundle::add_priors(Equations& e) const {
  Part& part = e.reduced;
  const auto add = [&](int i, double sigma, double value) {
    part.corner(i, i) += information_of(sigma);
    part.corner_right[i] -= information_of(sigma) * value;
    e.cost += information_of(sigma) * value * value;
  };
  add(kClock, kClockPrior, shared_.shutter.clock);
  if (finds_readout_)
    add(kReadout, kReadoutPrior, shared_.shutter.readout);
  else
    part.corner(kReadout, kReadout) += kFixedInformation;
  if (finds_cameras_) {
    CameraChange::Unknowns of_camera;
    of_camera << kStretchPrior, kStretchPrior, kShiftPrior, kShiftPrior, kBendPrior;
    for (int i = 0; i < CameraChange::kUnknowns; ++i) {
      add(kDepthCamera + i, of_camera[i], shared_.depth.value[i]);
      add(kColorCamera + i, of_camera[i], shared_.color.value[i]);
    }
    const Vector6d moved = local_coordinates(shared_.color_from_depth * cameras_.rig.depth_from_color());
    for (int i = 0; i < 6; ++i) add(kColorPose + i, i < 3 ? kRotationPrior : kPositionPrior, moved[i]);
  }
  add_priors_of_nodes(e);
}

void Bundle::add_priors_of_nodes(Equations& e) const {
  Part& part = e.reduced;
  const DepthCorrection& c = shared_.correction;
  const auto offset = [&](int i) { return static_cast<double>(c.offsets[static_cast<std::size_t>(i)]); };
  const auto is_seen = [&](int i) { return part.node_information[static_cast<std::size_t>(i)] > kMinNodeInformation; };
  const int first = shared_unknowns(), nodes = c.columns * c.rows;
  const auto smooth = [&](int i, int j) {
    if (!is_seen(i) || !is_seen(j)) return;
    constexpr double kInformation = information_of(kSmoothnessPrior);
    const double difference = offset(i) - offset(j);
    part.corner(first + i, first + i) += kInformation, part.corner(first + j, first + j) += kInformation;
    part.corner(first + j, first + i) -= kInformation;
    part.corner_right[first + i] -= kInformation * difference,
        part.corner_right[first + j] += kInformation * difference;
    e.cost += kInformation * difference * difference;
  };
  for (int i = 0; i < nodes; ++i) {
    constexpr double kInformation = information_of(kOffsetPrior);
    part.corner(first + i, first + i) +=
        is_seen(i) ? kInformation : kFixedInformation;  // an unseen node keeps its value
    part.corner_right[first + i] -= kInformation * offset(i);
    e.cost += kInformation * offset(i) * offset(i);
    if ((i + 1) % c.columns != 0) smooth(i, i + 1);
    if (i + c.columns < nodes) smooth(i, i + c.columns);
  }
}

}  // namespace cairn
