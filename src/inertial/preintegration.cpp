// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "inertial/preintegration.hpp"

#include <algorithm>
#include <cmath>

namespace cairn {
namespace {

constexpr double kMaxGap = 0.1;  // max. seconds between samples, or between the interval and its nearest sample
constexpr double kMaxSeriesAngle2 = 0.01;  // rad^2, for a relative error of the series below 1e-12

/// Rotation by a small vector, not normalized: series of sine and cosine.
Eigen::Quaterniond small_rotation_by(const Eigen::Vector3d& angle) {
  const double x = angle.squaredNorm();
  if (x > kMaxSeriesAngle2) return rotation_by(angle);
  const double scale = 0.5 - x * (1.0 / 48 - x * (1.0 / 3840 - x / 645120));
  const Eigen::Vector3d v = scale * angle;
  return {1 - x * (1.0 / 8 - x * (1.0 / 384 - x / 46080)), v.x(), v.y(), v.z()};
}

/// Subtracts [a]x[b]x = b a^T - (a.b) I.
void subtract_cross_product(const Eigen::Vector3d& a, const Eigen::Vector3d& b, Eigen::Matrix3d& m) {
  const double dot = a.dot(b);
  for (int column = 0; column < 3; ++column) m.col(column) -= a[column] * b;
  m.diagonal().array() += dot;
}

/// Subtracts [a]x[b]x + [b]x[a]x.
void subtract_symmetric(const Eigen::Vector3d& a, const Eigen::Vector3d& b, Eigen::Matrix3d& m) {
  const double dot = 2 * a.dot(b);
  for (int column = 0; column < 3; ++column) m.col(column) -= a[column] * b + b[column] * a;
  m.diagonal().array() += dot;
}

/// Columns of m crossed with v from the left: [v]x m.
Eigen::Matrix3d crossed(const Eigen::Vector3d& v, const Eigen::Matrix3d& m) {
  Eigen::Matrix3d out;
  out.row(0) = v.y() * m.row(2) - v.z() * m.row(1);
  out.row(1) = v.z() * m.row(0) - v.x() * m.row(2);
  out.row(2) = v.x() * m.row(1) - v.y() * m.row(0);
  return out;
}

/// Linear interpolation of samples at increasing times; constant before the first and after the last.
template <class Sample>
class Interpolation {
 public:
  Interpolation(const std::vector<Sample>& samples, Eigen::Vector3d Sample::*value, double since)
      : samples_(samples), value_(value) {
    const auto after = std::upper_bound(samples.begin(), samples.end(), since,
                                        [](double t, const Sample& s) { return t < s.timestamp; });
    next_ = static_cast<std::size_t>(after - samples.begin());
  }
  [[nodiscard]] Eigen::Vector3d at(double time) {
    while (next_ < samples_.size() && samples_[next_].timestamp <= time) ++next_;
    if (next_ == 0) return samples_.front().*value_;
    if (next_ == samples_.size()) return samples_.back().*value_;
    const Sample &a = samples_[next_ - 1], &b = samples_[next_];
    const double share = (time - a.timestamp) / (b.timestamp - a.timestamp);
    return a.*value_ + share * (b.*value_ - a.*value_);
  }
  /// Time of the first sample after `time`, or `until`.
  [[nodiscard]] double next_time(double until) const {
    return next_ < samples_.size() ? std::min(samples_[next_].timestamp, until) : until;
  }

 private:
  const std::vector<Sample>& samples_;
  Eigen::Vector3d Sample::*value_;
  std::size_t next_;
};

/// True if no part of the interval is more than kMaxGap from a sample.
template <class Sample>
bool covers(const std::vector<Sample>& samples, double since, double until) {
  if (samples.empty() || samples.front().timestamp > since + kMaxGap || samples.back().timestamp < until - kMaxGap)
    return false;
  auto it = std::upper_bound(samples.begin(), samples.end(), since,
                             [](double t, const Sample& s) { return t < s.timestamp; });
  if (it == samples.begin()) ++it;
  for (; it != samples.end() && std::prev(it)->timestamp < until; ++it)
    if (it->timestamp - std::prev(it)->timestamp > kMaxGap) return false;
  return true;
}

/// Integration with errors in the frame at i: the noise of a sensor with equal axes stays isotropic there, so that the
/// covariance of the rotation is a number and its covariances with velocity and position are cross products.
class Integrator {
 public:
  Integrator(const InertialBias& bias, const InertialNoise& noise)
      : gyro_variance_(noise.gyro * noise.gyro), acceleration_variance_(noise.acceleration * noise.acceleration) {
    result_.bias = bias;
  }

