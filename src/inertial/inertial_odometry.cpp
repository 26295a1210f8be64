// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "inertial/inertial_odometry.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

namespace cairn {
namespace {

using Matrix24d = Eigen::Matrix<double, 24, 24>;
using Jacobian = Eigen::Matrix<double, 6, 24>;
using Filter = InertialOdometry::Filter;
using TrackedPose = InertialOdometry::TrackedPose;

// Errors in the covariance of a filter: rotation and extrinsic rotation on the right side, others added.
constexpr int kRotation = 0, kPosition = 3, kVelocity = 6, kGyro = 9, kAcceleration = 12, kGravityDirection = 15,
              kExtrinsic = 17, kLever = 20, kClock = 23;

// Prior sigmas: rad, m, m/s, rad/s, m/s^2, s.
constexpr double kRotationPrior = 0.004, kPositionPrior = 0.005, kVelocityPrior = 0.1, kGyroPrior = 0.005,
                 kAccelerationPrior = 0.1, kGravityPrior = 0.03, kExtrinsicPrior = 0.015, kLeverPrior = 0.03,
                 kClockPrior = 0.004;
constexpr double kMinWindow = 1.0, kMaxWindow = 2.0;  // seconds of poses for an initialization
constexpr int kStartInterval = 5;                     // poses between initializations
constexpr double kMaxPoseGap = 0.5;                   // seconds between poses of an initialization
constexpr double kMaxLag = 0.1;                       // seconds of the newest sample behind the pose: another clock
constexpr double kPoseSigma = 0.004;                  // m, of a pose in the initialization
constexpr double kMaxStartError = 0.015;              // m, RMS
constexpr double kMaxStartRotationError = 0.3;        // share of the rotation, RMS
constexpr double kStartRotationNoise = 0.01;          // rad
constexpr double kMaxGravityError = 0.5;              // m/s^2 of the norm
constexpr double kMaxGravitySigma = 0.4;              // m/s^2: the observability of gravity
constexpr double kMaxGyroBias = 0.2;                  // rad/s
constexpr int kFailedStartsOfReset = 4;               // counted for a filter that contradicts the poses
constexpr int kMaxFailedStarts = 12;                  // in a row: the sensor contradicts the poses
constexpr double kTestSeconds = 0.5;                  // of prediction without poses
constexpr double kMaxTestSeconds = 1.0;               // a longer test is dropped
// Motion of a test: rotation in rad, and deviation from a constant velocity in m. At rest every sensor passes.
constexpr double kMinTestRotation = 0.1, kMinTestPosition = 0.03;
// Limit of the error of a passed test, and of one that is not failed: rad or m, and share of the motion.
constexpr double kPassedNoise = 0.01, kPassedRotation = 0.1, kPassedPosition = 0.3;
constexpr double kFailedNoise = 0.02, kFailedRotation = 0.5, kFailedPosition = 0.8;
// Noise scale: max. error of a test in variances, and exponent of its factor.
constexpr double kMaxNoiseChange = 16, kNoiseAdaption = 0.25, kMaxNoiseScale = 16;
constexpr int kMinPassed = 2;      // tests more than twice the failed ones, before predictions are returned
constexpr std::size_t kTests = 8;  // last tests that decide
constexpr std::ptrdiff_t kMaxTrustedFailures = 2, kMaxFailures = 4;  // of them: to be trusted, and not contradicted
constexpr double kChiSquared999 = 22.46;  // 99.9 % of the chi-squared distribution with 6 degrees of freedom
// Poses in a row, before the filter follows them: before the test, and after it.
constexpr int kMaxRejected = 3, kMaxRejectedByTested = 30;
constexpr double kMinGravitySigma = 0.002;  // rad, of a keyframe: drift of the world
constexpr double kGyroStep = 0.1;           // min. seconds between the poses for the gyroscope's bias
constexpr double kRateWindow = 0.015;       // seconds

/// Derivative of the gravity vector with respect to its direction, rad.
Eigen::Matrix<double, 3, 2> gravity_by_direction(const Eigen::Vector3d& gravity) {
  const Eigen::Vector3d x = gravity.unitOrthogonal();
  return (Eigen::Matrix<double, 3, 2>() << gravity.norm() * x, gravity.cross(x)).finished();
}

void set_prior(Matrix24d& covariance, int at, int count, double sigma) {
  covariance.block(at, 0, count, 24).setZero();
  covariance.block(0, at, 24, count).setZero();
  covariance.diagonal().segment(at, count).setConstant(sigma * sigma);
}

Eigen::Isometry3d world_from_camera(const Filter& f) {
  Eigen::Isometry3d pose(f.rotation * f.imu_from_camera);
  pose.translation() = f.position + f.rotation * f.lever;
  return pose;
}

Vector6d error_of(const Eigen::Isometry3d& predicted, const Eigen::Isometry3d& measured) {
  const Eigen::Isometry3d off = predicted.inverse() * measured;
  return (Vector6d() << rotation_vector(Eigen::Quaterniond(off.linear())), off.translation()).finished();
}

/// Derivative of the camera's pose (rotation, translation in the camera's frame) with respect to the errors.
Jacobian pose_jacobian(const Filter& f, const Eigen::Vector3d& rate) {
  Jacobian h = Jacobian::Zero();
  const Eigen::Matrix3d camera_from_imu = f.imu_from_camera.conjugate().toRotationMatrix();
  const Eigen::Matrix3d camera_from_world = camera_from_imu * f.rotation.conjugate().toRotationMatrix();
  h.block<3, 3>(0, kRotation) = camera_from_imu;
  h.block<3, 3>(0, kExtrinsic).setIdentity();
  h.block<3, 1>(0, kClock) = camera_from_imu * rate;
  h.block<3, 3>(3, kPosition) = camera_from_world;
  h.block<3, 3>(3, kRotation) = -camera_from_imu * cross_matrix(f.lever);
  h.block<3, 3>(3, kLever) = camera_from_imu;
  h.block<3, 1>(3, kClock) = camera_from_world * f.velocity + camera_from_imu * rate.cross(f.lever);
  return h;
}

std::ptrdiff_t failures(const std::vector<bool>& passed) { return std::count(passed.begin(), passed.end(), false); }

/// True if clearly more tests were passed than failed: tracked poses fail, too.
bool passes(const std::vector<bool>& passed) {
  const auto count = static_cast<std::ptrdiff_t>(passed.size());
  return count - 2 * failures(passed) >= kMinPassed;
}

struct TestMotion {
  double rotation = 0;   // rad
  double deviation = 0;  // m, from a constant velocity
};

/// Motion from the first to the last pose; the deviation from the pose in the middle.
TestMotion motion_of(const std::vector<TrackedPose>& poses) {
  const TrackedPose &first = poses.front(), &last = poses.back();
  const double half = 0.5 * (first.timestamp + last.timestamp);
  const TrackedPose& middle = *std::min_element(poses.begin(), poses.end(), [&](const auto& a, const auto& b) {
    return std::abs(a.timestamp - half) < std::abs(b.timestamp - half);
  });
  const double share = (middle.timestamp - first.timestamp) / (last.timestamp - first.timestamp);
  const Eigen::Vector3d begin = first.world_from_camera.translation(), end = last.world_from_camera.translation();
  return {Eigen::AngleAxisd(first.world_from_camera.linear().transpose() * last.world_from_camera.linear()).angle(),
          // A constant acceleration a deviates by a/2 t^2 at the end, and by share (1 - share) of it in the middle.
          (begin + share * (end - begin) - middle.world_from_camera.translation()).norm() /
              std::max(0.1, share * (1 - share))};
}

/// Adds the result of a test: passed, failed, or neither.
void add_test(double error, double motion, double passed_share, double failed_share, std::vector<bool>& results) {
  const bool passed = error <= kPassedNoise + passed_share * motion;
  if (!passed && error <= kFailedNoise + failed_share * motion) return;
  if (results.size() == kTests) results.erase(results.begin());
  results.push_back(passed);
}

/// Least-squares bias of the gyroscope between the poses, with the errors that remain.
struct GyroFit {
  Eigen::Vector3d bias = Eigen::Vector3d::Zero();
  double motion = 0, error = 0;  // rad, RMS
};

/// Initial values by linear least squares, see initial_state().
struct LinearFit {
  Eigen::Vector3d velocity, gravity;
  double error = 0;          // m, RMS
  double gravity_sigma = 0;  // m/s^2, along the worst axis
};

using Integrate = std::function<std::optional<Preintegration>(double since, double until, const InertialBias& bias)>;

std::optional<GyroFit> fit_gyro(const std::vector<TrackedPose>& poses, const Integrate& integrate) {
  Eigen::Matrix3d normal = 1e-9 * Eigen::Matrix3d::Identity();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  std::vector<std::pair<Eigen::Matrix3d, Eigen::Vector3d>> steps;
  GyroFit fit;
  const TrackedPose* before = &poses.front();
  for (const TrackedPose& pose : poses) {
    if (pose.timestamp - before->timestamp < kGyroStep) continue;
    const auto step = integrate(before->timestamp, pose.timestamp, {});
    if (!step) return std::nullopt;
    const Eigen::Quaterniond turn(before->world_from_camera.linear().transpose() * pose.world_from_camera.linear());
    before = &pose;
    const Eigen::Vector3d error = rotation_vector(step->rotation.conjugate() * turn);
    steps.emplace_back(step->rotation_by_gyro, error);
    normal += step->rotation_by_gyro.transpose() * step->rotation_by_gyro;
    right += step->rotation_by_gyro.transpose() * error;
    fit.motion += rotation_vector(turn).squaredNorm();
  }
  fit.bias = normal.ldlt().solve(right);
  for (const auto& [jacobian, error] : steps) fit.error += (error - jacobian * fit.bias).squaredNorm();
  const double count = static_cast<double>(steps.size());
  fit.motion = std::sqrt(fit.motion / count), fit.error = std::sqrt(fit.error / count);
  return fit;
}

/// Position of the camera at each pose, from position p, velocity v, gravity g, accelerometer bias b and lever l:
///   p + R_k l + t v + t^2/2 g + R_0 (dp + dp/db b).
std::optional<LinearFit> fit_linear(const std::vector<TrackedPose>& poses, const InertialBias& bias,
                                    const Integrate& integrate) {
  using Normal = Eigen::Matrix<double, 15, 15>;
  using Rows = Eigen::Matrix<double, 3, 15>;
  Normal normal = Normal::Zero();
  Eigen::Matrix<double, 15, 1> right = Eigen::Matrix<double, 15, 1>::Zero();
  std::vector<std::pair<Rows, Eigen::Vector3d>> equations;
  const Eigen::Matrix3d first = poses.front().world_from_camera.linear();
  for (const TrackedPose& pose : poses) {
    const double t = pose.timestamp - poses.front().timestamp;
    const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
    Rows rows = Rows::Zero();
    rows << identity, t * identity, 0.5 * t * t * identity, Eigen::Matrix3d::Zero(), pose.world_from_camera.linear();
    Eigen::Vector3d value = pose.world_from_camera.translation();
    if (t > 0) {
      const auto motion = integrate(poses.front().timestamp, pose.timestamp, bias);
      if (!motion) return std::nullopt;
      value -= first * motion->position;
      rows.middleCols<3>(9) = first * motion->position_by_acceleration;
    }
    normal += rows.transpose() * rows / (kPoseSigma * kPoseSigma);
    right += rows.transpose() * value / (kPoseSigma * kPoseSigma);
    equations.emplace_back(rows, value);
  }
  normal.diagonal().segment<3>(9).array() += 1 / (kAccelerationPrior * kAccelerationPrior);
  normal.diagonal().segment<3>(12).array() += 1 / (kLeverPrior * kLeverPrior);
  const Eigen::LDLT<Normal> solver(normal);
  const Eigen::Matrix<double, 15, 1> x = solver.solve(right);
  LinearFit fit{x.segment<3>(3), x.segment<3>(6)};
  for (const auto& [rows, value] : equations) fit.error += (value - rows * x).squaredNorm();
  fit.error = std::sqrt(fit.error / static_cast<double>(equations.size()));
  const Normal covariance = solver.solve(Normal::Identity());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> gravity(covariance.block<3, 3>(6, 6));
  fit.gravity_sigma = std::sqrt(std::max(0.0, gravity.eigenvalues().maxCoeff()));
  return fit;
}

}  // namespace

double InertialOdometry::Prediction::position_sigma() const {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance.block<3, 3>(3, 3));
  return std::sqrt(std::max(0.0, solver.eigenvalues().maxCoeff()));
}

