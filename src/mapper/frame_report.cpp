// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "mapper/frame_report.hpp"

#include <Eigen/Eigenvalues>

#include "graph/inflate_information.hpp"

namespace cairn {

/// The alignment's information is in the frame of the predicted view.
Matrix6d covariance_of(const TrackingResult& tracked) {
  // Single-precision sums: unconstrained directions may have slightly negative eigenvalues.
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(tracked.alignment.information);
  const Matrix6d information =
      solver.eigenvectors() * solver.eigenvalues().cwiseMax(0.0).asDiagonal() * solver.eigenvectors().transpose();
  const Matrix6d in_view = (inflate_information(information) + Matrix6d::Identity()).inverse();
  const Matrix6d camera_from_view = adjoint(tracked.submap_from_camera.inverse() * tracked.predicted_from);
  return camera_from_view * in_view * camera_from_view.transpose();
}

void fill(const CheckedFrame& checked, FrameReport& report) {
  report.cause = checked.cause();
  report.reason = checked.reason();
}

void fill(const TrackingResult& tracked, FrameReport& report) {
  const Alignment& a = tracked.alignment;
  report.guess = tracked.guess;
  report.fit = a.fit;
  if (tracked.state != TrackingResult::State::lost) report.tracked_from_camera = tracked.submap_from_camera;
  if (tracked.information() != nullptr) report.covariance = covariance_of(tracked);
  if (tracked.cause == FrameCause::none) return;
  report.cause = tracked.cause;
  report.reason = tracked.reason;
  if (tracked.state == TrackingResult::State::lost && tracked.cause != FrameCause::too_little_depth)
    report.state = FrameState::lost;
}

}  // namespace cairn
