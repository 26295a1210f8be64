// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "inertial/preintegration.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <random>

namespace cairn {
namespace {

/// Random smooth rates or accelerations: three sines per axis.
class Signal {
 public:
  Signal(std::mt19937_64& random, double amplitude, double max_hertz) {
    std::uniform_real_distribution<double> unit(0, 1);
    for (Eigen::Vector3d* v : {&amplitude_[0], &amplitude_[1], &amplitude_[2]})
      *v = amplitude / 3 * Eigen::Vector3d(unit(random), unit(random), unit(random));
    for (double& f : frequency_) f = 2 * M_PI * max_hertz * unit(random);
    for (Eigen::Vector3d& p : phase_) p = 2 * M_PI * Eigen::Vector3d(unit(random), unit(random), unit(random));
  }
  [[nodiscard]] Eigen::Vector3d at(double t) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k)
      sum += amplitude_[k].cwiseProduct(((frequency_[k] * t + phase_[k].array()).sin()).matrix());
    return sum;
  }

 private:
  Eigen::Vector3d amplitude_[3], phase_[3];
  double frequency_[3];
};

/// Random motion of a hand: up to 3 rad/s and 12 m/s^2 with gravity, 2 Hz.
struct Motion {
  explicit Motion(std::mt19937_64& random) : rate(random, 3, 2), acceleration(random, 3, 2) {}
  [[nodiscard]] Eigen::Vector3d force(double t) const { return acceleration.at(t) + Eigen::Vector3d(1, -9.6, 2); }
  Signal rate, acceleration;
};

struct Samples {
  std::vector<AngularRate> rates;
  std::vector<Acceleration> accelerations;
};

/// Samples of `rate` Hz; the accelerometer's at times of its own with `shift`, seconds.
Samples sample(const Motion& motion, double seconds, double rate = 200, double shift = 0) {
  Samples s;
  for (int i = -1; i / rate <= seconds + 2 / rate; ++i) {
    s.rates.push_back({i / rate, motion.rate.at(i / rate)});
    s.accelerations.push_back({i / rate + shift, motion.force(i / rate + shift)});
  }
  return s;
}

/// Runge-Kutta 4 at 10 kHz of R' = R [w]x, v' = R a, p' = v.
Preintegration truth(const Motion& motion, double seconds) {
  struct State {
    Eigen::Matrix3d r;
    Eigen::Vector3d v, p;
  };
  const auto slope = [&](const State& s, double t) {
    return State{s.r * cross_matrix(motion.rate.at(t)), s.r * motion.force(t), s.v};
  };
  const auto moved = [](const State& s, const State& d, double dt) {
    return State{s.r + dt * d.r, s.v + dt * d.v, s.p + dt * d.p};
  };
  constexpr double kStep = 1e-4;  // seconds
  State s{Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  for (int i = 0; i < std::lround(seconds / kStep); ++i) {
    const double t = i * kStep;
    const State a = slope(s, t), b = slope(moved(s, a, kStep / 2), t + kStep / 2);
    const State c = slope(moved(s, b, kStep / 2), t + kStep / 2), d = slope(moved(s, c, kStep), t + kStep);
    s = moved(moved(moved(moved(s, a, kStep / 6), b, kStep / 3), c, kStep / 3), d, kStep / 6);
  }
  return {.seconds = seconds, .rotation = Eigen::Quaterniond(s.r).normalized(), .velocity = s.v, .position = s.p};
}

/// Error of (rotation, velocity, position), the rotation in the frame at j.
Vector9d difference(const Preintegration& from, const Preintegration& to) {
  return (Vector9d() << rotation_vector(from.rotation.conjugate() * to.rotation), to.velocity - from.velocity,
          to.position - from.position)
      .finished();
}

TEST(Preintegration, FollowsRandomMotion) {
  std::mt19937_64 random(1);
  for (int run = 0; run < 50; ++run) {
    const Motion motion(random);
    const Samples s = sample(motion, 1, 200, run % 2 ? 0.0013 : 0);
    const auto integrated = preintegrate(s.rates, s.accelerations, 0, 1, {}, {});
    ASSERT_TRUE(integrated);
    const Vector9d error = difference(*integrated, truth(motion, 1));
    EXPECT_LT(error.head<3>().norm() * 57.29578, 0.01);
    EXPECT_LT(error.tail<3>().norm(), 0.0005);
  }
}

TEST(Preintegration, DerivativesByTheBiasesMatchFiniteDifferences) {
  std::mt19937_64 random(2);
  const Motion motion(random);
  const Samples s = sample(motion, 1);
  const InertialBias bias{{0.02, -0.01, 0.03}, {0.1, 0.2, -0.1}};
  const auto at = [&](const InertialBias& b) { return *preintegrate(s.rates, s.accelerations, 0.003, 0.998, b, {}); };
  const Preintegration center = at(bias);
  constexpr double kStep = 1e-5, kTolerance = 2e-5;
  for (int axis = 0; axis < 3; ++axis)
    for (const bool is_gyro : {true, false}) {
      InertialBias more = bias, less = bias;
      (is_gyro ? more.gyro : more.acceleration)[axis] += kStep;
      (is_gyro ? less.gyro : less.acceleration)[axis] -= kStep;
      const Vector9d numeric = (difference(center, at(more)) - difference(center, at(less))) / (2 * kStep);
      Vector9d analytic = Vector9d::Zero();
      if (is_gyro) analytic.head<3>() = center.rotation_by_gyro.col(axis);
      analytic.segment<3>(3) = (is_gyro ? center.velocity_by_gyro : center.velocity_by_acceleration).col(axis);
      analytic.tail<3>() = (is_gyro ? center.position_by_gyro : center.position_by_acceleration).col(axis);
      EXPECT_LT((numeric - analytic).norm(), kTolerance) << "axis " << axis << ", gyroscope " << is_gyro;
      EXPECT_LT(difference(center.corrected(more), at(more)).norm(), 1e-8);
    }
}

TEST(Preintegration, RightJacobianMatchesFiniteDifferences) {
  const Eigen::Vector3d angle(0.5, -1.1, 0.3);
  const Eigen::Matrix3d jacobian = right_jacobian(angle);
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d step = 1e-6 * Eigen::Vector3d::Unit(axis);
    const Eigen::Vector3d numeric = rotation_vector(rotation_by(angle).conjugate() * rotation_by(angle + step)) / 1e-6;
    EXPECT_LT((numeric - jacobian.col(axis)).norm(), 1e-5);
  }
  EXPECT_LT((jacobian * inverse_right_jacobian(angle) - Eigen::Matrix3d::Identity()).norm(), 1e-12);
}