void InertialOdometry::add(const std::vector<AngularRate>& rates, const std::vector<Acceleration>& accelerations) {
  if (!camera_from_imu_ || state_.is_contradicted) return;
  for (const AngularRate& r : rates)
    if (state_.rates.empty() || r.timestamp > state_.rates.back().timestamp)
      state_.rates.push_back({r.timestamp, *camera_from_imu_ * r.rate});
  for (const Acceleration& a : accelerations)
    if (state_.accelerations.empty() || a.timestamp > state_.accelerations.back().timestamp)
      state_.accelerations.push_back(a);
  forget_samples();
}

/// Samples from before all that can be integrated, and all samples of a sensor alone.
void InertialOdometry::forget_samples() {
  if (state_.rates.empty() || state_.accelerations.empty()) {
    // Memory of a recording with one of both sensors.
    if (state_.rates.size() > 100) state_.rates.clear();
    if (state_.accelerations.size() > 100) state_.accelerations.clear();
    return;
  }
  const double newest = std::max(state_.rates.back().timestamp, state_.accelerations.back().timestamp);
  double since = newest - kMaxSeconds - 1;
  if (state_.filter) since = std::max(since, state_.test ? state_.test->timestamp : state_.filter->timestamp);
  if (!state_.filter && !state_.window.empty()) since = std::max(since, state_.window.front().timestamp);
  if (state_.keyframe) since = std::min(since, std::max(*state_.keyframe - kMaxLag, newest - kMaxSeconds - 1));
  const auto forget = [&](auto& samples) {
    const auto first =
        std::find_if(samples.begin(), samples.end(), [&](const auto& s) { return s.timestamp >= since; });
    if (first - samples.begin() > 1) samples.erase(samples.begin(), first - 1);
  };
  forget(state_.rates), forget(state_.accelerations);
}