  /// Adds a step with linear rate and acceleration: rotation by the Magnus expansion to second order (Blanes et al.
  /// 2009), velocity and position by the acceleration at both ends.
  void add(const Eigen::Vector3d& rate0, const Eigen::Vector3d& rate1, const Eigen::Vector3d& acceleration0,
           const Eigen::Vector3d& acceleration1, double dt) {
    Preintegration& r = result_;
    const Eigen::Vector3d w0 = rate0 - r.bias.gyro, w1 = rate1 - r.bias.gyro;
    const Eigen::Vector3d angle = (0.5 * dt) * (w0 + w1) + (dt * dt / 12) * w0.cross(w1);
    const Eigen::Quaterniond next = r.rotation * small_rotation_by(angle);
    const Eigen::Matrix3d after = next.toRotationMatrix();
    const Eigen::Vector3d a0 = matrix_ * (acceleration0 - r.bias.acceleration);
    const Eigen::Vector3d a1 = after * (acceleration1 - r.bias.acceleration);
    const Eigen::Vector3d velocity_step = (0.5 * dt) * (a0 + a1);
    const Eigen::Vector3d position_step = (dt * dt / 6) * (2 * a0 + a1);
    add_covariance(velocity_step, position_step, dt);
    add_derivatives(a0, a1, after, dt);
    r.position += dt * r.velocity + position_step;
    r.velocity += velocity_step;
    r.rotation = next;
    r.seconds += dt;
    matrix_ = after;
  }

  /// Result with the rotation's errors in the frame at j.
  [[nodiscard]] Preintegration finished() {
    Preintegration& r = result_;
    r.rotation.normalize();
    const Eigen::Matrix3d j_from_i = r.rotation.toRotationMatrix().transpose();
    r.rotation_by_gyro = j_from_i * r.velocity_by_acceleration;
    Matrix9d& p = r.covariance;
    p.block<3, 3>(0, 0).diagonal().setConstant(rotation_);
    p.block<3, 3>(3, 0) = -cross_matrix(velocity_rotation_) * j_from_i.transpose();
    p.block<3, 3>(6, 0) = -cross_matrix(position_rotation_) * j_from_i.transpose();
    p.block<3, 3>(3, 3) = velocity_;
    p.block<3, 3>(6, 3) = position_velocity_;
    p.block<3, 3>(6, 6) = position_;
    p.block<3, 3>(0, 3) = p.block<3, 3>(3, 0).transpose();
    p.block<3, 3>(0, 6) = p.block<3, 3>(6, 0).transpose();
    p.block<3, 3>(3, 6) = p.block<3, 3>(6, 3).transpose();
    return r;
  }

 private:
  /// Eq. 63 for errors r, v, p in the frame at i:
  ///   r' = r + noise, v' = v - [u]x r + noise, p' = p + dt v - [q]x r + noise.
  void add_covariance(const Eigen::Vector3d& u, const Eigen::Vector3d& q, double dt) {
    const double s = rotation_ + 0.5 * gyro_variance_ * dt;  // at the middle of the step
    const double white = acceleration_variance_ * dt;
    const Eigen::Vector3d &c = velocity_rotation_, &d = position_rotation_;
    const Eigen::Vector3d moved = d + dt * c;
    position_ += dt * (position_velocity_ + position_velocity_.transpose() + dt * velocity_);
    subtract_symmetric(q, moved + (0.5 * s) * q, position_);
    position_.diagonal().array() += white * dt * dt / 3;
    position_velocity_ += dt * velocity_;
    subtract_cross_product(moved + s * q, u, position_velocity_);
    subtract_cross_product(q, c, position_velocity_);
    position_velocity_.diagonal().array() += white * dt / 2;
    subtract_symmetric(u, c + (0.5 * s) * u, velocity_);
    velocity_.diagonal().array() += white;
    position_rotation_ = moved + s * q;
    velocity_rotation_ += s * u;
    rotation_ += gyro_variance_ * dt;
  }

