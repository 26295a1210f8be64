// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "graph/inertial_graph.hpp"

#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <cmath>
#include <random>

#include "graph/inertial_cost.hpp"
#include "graph/least_squares.hpp"

namespace cairn {
namespace {

const Eigen::Vector3d kDown(0, kStandardGravity, 0);  // m/s^2, in the world

/// Hand motion of a camera with a sensor of a phone's grade: 20 cm and 40 degrees.
struct Hand {
  InertialMount mount{rotation_by({0.02, -0.3, 0.1}), {0.03, -0.02, 0.01}};
  InertialBias bias{{0.006, -0.005, 0.004}, {0.05, -0.04, 0.06}};

  [[nodiscard]] static Eigen::Isometry3d world_from_imu(double t) {
    const auto wave = [&](double hertz, double phase) { return std::sin(2 * M_PI * hertz * t + phase); };
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translate(Eigen::Vector3d(0.2 * wave(0.41, 0), 0.12 * wave(0.53, 1), 0.15 * wave(0.37, 2)));
    pose.rotate(Eigen::AngleAxisd(0.7 * wave(0.31, 3), Eigen::Vector3d::UnitY()));
    pose.rotate(Eigen::AngleAxisd(0.4 * wave(0.43, 4), Eigen::Vector3d::UnitX()));
    return pose;
  }
  [[nodiscard]] Eigen::Isometry3d world_from_camera(double t) const {
    Eigen::Isometry3d imu_from_camera(mount.imu_from_camera);
    imu_from_camera.translation() = mount.lever;
    return world_from_imu(t) * imu_from_camera;
  }
  [[nodiscard]] static Eigen::Vector3d velocity(double t) {
    return (world_from_imu(t + 1e-4).translation() - world_from_imu(t - 1e-4).translation()) / 2e-4;
  }
  /// Motion by samples of 200 Hz, linearized at `at`.
  [[nodiscard]] Preintegration motion(double since, double until, const InertialBias& at,
                                      std::mt19937_64& random) const {
    constexpr double kStep = 0.005, kDifference = 1e-4;  // seconds
    std::normal_distribution<double> normal;
    const auto vector = [&] { return Eigen::Vector3d(normal(random), normal(random), normal(random)); };
    std::vector<AngularRate> rates;
    std::vector<Acceleration> accelerations;
    for (long i = std::lround(since / kStep) - 2; i * kStep <= until + 2 * kStep; ++i) {
      const double t = i * kStep;
      const Eigen::Isometry3d before = world_from_imu(t - kDifference), now = world_from_imu(t),
                              after = world_from_imu(t + kDifference);
      const Eigen::Vector3d rate =
          rotation_vector(Eigen::Quaterniond((before.inverse() * after).linear())) / (2 * kDifference);
      const Eigen::Vector3d force =
          now.linear().transpose() *
          ((before.translation() - 2 * now.translation() + after.translation()) / (kDifference * kDifference) - kDown);
      rates.push_back({t, rate + bias.gyro + 1.2e-4 / std::sqrt(kStep) * vector()});
      accelerations.push_back({t, force + bias.acceleration + 1.6e-3 / std::sqrt(kStep) * vector()});
    }
    return *preintegrate(rates, accelerations, since, until, at, {});
  }
};

/// Parameters of a cost at the hand's motion.
struct Parameters {
  NodePose i, j;
  std::array<double, 9> motion_i{}, motion_j{};
  std::array<double, 3> gravity{};