void InertialOdometry::reset_world() {
  if (state_.filter && is_trusted()) state_.prior = state_.filter;
  state_.filter.reset();
  end_test();
  state_.window.clear();
  state_.rejected = 0;
}

bool InertialOdometry::is_trusted() const {
  return state_.filter && state_.is_tested && failures(state_.passed_rotation) <= kMaxTrustedFailures &&
         failures(state_.passed_position) <= kMaxTrustedFailures;
}

/// Mean rate of the sensor around the filter's time.
Eigen::Vector3d InertialOdometry::rate(const Filter& filter) const {
  const auto& rates = state_.rates;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  const auto end = std::upper_bound(rates.begin(), rates.end(), filter.timestamp + kRateWindow,
                                    [](double t, const AngularRate& r) { return t < r.timestamp; });
  for (auto it = end; it != rates.begin() && std::prev(it)->timestamp >= filter.timestamp - kRateWindow; --it)
    sum += std::prev(it)->rate, ++count;
  return count > 0 ? Eigen::Vector3d(sum / count - filter.bias.gyro) : Eigen::Vector3d::Zero();
}

/// Propagation by pre-integrated samples, Forster et al. 2017, eq. 26 and its linearization.
bool InertialOdometry::propagate(Filter& f, double timestamp) const {
  InertialNoise noise = noise_;
  noise.gyro *= state_.noise_scale, noise.acceleration *= state_.noise_scale;
  const auto motion = preintegrate(state_.rates, state_.accelerations, f.timestamp, timestamp, f.bias, noise);
  if (!motion) return false;
  const double dt = motion->seconds;
  const Eigen::Matrix3d r = f.rotation.toRotationMatrix(), turn = motion->rotation.toRotationMatrix();
  Matrix24d by_error = Matrix24d::Identity();
  by_error.block<3, 3>(kRotation, kRotation) = turn.transpose();
  by_error.block<3, 3>(kRotation, kGyro) = motion->rotation_by_gyro;
  by_error.block<3, 3>(kVelocity, kRotation) = -r * cross_matrix(motion->velocity);
  by_error.block<3, 3>(kVelocity, kGyro) = r * motion->velocity_by_gyro;
  by_error.block<3, 3>(kVelocity, kAcceleration) = r * motion->velocity_by_acceleration;
  by_error.block<3, 3>(kPosition, kRotation) = -r * cross_matrix(motion->position);
  by_error.block<3, 3>(kPosition, kVelocity) = dt * Eigen::Matrix3d::Identity();
  by_error.block<3, 3>(kPosition, kGyro) = r * motion->position_by_gyro;
  by_error.block<3, 3>(kPosition, kAcceleration) = r * motion->position_by_acceleration;
  const Eigen::Matrix<double, 3, 2> by_direction = gravity_by_direction(f.gravity);
  by_error.block<3, 2>(kVelocity, kGravityDirection) = dt * by_direction;
  by_error.block<3, 2>(kPosition, kGravityDirection) = 0.5 * dt * dt * by_direction;
  Matrix9d to_world = Matrix9d::Zero();  // (rotation, velocity, position) to the order of the errors
  to_world.block<3, 3>(0, 0).setIdentity();
  to_world.block<3, 3>(3, 6) = r;
  to_world.block<3, 3>(6, 3) = r;
  f.covariance = by_error * f.covariance * by_error.transpose();
  f.covariance.topLeftCorner<9, 9>() += to_world * motion->covariance * to_world.transpose();
  f.covariance.diagonal().segment<3>(kGyro).array() += noise_.gyro_walk * noise_.gyro_walk * dt;
  f.covariance.diagonal().segment<3>(kAcceleration).array() += noise_.acceleration_walk * noise_.acceleration_walk * dt;
  f.position += dt * f.velocity + 0.5 * dt * dt * f.gravity + r * motion->position;
  f.velocity += dt * f.gravity + r * motion->velocity;
  f.rotation = (f.rotation * motion->rotation).normalized();
  f.timestamp = timestamp;
  return true;
}

