// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "alignment/gyroscope.hpp"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "inertial/preintegration.hpp"

namespace cairn {
namespace {

constexpr double kMaxGap = 0.1;   // max. seconds between samples, or between the interval and its nearest sample
constexpr double kDecay = 0.998;  // decay of the sums per learned rotation
constexpr double kRecentDecay = 0.9, kMinRecent = 2.5;    // of the last rotations; after three
constexpr double kMaxNoise = 0.01, kMaxErrorRatio = 0.5;  // rad, share of the rotations: RMS errors
constexpr double kMinRotationsForBias = 20;               // min. rotations for a bias estimate
constexpr double kMinRotationsForOrientation = 45;        // min. rotations for an estimate of the sensor's orientation
constexpr double kMinRotationRate =
    0.05;  // rad/s about two axes, RMS: min. motion to estimate the sensor's orientation

}  // namespace

void Gyroscope::add(const std::vector<AngularRate>& samples) {
  for (const AngularRate& s : samples)
    if (state_.samples.empty() || s.timestamp > state_.samples.back().timestamp) state_.samples.push_back(s);
}

void Gyroscope::forget_before(double time) {
  auto& samples = state_.samples;
  const auto first = std::find_if(samples.begin(), samples.end(), [&](const auto& s) { return s.timestamp >= time; });
  if (first - samples.begin() > 1) samples.erase(samples.begin(), first - 1);
}

std::optional<Eigen::Quaterniond> Gyroscope::integrated(double since, double until, const Eigen::Vector3d& bias) const {
  const auto& samples = state_.samples;
  if (samples.empty() || until <= since) return std::nullopt;
  if (samples.front().timestamp > since + kMaxGap || samples.back().timestamp < until - kMaxGap) return std::nullopt;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  double at = since;
  // A sample is valid from halfway after the preceding sample to halfway before the next.
  for (std::size_t i = 0; i < samples.size() && at < until; ++i) {
    const bool is_last = i + 1 == samples.size();
    const double gap = is_last ? 0 : samples[i + 1].timestamp - samples[i].timestamp;
    if (gap > kMaxGap && samples[i].timestamp < until && samples[i + 1].timestamp > since) return std::nullopt;
    const double end = is_last ? until : std::min(until, samples[i].timestamp + 0.5 * gap);
    if (end <= at) continue;
    rotation = rotation * rotation_by((samples[i].rate - bias) * (end - at));
    at = end;
  }
  return rotation.normalized();
}

std::optional<Eigen::Quaterniond> Gyroscope::rotation(double since, double until) const {
  const auto orientation = camera_from_imu();
  if (!orientation || is_contradicted()) return std::nullopt;
  const auto measured = integrated(since, until, bias());
  if (!measured) return std::nullopt;
  return *orientation * *measured * orientation->conjugate();
}

std::optional<Eigen::Vector3d> Gyroscope::rate(double time) const {
  constexpr double kWindow = 0.01;  // s
  const auto orientation = camera_from_imu();
  const auto& samples = state_.samples;
  if (!orientation || samples.empty() || samples.back().timestamp < time - kMaxGap) return std::nullopt;
  const double middle = std::min(time, samples.back().timestamp);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (const AngularRate& s : samples)
    if (std::abs(s.timestamp - middle) <= kWindow) sum += s.rate, ++count;
  if (count == 0) return std::nullopt;
  return *orientation * (sum / count - bias());
}

void Gyroscope::learn(double since, double until, const Eigen::Quaterniond& rotation) {
  const auto measured = integrated(since, until, Eigen::Vector3d::Zero());
  if (!measured) return;
  const auto rate_of = [&](const Eigen::Quaterniond& q) -> Eigen::Vector3d {
    const Eigen::AngleAxisd a(q);
    return a.angle() / (until - since) * a.axis();
  };
  const Eigen::Vector3d imu = rate_of(*measured), camera = rate_of(rotation);
  State& m = state_;
  if (const auto orientation = camera_from_imu()) {
    const double seconds = until - since;
    m.recent = kRecentDecay * m.recent + 1;
    m.squared_errors =
        kRecentDecay * m.squared_errors + (seconds * (camera - *orientation * (imu - bias()))).squaredNorm();
    m.squares = kRecentDecay * m.squares + (seconds * camera).squaredNorm();
  }
  m.count = kDecay * m.count + 1;
  m.imu = kDecay * m.imu + imu;
  m.camera = kDecay * m.camera + camera;
  m.camera_imu = kDecay * m.camera_imu + camera * imu.transpose();
}

/// True if the predictions of the last rotations had nearly the errors of no prediction.
bool Gyroscope::is_contradicted() const {
  const State& m = state_;
  return m.recent > kMinRecent &&
         std::sqrt(m.squared_errors / m.recent) > kMaxNoise + kMaxErrorRatio * std::sqrt(m.squares / m.recent);
}

/// Kabsch 1976, of the rates around their means.
std::optional<Eigen::Quaterniond> Gyroscope::camera_from_imu() const {
  if (camera_from_imu_) return camera_from_imu_;
  const State& m = state_;
  if (m.count < kMinRotationsForOrientation) return std::nullopt;
  const Eigen::Matrix3d covariance = (m.camera_imu - m.camera * m.imu.transpose() / m.count) / m.count;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  if (svd.singularValues()[1] < kMinRotationRate * kMinRotationRate) return std::nullopt;
  Eigen::Vector3d sign(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1);
  return Eigen::Quaterniond(svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose());
}

Eigen::Vector3d Gyroscope::bias() const {
  const auto orientation = camera_from_imu();
  if (!orientation || state_.count < kMinRotationsForBias) return Eigen::Vector3d::Zero();
  return (state_.imu - orientation->conjugate() * state_.camera) / state_.count;
}

}  // namespace cairn