  /// Derivatives of the step with respect to the biases. In the frame at i, those of the rotation with respect to the
  /// gyroscope's and of the velocity with respect to the accelerometer's are both the negative integral of the
  /// rotation.
  void add_derivatives(const Eigen::Vector3d& a0, const Eigen::Vector3d& a1, const Eigen::Matrix3d& after, double dt) {
    Preintegration& r = result_;
    Eigen::Matrix3d& integral = r.velocity_by_acceleration;
    const Eigen::Matrix3d by_a0 = crossed(a0, integral);
    r.position_by_acceleration += dt * integral - (dt * dt / 6) * (2 * matrix_ + after);
    integral -= (0.5 * dt) * (matrix_ + after);
    const Eigen::Matrix3d by_a1 = crossed(a1, integral);
    r.position_by_gyro += dt * r.velocity_by_gyro - (dt * dt / 6) * (2 * by_a0 + by_a1);
    r.velocity_by_gyro -= (0.5 * dt) * (by_a0 + by_a1);
  }

  double gyro_variance_, acceleration_variance_;  // rad^2/s, m^2/s^3
  Preintegration result_;
  Eigen::Matrix3d matrix_ = Eigen::Matrix3d::Identity();  // of result_.rotation
  // Covariances in the frame at i: rotation I, -[velocity_rotation]x, -[position_rotation]x, and matrices.
  double rotation_ = 0;
  Eigen::Vector3d velocity_rotation_ = Eigen::Vector3d::Zero(), position_rotation_ = Eigen::Vector3d::Zero();
  Eigen::Matrix3d velocity_ = Eigen::Matrix3d::Zero(), position_velocity_ = Eigen::Matrix3d::Zero(),
                  position_ = Eigen::Matrix3d::Zero();
};

}  // namespace

Eigen::Quaterniond rotation_by(const Eigen::Vector3d& angle) {
  const double a = angle.norm();
  return a > 0 ? Eigen::Quaterniond(Eigen::AngleAxisd(a, angle / a)) : Eigen::Quaterniond::Identity();
}

Eigen::Vector3d rotation_vector(const Eigen::Quaterniond& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  return (Eigen::Matrix3d() << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0).finished();
}

Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& angle) {
  const double a2 = angle.squaredNorm(), a = std::sqrt(a2);
  const Eigen::Matrix3d w = cross_matrix(angle);
  if (a < 1e-4) return Eigen::Matrix3d::Identity() - 0.5 * w + w * w / 6;
  return Eigen::Matrix3d::Identity() - (1 - std::cos(a)) / a2 * w + (a - std::sin(a)) / (a2 * a) * w * w;
}

Eigen::Matrix3d inverse_right_jacobian(const Eigen::Vector3d& angle) {
  const double a2 = angle.squaredNorm(), a = std::sqrt(a2);
  const Eigen::Matrix3d w = cross_matrix(angle);
  if (a < 1e-4) return Eigen::Matrix3d::Identity() + 0.5 * w + w * w / 12;
  return Eigen::Matrix3d::Identity() + 0.5 * w + (1 / a2 - (1 + std::cos(a)) / (2 * a * std::sin(a))) * w * w;
}

Preintegration Preintegration::corrected(const InertialBias& changed) const {
  const Eigen::Vector3d gyro = changed.gyro - bias.gyro, acceleration = changed.acceleration - bias.acceleration;
  Preintegration c = *this;
  c.rotation = (rotation * rotation_by(rotation_by_gyro * gyro)).normalized();
  c.velocity += velocity_by_gyro * gyro + velocity_by_acceleration * acceleration;
  c.position += position_by_gyro * gyro + position_by_acceleration * acceleration;
  return c;
}

std::optional<Preintegration> preintegrate(const std::vector<AngularRate>& rates,
                                           const std::vector<Acceleration>& accelerations, double since, double until,
                                           const InertialBias& bias, const InertialNoise& noise) {
  if (!(until > since) || !covers(rates, since, until) || !covers(accelerations, since, until)) return std::nullopt;
  Interpolation rate(rates, &AngularRate::rate, since);
  Interpolation acceleration(accelerations, &Acceleration::value, since);
  Integrator integrator(bias, noise);
  Eigen::Vector3d w0 = rate.at(since), a0 = acceleration.at(since);
  for (double at = since; at < until;) {
    const double next = rate.next_time(until);
    const Eigen::Vector3d w1 = rate.at(next), a1 = acceleration.at(next);
    integrator.add(w0, w1, a0, a1, next - at);
    w0 = w1, a0 = a1, at = next;
  }
  return integrator.finished();
}

}  // namespace cairn