InertialOdometry::Prediction InertialOdometry::prediction(const Filter& f) const {
  const Eigen::Vector3d rate_now = rate(f);
  const Jacobian h = pose_jacobian(f, rate_now);
  Filter at_clock = f;
  at_clock.rotation = f.rotation * rotation_by(f.clock * rate_now);
  at_clock.position += f.clock * f.velocity;
  return {world_from_camera(at_clock), h * f.covariance * h.transpose()};
}

bool InertialOdometry::correct(Filter& f, const TrackedPose& pose) const {
  const Jacobian h = pose_jacobian(f, rate(f));
  const Vector6d error = error_of(prediction(f).world_from_camera, pose.world_from_camera);
  const Eigen::LDLT<Matrix6d> sum(Matrix6d(h * f.covariance * h.transpose() + pose.covariance));
  if (error.dot(sum.solve(error)) > kChiSquared999) return false;
  const Jacobian gain = sum.solve(h * f.covariance);  // transposed
  const Eigen::Matrix<double, 24, 1> x = gain.transpose() * error;
  f.covariance -= gain.transpose() * h * f.covariance;
  f.covariance = (0.5 * (f.covariance + f.covariance.transpose())).eval();
  f.rotation = (f.rotation * rotation_by(x.segment<3>(kRotation))).normalized();
  f.position += x.segment<3>(kPosition);
  f.velocity += x.segment<3>(kVelocity);
  f.bias.gyro += x.segment<3>(kGyro);
  f.bias.acceleration += x.segment<3>(kAcceleration);
  f.gravity =
      kStandardGravity * (f.gravity + gravity_by_direction(f.gravity) * x.segment<2>(kGravityDirection)).normalized();
  f.imu_from_camera = (f.imu_from_camera * rotation_by(x.segment<3>(kExtrinsic))).normalized();
  f.lever += x.segment<3>(kLever);
  f.clock += x[kClock];
  return true;
}

