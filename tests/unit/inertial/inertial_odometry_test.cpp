// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "inertial/inertial_odometry.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace cairn {
namespace {

const Eigen::Vector3d kGravity(0, 9.81, 0);  // m/s^2

/// Errors of the simulated sensor.
struct Errors {
  InertialBias bias{{0.006, -0.005, 0.004}, {0.05, -0.04, 0.06}};
  Eigen::Vector3d extrinsic = Eigen::Vector3d(0.012, -0.01, 0.008);  // rad
  Eigen::Vector3d lever = Eigen::Vector3d(0.02, -0.015, 0.01);       // m
  double clock = 0.003;                                              // seconds
  double noise = 1;                                                  // times the noise of a phone's sensor
};

/// Hand motion of a camera with an inertial sensor: 20 cm and 40 degrees.
class Simulation {
 public:
  explicit Simulation(std::uint64_t seed, const Errors& errors = {}) : errors_(errors), random_(seed) {
    std::uniform_real_distribution<double> phase(0, 2 * M_PI);
    for (double& p : phases_) p = phase(random_);
    bias_ = errors.bias;
  }
  [[nodiscard]] Eigen::Isometry3d world_from_imu(double t) const {
    const auto wave = [&](int k, double hertz) { return std::sin(2 * M_PI * hertz * t + phases_[k]); };
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translate(Eigen::Vector3d(0.20 * wave(0, 0.41) + 0.01 * wave(6, 1.9), 0.12 * wave(1, 0.53),
                                   0.15 * wave(2, 0.37) + 0.01 * wave(7, 1.7)));
    pose.rotate(Eigen::AngleAxisd(0.7 * wave(3, 0.31) + 0.03 * wave(8, 1.5), Eigen::Vector3d::UnitY()));
    pose.rotate(Eigen::AngleAxisd(0.4 * wave(4, 0.43), Eigen::Vector3d::UnitX()));
    pose.rotate(Eigen::AngleAxisd(0.3 * wave(5, 0.47), Eigen::Vector3d::UnitZ()));
    return pose;
  }
  [[nodiscard]] Eigen::Isometry3d world_from_camera(double t) const {
    Eigen::Isometry3d imu_from_camera(rotation_by(errors_.extrinsic));
    imu_from_camera.translation() = errors_.lever;
    return world_from_imu(t + errors_.clock) * imu_from_camera;
  }
  /// Adds the samples up to a time, 200 Hz, to the odometry.
  void sense(InertialOdometry& odometry, double until,
             const std::function<void(AngularRate&, Acceleration&)>& spoil = {}) {
    constexpr double kStep = 0.005, kDifference = 1e-4;  // seconds
    std::vector<AngularRate> rates;
    std::vector<Acceleration> accelerations;
    for (; next_ * kStep <= until; ++next_) {
      const double t = next_ * kStep;
      const Eigen::Isometry3d before = world_from_imu(t - kDifference), now = world_from_imu(t),
                              after = world_from_imu(t + kDifference);
      const Eigen::Vector3d rate =
          rotation_vector(Eigen::Quaterniond((before.inverse() * after).linear())) / (2 * kDifference);
      const Eigen::Vector3d force =
          now.linear().transpose() *
          ((before.translation() - 2 * now.translation() + after.translation()) / (kDifference * kDifference) -
           kGravity);
      // Bosch BMI270.
      const double scale = errors_.noise / std::sqrt(kStep);
      bias_.gyro += errors_.noise * 5e-5 * std::sqrt(kStep) * vector();
      bias_.acceleration += errors_.noise * 3e-4 * std::sqrt(kStep) * vector();
      rates.push_back({t, rate + bias_.gyro + 1.2e-4 * scale * vector()});
      accelerations.push_back({t, force + bias_.acceleration + 1.6e-3 * scale * vector()});
      if (spoil) spoil(rates.back(), accelerations.back());
    }
    odometry.add(rates, accelerations);
  }
  /// Tracked pose: 1 mm, 0.5 mrad.
  [[nodiscard]] Eigen::Isometry3d tracked(double t) {
    Vector6d noise;
    noise << 0.0005 * vector(), 0.001 * vector();
    return world_from_camera(t) * retract(noise);
  }
  /// Frames of 30 Hz from one time to another.
  void track(InertialOdometry& odometry, double since, double until,
             const std::function<void(AngularRate&, Acceleration&)>& spoil = {}) {
    for (long i = std::lround(since * 30); i <= std::lround(until * 30); ++i) {
      sense(odometry, i / 30.0 + 0.01, spoil);
      odometry.update(i / 30.0, tracked(i / 30.0), kCovariance);
    }
  }
  [[nodiscard]] const InertialBias& bias() const { return bias_; }
  static inline const Matrix6d kCovariance = [] {
    Matrix6d covariance = Matrix6d::Zero();
    covariance.diagonal() << Eigen::Vector3d::Constant(1e-6), Eigen::Vector3d::Constant(4e-6);
    return covariance;
  }();

