// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "cairn/mapping/pose.hpp"
#include "cairn/mapping/reports.hpp"
#include "inertial/inertial_keyframe.hpp"

namespace cairn {

/// Estimated state of an InertialOdometry at the time of the last tracked pose.
struct InertialFilter {
  double timestamp = 0;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  // world_from_imu, in the camera's nominal axes
  Eigen::Vector3d position = Eigen::Vector3d::Zero(),
                  velocity = Eigen::Vector3d::Zero();                   // of the sensor, in the world
  InertialBias bias;                                                    // in the camera's nominal axes
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();                    // m/s^2, in the world; of length 9.81
  Eigen::Quaterniond imu_from_camera = Eigen::Quaterniond::Identity();  // correction of the nominal axes
  Eigen::Vector3d lever = Eigen::Vector3d::Zero();  // of the camera from the sensor, m, in the sensor's axes
  double clock = 0;                                 // seconds by which the camera's timestamps are behind the sensor's
  /// Of the errors in the above order; 2 of the gravity's direction, rad.
  Eigen::Matrix<double, 24, 24> covariance = Eigen::Matrix<double, 24, 24>::Zero();
};

/// Camera motion from a gyroscope and an accelerometer: an error-state filter, propagated by pre-integrated samples and
/// corrected by tracked poses. Gravity, velocity and the gyroscope's bias are initialized from one to two seconds of
/// tracked poses in motion (as Qin & Shen 2017, with known scale). Predictions are compared with tracked poses, and
/// returned only after they agreed for some time. World: the frame of the tracked poses.
class InertialOdometry {
 public:
  using Filter = InertialFilter;

  /// `camera_from_imu`: rotation of the gyroscope's axes; none: no prediction.
  explicit InertialOdometry(const std::optional<Eigen::Quaterniond>& camera_from_imu, const InertialNoise& noise = {})
      : camera_from_imu_(camera_from_imu), noise_(noise) {}

  /// Adds the samples of a frame, after the earlier ones; see Frame.
  void add(const std::vector<AngularRate>& rates, const std::vector<Acceleration>& accelerations);
  /// Adds a tracked pose. `covariance`: of (rotation, translation) in the camera's frame; rad^2, m^2.
  void update(double timestamp, const Eigen::Isometry3d& world_from_camera, const Matrix6d& covariance);
  /// Restarts in another world. Biases and extrinsics stay.
  void reset_world();

  struct Prediction {
    Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
    Matrix6d covariance = Matrix6d::Zero();       // of (rotation, translation) in the camera's frame; rad^2, m^2
    [[nodiscard]] double position_sigma() const;  // m, along the worst axis
  };
  /// Pose at a time up to kMaxSeconds after the last tracked pose. Empty before the initialization and the test, if
  /// samples are missing, and for a contradicted sensor.
  [[nodiscard]] std::optional<Prediction> predict(double timestamp) const;
  static constexpr double kMaxSeconds = 3;

  /// Measurements of a keyframe at the last tracked pose, for the pose graph. The next call gives the motion since.
  [[nodiscard]] InertialKeyframe take_keyframe(double timestamp, const Eigen::Isometry3d& world_from_camera);
  /// Mount of the sensor; none: not trusted.
  [[nodiscard]] std::optional<InertialMount> mount() const;

  /// State of the sensor for users.
  [[nodiscard]] InertialReport report() const;

  struct TrackedPose {
    double timestamp = 0;
    Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
    Matrix6d covariance = Matrix6d::Zero();
  };
  /// State for resuming.
  struct State {
    std::vector<AngularRate> rates;           // in the camera's nominal axes
    std::vector<Acceleration> accelerations;  // same
    std::vector<TrackedPose> window;          // poses for the initialization
    std::optional<Filter> filter;             // none: not initialized
    std::optional<Filter> prior;              // biases and extrinsics from before a restart
    int poses_since_start = 0;                // since the last initialization
    std::optional<Filter> test;               // state at the begin of the current test, propagated without poses
    std::vector<TrackedPose> test_poses;      // since then
    std::vector<bool> passed_rotation, passed_position;  // of the last tests with motion, newest last
    bool is_tested = false;                              // enough tests were passed
    double noise_scale = 4;                              // on the sensor's noise, from the errors of the tests
    int failed_starts = 0;                               // initializations in a row that contradict the poses
    int rejected = 0;                                    // poses in a row that contradict the prediction
    bool is_contradicted = false, is_gyro_contradicted = false;
    std::optional<double> keyframe;  // timestamp of the last keyframe
  };
  [[nodiscard]] const State& save() const { return state_; }
  void restore(const State& state) { state_ = state; }

  /// True if samples of both sensors arrive.
  [[nodiscard]] bool has_samples() const { return !state_.rates.empty() && !state_.accelerations.empty(); }
  /// True if predictions are returned.
  [[nodiscard]] bool is_trusted() const;
  /// True if the sensor contradicts the tracked poses, for the rest of the run; in rotation too.
  [[nodiscard]] bool is_contradicted() const { return state_.is_contradicted; }
  [[nodiscard]] bool is_gyro_contradicted() const { return state_.is_gyro_contradicted; }

 private:
  void initialize();
  [[nodiscard]] std::optional<Filter> initial_state();
  [[nodiscard]] bool propagate(Filter& filter, double timestamp) const;
  /// Kalman update by a tracked pose. Returns false, without a change, if both contradict each other.
  [[nodiscard]] bool correct(Filter& filter, const TrackedPose& pose) const;
  [[nodiscard]] Prediction prediction(const Filter& filter) const;
  [[nodiscard]] Eigen::Vector3d rate(const Filter& filter) const;
  void compare(const TrackedPose& pose);
  void adapt_noise(double squared);
  void end_test();
  void contradict();
  void forget_samples();

  std::optional<Eigen::Quaterniond> camera_from_imu_;
  InertialNoise noise_;
  State state_;
};

}  // namespace cairn