std::optional<InertialOdometry::Filter> InertialOdometry::initial_state() {
  const auto& poses = state_.window;
  const Integrate integrate = [this](double since, double until, const InertialBias& bias) {
    return preintegrate(state_.rates, state_.accelerations, since, until, bias, noise_);
  };
  const auto gyro = fit_gyro(poses, integrate);
  if (!gyro) {
    if (state_.rates.back().timestamp < poses.back().timestamp - kMaxLag &&
        ++state_.failed_starts >= kMaxFailedStarts) {
      state_.is_gyro_contradicted = true;
      contradict();
    }
    return std::nullopt;
  }
  InertialBias bias{gyro->bias, Eigen::Vector3d::Zero()};
  const auto linear = fit_linear(poses, bias, integrate);
  if (!linear || linear->gravity_sigma > kMaxGravitySigma) return std::nullopt;
  const bool rotates_differently =
      gyro->error > kStartRotationNoise + kMaxStartRotationError * gyro->motion || gyro->bias.norm() > kMaxGyroBias;
  const bool moves_differently =
      std::abs(linear->gravity.norm() - kStandardGravity) > kMaxGravityError || linear->error > kMaxStartError;
  if (rotates_differently || moves_differently) {
    if (++state_.failed_starts < kMaxFailedStarts) return std::nullopt;
    state_.is_gyro_contradicted = rotates_differently;
    contradict();
    return std::nullopt;
  }
  Filter f;
  f.timestamp = poses.front().timestamp;
  f.rotation = Eigen::Quaterniond(poses.front().world_from_camera.linear());
  f.position = poses.front().world_from_camera.translation(), f.velocity = linear->velocity;
  f.gravity = kStandardGravity * linear->gravity.normalized();
  f.bias.gyro = gyro->bias;
  const std::pair<int, double> priors[] = {{kGyro, kGyroPrior}, {kAcceleration, kAccelerationPrior}};
  for (const auto& [at, sigma] : priors) set_prior(f.covariance, at, 3, sigma);
  set_prior(f.covariance, kExtrinsic, 3, kExtrinsicPrior);
  set_prior(f.covariance, kLever, 3, kLeverPrior);
  set_prior(f.covariance, kClock, 1, kClockPrior);
  if (state_.prior) {
    const Filter& known = *state_.prior;
    f.bias = known.bias, f.imu_from_camera = known.imu_from_camera, f.lever = known.lever, f.clock = known.clock;
    f.rotation = f.rotation * f.imu_from_camera.conjugate();
    f.position = poses.front().world_from_camera.translation() - f.rotation * f.lever;
    f.covariance = known.covariance;
  }
  set_prior(f.covariance, kRotation, 3, kRotationPrior);
  set_prior(f.covariance, kPosition, 3, kPositionPrior);
  set_prior(f.covariance, kVelocity, 3, kVelocityPrior);
  set_prior(f.covariance, kGravityDirection, 2, kGravityPrior);
  return f;
}