 private:
  Eigen::Vector3d vector() { return {normal_(random_), normal_(random_), normal_(random_)}; }
  Errors errors_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  double phases_[9];
  InertialBias bias_;
  long next_ = -20;
};

InertialOdometry odometry_of_camera() { return InertialOdometry(Eigen::Quaterniond::Identity()); }

double degrees(double radians) { return radians * 57.29578; }

TEST(InertialOdometry, EstimatesBiasesGravityAndExtrinsics) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    Simulation simulation(seed);
    InertialOdometry odometry = odometry_of_camera();
    simulation.track(odometry, 0, 20);
    ASSERT_TRUE(odometry.is_trusted());
    const auto& f = *odometry.save().filter;
    const double gyro = degrees((f.bias.gyro - simulation.bias().gyro).norm());
    const double acceleration = (f.bias.acceleration - simulation.bias().acceleration).norm();
    const double gravity = degrees(std::acos(f.gravity.normalized().dot(kGravity.normalized())));
    const double extrinsic =
        degrees(rotation_vector(rotation_by(Errors().extrinsic).conjugate() * f.imu_from_camera).norm());
    const double lever = (f.lever - Errors().lever).norm();
    std::printf(
        "gyroscope %.4f deg/s, accelerometer %.4f m/s^2, gravity %.3f deg, extrinsics %.3f deg %.4f m, clock %.5f s\n",
        gyro, acceleration, gravity, extrinsic, lever, f.clock - Errors().clock);
    EXPECT_LT(gyro, 0.02);
    EXPECT_LT(acceleration, 0.03);
    EXPECT_LT(gravity, 0.2);
    EXPECT_LT(extrinsic, 0.3);
    EXPECT_LT(lever, 0.01);
    EXPECT_NEAR(f.clock, Errors().clock, 0.001);
  }
}

TEST(InertialOdometry, PredictsThroughTheDarkWithAnHonestCovariance) {
  constexpr int kSeeds = 50;
  for (const double dark : {1.0, 2.0}) {
    int covered = 0;
    double worst = 0, squared = 0;
    for (int seed = 1; seed <= kSeeds; ++seed) {
      Simulation simulation(seed);
      InertialOdometry odometry = odometry_of_camera();
      simulation.track(odometry, 0, 8);
      simulation.sense(odometry, 8 + dark + 0.01);
      const auto predicted = odometry.predict(8 + dark);
      ASSERT_TRUE(predicted) << seed;
      const Vector6d error =
          local_coordinates(predicted->world_from_camera.inverse() * simulation.world_from_camera(8 + dark));
      covered += error.dot(predicted->covariance.ldlt().solve(error)) < 12.59;  // 95 % of 6 degrees of freedom
      worst = std::max(worst, error.tail<3>().norm()), squared += error.tail<3>().squaredNorm() / kSeeds;
    }
    std::printf("%.0f s: RMS %.4f m, worst %.4f m, covered %d of %d\n", dark, std::sqrt(squared), worst, covered,
                kSeeds);
    EXPECT_GE(covered, 0.95 * kSeeds);
    EXPECT_LT(std::sqrt(squared), dark == 1 ? 0.03 : 0.08);
  }
}

TEST(InertialOdometry, RestoredStateGivesTheSamePredictions) {
  Simulation simulation(4), same(4);
  InertialOdometry odometry = odometry_of_camera(), restored = odometry_of_camera(), whole = odometry_of_camera();
  simulation.track(odometry, 0, 5);
  restored.restore(odometry.save());
  simulation.track(restored, 5.0 + 1 / 30.0, 6);
  same.track(whole, 0, 6);
  ASSERT_TRUE(whole.predict(6));
  EXPECT_EQ(whole.predict(6)->world_from_camera.matrix(), restored.predict(6)->world_from_camera.matrix());
  EXPECT_EQ(whole.predict(6)->covariance, restored.predict(6)->covariance);
}

TEST(InertialOdometry, PredictsNothingBeforeTheTestAndForOneSensorAlone) {
  Simulation simulation(5);
  InertialOdometry odometry = odometry_of_camera(), alone = odometry_of_camera(), unknown(std::nullopt);
  simulation.track(odometry, 0, 1.4);
  EXPECT_FALSE(odometry.predict(1.41));
  for (int i = 0; i < 300; ++i) {
    alone.add({{i / 100.0, Eigen::Vector3d::Zero()}}, {});
    alone.update(i / 100.0, Eigen::Isometry3d::Identity(), Simulation::kCovariance);
  }
  EXPECT_FALSE(alone.predict(3));
  EXPECT_FALSE(alone.save().filter);
  Simulation(5).track(unknown, 0, 5);
  EXPECT_FALSE(unknown.predict(5));
}

