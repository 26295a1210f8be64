// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "eval/speeds.hpp"

#include <algorithm>
#include <istream>
#include <ostream>

namespace cairn {
namespace {

/// Share of the tracker's limits (MotionOptions): hand motion remains below, slipped tracking does not.
constexpr double kLimitRatio = 0.75;

void update_peak(Speeds::Peak& peak, double value, double limit, double timestamp) {
  peak.steps += value > limit;
  if (value > peak.value) peak.value = value, peak.timestamp = timestamp;
}

}  // namespace

double Speeds::speed_limit() const { return kLimitRatio * static_cast<double>(motion_.max_speed); }
double Speeds::turn_limit() const { return kLimitRatio * static_cast<double>(motion_.max_turn); }

void Speeds::add(const FrameReport& report, bool has_pose, double interval) {
  if (!has_pose || !report.tracked_from_camera || report.cause == FrameCause::new_component) last_.reset();
  if (!has_pose || !report.tracked_from_camera) return;
  const double seconds = last_ ? std::max(report.timestamp - last_->timestamp, interval) : 0;
  if (seconds > 0) {
    const Eigen::Isometry3d step = last_->tracked_from_camera.inverse() * *report.tracked_from_camera;
    update_peak(speed_, step.translation().norm() / seconds, speed_limit(), report.timestamp);
    update_peak(turn_, Eigen::AngleAxisd(step.linear()).angle() / seconds, turn_limit(), report.timestamp);
    ++steps_;
  }
  last_ = Last{report.timestamp, *report.tracked_from_camera};
}

void Speeds::save(std::ostream& out) const {
  out << steps_ << ' ';
  for (const Peak* peak : {&speed_, &turn_}) out << peak->value << ' ' << peak->timestamp << ' ' << peak->steps << ' ';
}

bool Speeds::restore(std::istream& in) {
  int steps = 0;
  Peak speed, turn;
  in >> steps;
  for (Peak* peak : {&speed, &turn}) in >> peak->value >> peak->timestamp >> peak->steps;
  if (!in) return false;
  steps_ = steps, speed_ = speed, turn_ = turn;
  return true;
}

}  // namespace cairn