TEST(Preintegration, CovarianceCoversTheErrorOfNoisySamples) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  const InertialNoise noise{.gyro = 2e-3, .acceleration = 2e-2};
  constexpr int kRuns = 1000;
  constexpr double kRate = 200;
  double sum = 0;
  for (int run = 0; run < kRuns; ++run) {
    const Motion motion(random);
    Samples s = sample(motion, 1, kRate);
    const Preintegration exact = *preintegrate(s.rates, s.accelerations, 0, 1, {}, noise);
    const auto vector = [&] { return Eigen::Vector3d(normal(random), normal(random), normal(random)); };
    for (AngularRate& r : s.rates) r.rate += noise.gyro * std::sqrt(kRate) * vector();
    for (Acceleration& a : s.accelerations) a.value += noise.acceleration * std::sqrt(kRate) * vector();
    const Preintegration noisy = *preintegrate(s.rates, s.accelerations, 0, 1, {}, noise);
    const Vector9d error = difference(noisy, exact);
    sum += error.dot(noisy.covariance.ldlt().solve(error));
  }
  // Mean of 1,000 chi-squared variables with 9 degrees of freedom: 95 % interval.
  EXPECT_NEAR(sum / kRuns, 9, 1.96 * std::sqrt(18.0 / kRuns));
}

TEST(Preintegration, EndsAtAGapOfTheSamples) {
  std::mt19937_64 random(4);
  const Samples s = sample(Motion(random), 1);
  const auto without = [](auto samples, double since, double until) {
    std::erase_if(samples, [&](const auto& x) { return x.timestamp > since && x.timestamp < until; });
    return samples;
  };
  EXPECT_TRUE(preintegrate(without(s.rates, 0.3, 0.39), s.accelerations, 0, 1, {}, {}));
  EXPECT_FALSE(preintegrate(without(s.rates, 0.3, 0.45), s.accelerations, 0, 1, {}, {}));
  EXPECT_FALSE(preintegrate(s.rates, without(s.accelerations, 0.3, 0.45), 0, 1, {}, {}));
  EXPECT_TRUE(preintegrate(without(s.rates, 0.3, 0.45), s.accelerations, 0.5, 1, {}, {}));
  EXPECT_FALSE(preintegrate(without(s.rates, 0.85, 2), s.accelerations, 0, 1, {}, {}));
  EXPECT_FALSE(preintegrate({}, s.accelerations, 0, 1, {}, {}));
  EXPECT_FALSE(preintegrate(s.rates, s.accelerations, 0.5, 0.5, {}, {}));
}

TEST(Preintegration, TakesMicroseconds) {
  std::mt19937_64 random(5);
  const Samples s = sample(Motion(random), 1);
  double best = 1, sum = 0;
  for (int run = 0; run < 200; ++run) {
    const auto begin = std::chrono::steady_clock::now();
    sum += preintegrate(s.rates, s.accelerations, 0, 1, {}, {})->position.x();
    best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  }
  ASSERT_TRUE(std::isfinite(sum));
  RecordProperty("microseconds", std::to_string(1e6 * best));
#ifdef NDEBUG
  EXPECT_LT(best, 100e-6);  // 10 microseconds on an idle core
#endif
}

}  // namespace
}  // namespace cairn