  Parameters(const Hand& hand, double since, double until)
      : i(node_pose(hand.world_from_camera(since))), j(node_pose(hand.world_from_camera(until))) {
    Eigen::Map<Vector9d>(motion_i.data()) << Hand::velocity(since), hand.bias.gyro, hand.bias.acceleration;
    Eigen::Map<Vector9d>(motion_j.data()) << Hand::velocity(until), hand.bias.gyro, hand.bias.acceleration;
    Eigen::Map<Eigen::Vector3d>(gravity.data()) = kDown;
  }
  [[nodiscard]] std::array<double*, 5> blocks() {
    return {i.data(), j.data(), motion_i.data(), motion_j.data(), gravity.data()};
  }
};

using Residual = Eigen::Matrix<double, 15, 1>;

Residual residual_of(const InertialCost& cost, Parameters parameters) {
  Residual r;
  EXPECT_TRUE(cost.Evaluate(parameters.blocks().data(), r.data(), nullptr));
  return r;
}

TEST(InertialGraph, CostIsSmallAtTheTrueMotion) {
  const Hand hand;
  std::mt19937_64 random(1);
  double sum = 0;
  constexpr int kRuns = 200;
  const InertialNoise noise{.gyro = 1.2e-4, .acceleration = 1.6e-3};
  for (int run = 0; run < kRuns; ++run) {
    const Preintegration motion = hand.motion(0.1 * run, 0.1 * run + 0.5, {}, random);
    const InertialCost cost(motion, hand.mount, noise);
    sum += residual_of(cost, Parameters(hand, 0.1 * run, 0.1 * run + 0.5)).head<9>().squaredNorm() / kRuns;
  }
  EXPECT_LT(sum, 9);  // the default noise is three times larger
  EXPECT_GT(sum, 0.3);
}

TEST(InertialGraph, DerivativesMatchFiniteDifferences) {
  const Hand hand;
  std::mt19937_64 random(2);
  const InertialCost cost(hand.motion(1, 1.8, {{0.01, 0.02, -0.01}, {0.1, 0.2, -0.1}}, random), hand.mount, {});
  Parameters at(hand, 1, 1.8);
  // Away from the minimum, so that all terms count.
  at.j = node_pose(hand.world_from_camera(1.8) * retract((Vector6d() << 0.3, -0.2, 0.4, 0.1, 0.2, -0.1).finished()));
  at.motion_i[4] += 0.2, at.motion_i[7] += 0.5, at.motion_j[1] += 0.3;
  constexpr std::array<int, 5> sizes{7, 7, 9, 9, 3};
  std::array<std::vector<double>, 5> derivatives;
  std::array<double*, 5> jacobians{};
  for (std::size_t b = 0; b < 5; ++b) derivatives[b].resize(15u * static_cast<std::size_t>(sizes[b]));
  for (std::size_t b = 0; b < 5; ++b) jacobians[b] = derivatives[b].data();
  Residual r;
  ASSERT_TRUE(cost.Evaluate(at.blocks().data(), r.data(), jacobians.data()));
  for (std::size_t b = 0; b < 5; ++b)
    for (int axis = 0; axis < (b < 2 ? 6 : sizes[b]); ++axis) {
      constexpr double kStep = 1e-6;
      const auto moved = [&](double step) {
        Parameters p = at;
        if (b < 2) {
          Eigen::Isometry3d t = pose(b == 0 ? at.i : at.j);
          if (axis < 3)
            t.rotate(rotation_by(step * Eigen::Vector3d::Unit(axis)));
          else
            t.pretranslate(step * Eigen::Vector3d::Unit(axis - 3));
          (b == 0 ? p.i : p.j) = node_pose(t);
        } else {
          p.blocks()[b][axis] += step;
        }
        return p;
      };
      Parameters more = moved(kStep), less = moved(-kStep);
      const Eigen::Map<const Eigen::VectorXd> after(more.blocks()[b], sizes[b]), before(less.blocks()[b], sizes[b]);
      const Eigen::VectorXd direction = (after - before) / (2 * kStep);
      const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> jacobian(
          jacobians[b], 15, sizes[b]);
      const Residual numeric = (residual_of(cost, more) - residual_of(cost, less)) / (2 * kStep);
      EXPECT_LT((numeric - jacobian * direction).norm(), 1e-5 * (1 + numeric.norm())) << "block " << b << ", " << axis;
    }
}

TEST(InertialGraph, CostTakesMicroseconds) {
  const Hand hand;
  std::mt19937_64 random(3);
  const InertialCost cost(hand.motion(1, 1.5, {}, random), hand.mount, {});
  Parameters at(hand, 1, 1.5);
  std::vector<double> values(15u * 35u);
  std::array<double*, 5> jacobians{&values[0], &values[105], &values[210], &values[345], &values[480]};
  Residual r;
  double best = 1, sum = 0;
  constexpr int kRepeats = 100;
  for (int run = 0; run < 200; ++run) {
    const auto begin = std::chrono::steady_clock::now();
    for (int k = 0; k < kRepeats; ++k) {
      at.motion_i[0] += 1e-9;
      (void)cost.Evaluate(at.blocks().data(), r.data(), jacobians.data());
      sum += r[0];
    }
    best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() / kRepeats);
  }
  ASSERT_TRUE(std::isfinite(sum));
  std::printf("%.2f us\n", 1e6 * best);
  RecordProperty("microseconds", std::to_string(1e6 * best));
#ifdef NDEBUG
  EXPECT_LT(best, 10e-6);
#endif
}

/// Nodes along the hand's motion, every half second, with noisy odometry.
struct Path {
  static constexpr int kNodes = 41;
  static constexpr double kInterval = 0.5;  // seconds
  Hand hand;
  PoseGraph graph;
  InertialGraph inertial{.mount = hand.mount};

