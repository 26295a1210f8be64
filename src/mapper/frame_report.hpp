// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Results of checking and tracking a frame in its report.
#pragma once
#include "cairn/mapping/reports.hpp"
#include "mapper/checked_frame.hpp"
#include "mapper/tracker.hpp"

namespace cairn {

/// Covariance of a tracked pose, see FrameReport::covariance. Requires TrackingResult::information.
[[nodiscard]] Matrix6d covariance_of(const TrackingResult& tracked);

void fill(const CheckedFrame& checked, FrameReport& report);
void fill(const TrackingResult& tracked, FrameReport& report);

}  // namespace cairn