/// Filters the window's poses again, from the linear solution.
void InertialOdometry::initialize() {
  std::optional<Filter> filter = initial_state();
  if (!filter) return;
  for (const TrackedPose& pose : state_.window) {
    if (pose.timestamp > filter->timestamp && !propagate(*filter, pose.timestamp)) return;
    (void)correct(*filter, pose);
  }
  state_.filter = filter;
  state_.window.clear();
}

void InertialOdometry::update(double timestamp, const Eigen::Isometry3d& pose, const Matrix6d& covariance) {
  State& s = state_;
  if (s.is_contradicted || s.rates.empty() || s.accelerations.empty()) return;
  const TrackedPose tracked{timestamp, pose, covariance};
  if (s.filter && (timestamp - s.filter->timestamp > kMaxSeconds || !propagate(*s.filter, timestamp))) reset_world();
  if (s.filter) {
    if (correct(*s.filter, tracked)) {
      s.rejected = 0;
    } else if (++s.rejected >= (s.is_tested ? kMaxRejectedByTested : kMaxRejected)) {
      // The map moved or the camera was found elsewhere: the filter restarts.
      const bool has_passed = failures(s.passed_position) < static_cast<std::ptrdiff_t>(s.passed_position.size());
      if (!has_passed && (s.failed_starts += kFailedStartsOfReset) >= kMaxFailedStarts) return contradict();
      reset_world();
    }
    compare(tracked);
  }
  if (!s.filter && !s.is_contradicted) {
    if (!s.window.empty() && timestamp - s.window.back().timestamp > kMaxPoseGap) s.window.clear();
    s.window.push_back(tracked);
    while (timestamp - s.window.front().timestamp > kMaxWindow) s.window.erase(s.window.begin());
    if (timestamp - s.window.front().timestamp >= kMinWindow && ++s.poses_since_start >= kStartInterval) {
      s.poses_since_start = 0;
      initialize();
    }
  }
  forget_samples();
}