TEST(InertialOdometry, KeepsBiasesInAnotherWorld) {
  Simulation simulation(6);
  InertialOdometry odometry = odometry_of_camera();
  simulation.track(odometry, 0, 10);
  const InertialBias before = odometry.save().filter->bias;
  odometry.reset_world();
  EXPECT_FALSE(odometry.predict(10));
  simulation.track(odometry, 10.0 + 1 / 30.0, 11.5);
  ASSERT_TRUE(odometry.save().filter);
  EXPECT_LT((odometry.save().filter->bias.acceleration - before.acceleration).norm(), 0.03);
  EXPECT_TRUE(odometry.predict(11.5));
}

/// Sensor with wrong samples.
struct Wrong {
  const char* name;
  std::function<void(AngularRate&, Acceleration&)> spoil;
  bool is_gyro_wrong;
};

TEST(InertialOdometry, RejectsAWrongSensorBeforeItsUse) {
  Simulation other(99);
  const auto other_at = [&](double t) { return other.world_from_imu(t); };
  const Wrong wrongs[] = {
      {"swapped axes",
       [](AngularRate& r, Acceleration& a) { std::swap(r.rate.x(), r.rate.y()), std::swap(a.value.x(), a.value.y()); },
       true},
      {"sign of the accelerometer", [](AngularRate&, Acceleration& a) { a.value = -a.value; }, false},
      {"sign of the gyroscope", [](AngularRate& r, Acceleration&) { r.rate = -r.rate; }, true},
      {"degrees", [](AngularRate& r, Acceleration&) { r.rate *= 57.3; }, true},
      {"g", [](AngularRate&, Acceleration& a) { a.value /= 9.81; }, false},
      {"another recording",
       [&](AngularRate& r, Acceleration& a) {
         const Eigen::Isometry3d b = other_at(r.timestamp - 1e-3), n = other_at(r.timestamp),
                                 c = other_at(r.timestamp + 1e-3);
         r.rate = rotation_vector(Eigen::Quaterniond((b.inverse() * c).linear())) / 2e-3;
         a.value =
             n.linear().transpose() * ((b.translation() - 2 * n.translation() + c.translation()) / 1e-6 - kGravity);
       },
       true}};
  for (const Wrong& wrong : wrongs)
    for (const std::uint64_t seed : {1, 2, 3}) {
      Simulation simulation(seed);
      InertialOdometry odometry = odometry_of_camera();
      for (double t = 0; t < 15; t += 0.5) {
        simulation.track(odometry, t == 0 ? 0 : t + 1 / 30.0, t + 0.5, wrong.spoil);
        EXPECT_FALSE(odometry.is_trusted()) << wrong.name << " at " << t;
        if (odometry.is_contradicted()) {
          std::printf("%s: %.1f s\n", wrong.name, t + 0.5);
          break;
        }
      }
      EXPECT_TRUE(odometry.is_contradicted()) << wrong.name;
      EXPECT_EQ(odometry.is_gyro_contradicted(), wrong.is_gyro_wrong) << wrong.name;
    }
  for (const double clock : {-0.2, 0.2}) {
    Errors errors;
    errors.clock = clock;
    Simulation simulation(1, errors);
    InertialOdometry odometry = odometry_of_camera();
    simulation.track(odometry, 0, 15);
    EXPECT_TRUE(odometry.is_contradicted()) << clock;
  }
  Simulation simulation(1);
  InertialOdometry late = odometry_of_camera();
  for (int i = 0; i < 200; ++i) {  // samples with a clock 0.2 s behind
    simulation.sense(late, i / 30.0 - 0.2);
    late.update(i / 30.0, simulation.tracked(i / 30.0), Simulation::kCovariance);
  }
  EXPECT_TRUE(late.is_contradicted());
}

TEST(InertialOdometry, DoesNotTrustASensorAtRest) {
  InertialOdometry odometry = odometry_of_camera();
  for (int i = 0; i < 300; ++i) {
    const double t = i / 30.0;
    std::vector<AngularRate> rates;
    std::vector<Acceleration> accelerations;
    for (int k = 0; k < 7; ++k) {
      rates.push_back({t + 0.005 * k - 0.03, Eigen::Vector3d::Zero()});
      accelerations.push_back({t + 0.005 * k - 0.03, -kGravity});
    }
    odometry.add(rates, accelerations);
    odometry.update(t, Eigen::Isometry3d::Identity(), Simulation::kCovariance);
  }
  EXPECT_TRUE(odometry.save().filter);
  EXPECT_FALSE(odometry.is_trusted());
  EXPECT_FALSE(odometry.is_contradicted());
}

}  // namespace
}  // namespace cairn