  explicit Path(double radians, double meters) {
    std::mt19937_64 random(4);
    std::normal_distribution<double> normal;
    for (int k = 0; k < kNodes; ++k) {
      if (k == 0) {
        graph.world_from_node.push_back(truth(0));
        continue;
      }
      Vector6d noise;
      for (int i = 0; i < 6; ++i) noise[i] = (i < 3 ? radians : meters) * normal(random);
      const auto before = static_cast<std::size_t>(k - 1);
      PoseGraph::Edge edge{
          .i = before, .j = before + 1, .i_from_j = truth(k - 1).inverse() * truth(k) * retract(noise)};
      edge.information.diagonal() << Eigen::Vector3d::Constant(1 / (radians * radians)),
          Eigen::Vector3d::Constant(1 / (meters * meters));
      graph.edges.push_back(edge);
      graph.world_from_node.push_back(graph.world_from_node.back() * edge.i_from_j);
      inertial.steps.push_back({before, before + 1, hand.motion(kInterval * (k - 1), kInterval * k, {}, random)});
    }
    // The filter's gravity at one node, wrong by 2 degrees.
    inertial.gravity.resize(kNodes);
    inertial.gravity[20] = rotation_by({0.035, 0, 0}) * (truth(20).linear().transpose() * kDown);
  }
  [[nodiscard]] Eigen::Isometry3d truth(int k) const { return hand.world_from_camera(kInterval * k); }
  /// RMS error of the translation between consecutive nodes, m: the beginning of the path fixes its absolute place.
  [[nodiscard]] double step_error() const {
    double squared = 0;
    for (int k = 1; k < kNodes; ++k) {
      const auto at = static_cast<std::size_t>(k);
      const Eigen::Isometry3d step = graph.world_from_node[at - 1].inverse() * graph.world_from_node[at];
      squared += (step.translation() - (truth(k - 1).inverse() * truth(k)).translation()).squaredNorm() / (kNodes - 1);
    }
    return std::sqrt(squared);
  }
  /// Max. tilt in degrees against the vertical at the first node.
  [[nodiscard]] double tilt() const {
    double max = 0;
    for (int k = 0; k < kNodes; ++k) {
      const Eigen::Vector3d estimated =
          graph.world_from_node[static_cast<std::size_t>(k)].linear().transpose() * kDown.normalized();
      max = std::max(max, std::acos(estimated.dot(truth(k).linear().transpose() * kDown.normalized())));
    }
    return 57.29578 * max;
  }
};

TEST(InertialGraph, RecoversAKnownTrajectoryAndGravity) {
  Path with(0.01, 0.01), without(0.01, 0.01);
  (void)optimize(without.graph);
  (void)optimize(with.graph, &with.inertial);
  std::printf("step %.4f -> %.4f m, tilt %.2f -> %.2f degrees\n", without.step_error(), with.step_error(),
              without.tilt(), with.tilt());
  EXPECT_LT(with.step_error(), 0.7 * without.step_error());
  EXPECT_LT(with.tilt(), 0.25 * without.tilt());
  for (const int k : {0, 20, 40}) {
    const Eigen::Vector3d down = with.truth(k).linear().transpose() * kDown;
    EXPECT_LT(57.29578 * std::acos(with.inertial.gravity[static_cast<std::size_t>(k)]->dot(down) / down.squaredNorm()),
              0.5);
  }
}

TEST(InertialGraph, LoopClosureDoesNotTiltTheMap) {
  Path with(0.002, 0.002), without(0.002, 0.002);
  for (Path* path : {&with, &without}) {
    // From the first to the last node, wrong by 0.1 rad of roll.
    PoseGraph::Edge loop{.i = 0, .j = Path::kNodes - 1, .is_loop_closure = true};
    loop.i_from_j = path->truth(0).inverse() * path->truth(Path::kNodes - 1) *
                    retract((Vector6d() << 0, 0, 0.1, 0, 0, 0).finished());
    loop.information.diagonal() << Eigen::Vector3d::Constant(1e4), Eigen::Vector3d::Constant(1e4);
    path->graph.edges.push_back(loop);
  }
  (void)optimize(without.graph, OptimizeOptions{.robust = false});
  (void)optimize(with.graph, &with.inertial, OptimizeOptions{.robust = false});
  std::printf("tilt %.2f, without %.2f degrees\n", with.tilt(), without.tilt());
  EXPECT_GT(without.tilt(), 1.5);
  EXPECT_LT(with.tilt(), 0.7);
}

TEST(InertialGraph, StepsWithoutGravityChangeNothing) {
  Path with(0.01, 0.01), without(0.01, 0.01);
  with.inertial.gravity.assign(Path::kNodes, std::nullopt);
  (void)optimize(without.graph);
  (void)optimize(with.graph, &with.inertial);
  for (std::size_t k = 0; k < Path::kNodes; ++k)
    EXPECT_EQ(with.graph.world_from_node[k].matrix(), without.graph.world_from_node[k].matrix());
  EXPECT_FALSE(with.inertial.gravity[0]);
}

}  // namespace
}  // namespace cairn