/// Test: the state propagated without poses for kTestSeconds, compared with the tracked pose.
void InertialOdometry::compare(const TrackedPose& pose) {
  State& s = state_;
  if (!s.filter) return end_test();
  if (s.test) s.test_poses.push_back(pose);
  if (s.test && pose.timestamp - s.test->timestamp >= kTestSeconds) {
    Filter free = *s.test;
    const TestMotion motion = motion_of(s.test_poses);
    end_test();
    if (pose.timestamp - free.timestamp <= kMaxTestSeconds && propagate(free, pose.timestamp)) {
      const Prediction predicted = prediction(free);
      const Vector6d error = error_of(predicted.world_from_camera, pose.world_from_camera);
      adapt_noise(error.dot(Matrix6d(predicted.covariance + pose.covariance).ldlt().solve(error)) / 6);
      if (motion.rotation > kMinTestRotation)
        add_test(error.head<3>().norm(), motion.rotation, kPassedRotation, kFailedRotation, s.passed_rotation);
      if (motion.deviation > kMinTestPosition)
        add_test(error.tail<3>().norm(), motion.deviation, kPassedPosition, kFailedPosition, s.passed_position);
      s.is_tested |= passes(s.passed_rotation) && passes(s.passed_position);
      if (!s.is_tested) {  // later failures are the tracking's
        s.is_gyro_contradicted = failures(s.passed_rotation) > kMaxFailures;
        if (s.is_gyro_contradicted || failures(s.passed_position) > kMaxFailures) return contradict();
      }
    }
  }
  if (s.test) return;
  s.test = s.filter;
  s.test_poses = {pose};
}

/// Vibration, steps of a walk and drift of the map exceed the noise of the sensor. `squared`: error of a test in
/// variances.
void InertialOdometry::adapt_noise(double squared) {
  const double factor = std::pow(std::clamp(squared, 1 / kMaxNoiseChange, kMaxNoiseChange), kNoiseAdaption);
  state_.noise_scale = std::clamp(factor * state_.noise_scale, 1.0, kMaxNoiseScale);
}

void InertialOdometry::end_test() {
  state_.test.reset();
  state_.test_poses.clear();
}

void InertialOdometry::contradict() {
  const bool gyro = state_.is_gyro_contradicted;
  state_ = {};
  state_.is_contradicted = true, state_.is_gyro_contradicted = gyro;
}

InertialKeyframe InertialOdometry::take_keyframe(double timestamp, const Eigen::Isometry3d& world_from_camera) {
  InertialKeyframe keyframe;
  if (state_.is_contradicted || !has_samples()) return keyframe;
  const std::optional<Filter>& known = state_.filter ? state_.filter : state_.prior;
  const double clock = known ? known->clock : 0;
  InertialNoise noise = noise_;
  noise.gyro *= state_.noise_scale, noise.acceleration *= state_.noise_scale;
  if (const auto before = std::exchange(state_.keyframe, timestamp))
    keyframe.step = preintegrate(state_.rates, state_.accelerations, *before + clock, timestamp + clock,
                                 known ? known->bias : InertialBias{}, noise);
  if (!is_trusted()) return keyframe;
  const auto direction = state_.filter->covariance.block<2, 2>(kGravityDirection, kGravityDirection);
  keyframe.gravity = MeasuredGravity{world_from_camera.linear().transpose() * state_.filter->gravity.normalized(),
                                     std::max(kMinGravitySigma, std::sqrt(direction.trace()))};
  return keyframe;
}

InertialReport InertialOdometry::report() const {
  if (state_.is_contradicted) return {.state = InertialReport::State::contradicted};
  if (!has_samples()) return {};
  const std::optional<Filter>& known = state_.filter && is_trusted() ? state_.filter : state_.prior;
  if (!known) return {.state = InertialReport::State::untested};
  const auto direction = known->covariance.block<2, 2>(kGravityDirection, kGravityDirection);
  return {.state = InertialReport::State::trusted,
          .gyroscope_bias = known->bias.gyro,
          .accelerometer_bias = known->bias.acceleration,
          .imu_from_camera = known->imu_from_camera,
          .lever = known->lever,
          .clock = known->clock,
          .gravity_sigma = std::sqrt(direction.trace())};
}

std::optional<InertialMount> InertialOdometry::mount() const {
  if (!is_trusted()) return std::nullopt;
  return InertialMount{state_.filter->imu_from_camera, state_.filter->lever};
}

std::optional<InertialOdometry::Prediction> InertialOdometry::predict(double timestamp) const {
  if (!is_trusted() || timestamp - state_.filter->timestamp > kMaxSeconds) return std::nullopt;
  Filter f = *state_.filter;
  if (timestamp != f.timestamp && !propagate(f, timestamp)) return std::nullopt;
  return prediction(f);
}

}  // namespace cairn
