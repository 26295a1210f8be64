// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/surface_sigma.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace cairn {
namespace {

const Eigen::Vector3d kPlace(1.0, -2.0, 0.5);  // center of a cell
constexpr double kStep = SurfaceSigma::kCell;
constexpr float kRounding = 1e-7f;

TEST(SurfaceSigma, IsWeightedMeanOfVariances) {
  SurfaceSigma sigma;
  EXPECT_TRUE(sigma.empty());
  sigma.add(kPlace + Eigen::Vector3d(0.01, 0, 0), 0.001);
  sigma.add(kPlace - Eigen::Vector3d(0.01, 0, 0), 0.003, 3);
  ASSERT_EQ(sigma.cells().size(), 1u);
  EXPECT_EQ(sigma.cells()[0].at, Eigen::Vector3i(20, -40, 10));
  EXPECT_NEAR(*sigma.at(kPlace), std::sqrt((1e-6 + 3 * 9e-6) / 4), kRounding);
}

TEST(SurfaceSigma, IsContinuousBetweenCells) {
  SurfaceSigma sigma;
  const Eigen::Vector3d x(kStep, 0, 0);
  sigma.add(kPlace, 0.001);
  sigma.add(kPlace + x, 0.003);
  EXPECT_NEAR(*sigma.at(kPlace), 0.001, kRounding);
  EXPECT_NEAR(*sigma.at(kPlace + 0.5 * x), std::sqrt(5e-6), kRounding);
  EXPECT_NEAR(*sigma.at(kPlace + 0.999 * x), 0.003, 1e-5);
  EXPECT_NEAR(*sigma.at(kPlace + 1.001 * x), 0.003, 1e-5);
}

TEST(SurfaceSigma, UsesNearestCellWithinTwo) {
  SurfaceSigma sigma;
  sigma.add(kPlace, 0.001);
  sigma.add(kPlace + Eigen::Vector3d(3 * kStep, 0, 0), 0.002);
  for (const double way : {-1.9, -1.0, 0.9})
    EXPECT_NEAR(*sigma.at(kPlace + Eigen::Vector3d(way * kStep, 0, 0)), 0.001, kRounding) << way;
  EXPECT_NEAR(*sigma.at(kPlace + Eigen::Vector3d(4.9 * kStep, 0, 0)), 0.002, kRounding);
  EXPECT_EQ(sigma.at(kPlace - Eigen::Vector3d(2.1 * kStep, 0, 0)), std::nullopt);
  EXPECT_EQ(sigma.at(kPlace + Eigen::Vector3d(0, 1.9 * kStep, 1.9 * kStep)), std::nullopt);
  EXPECT_EQ(sigma.at({std::numeric_limits<double>::quiet_NaN(), 0, 0}), std::nullopt);
}

TEST(SurfaceSigma, IsMaximumInUnknownCells) {
  SurfaceSigma sigma;
  EXPECT_TRUE(sigma.at_each({{0, 0, 0}}).empty());
  sigma.add(kPlace, 0.001);
  sigma.add(kPlace + Eigen::Vector3d(9, 0, 0), 0.004);
  EXPECT_EQ(sigma.at_each({kPlace.cast<float>(), {100, 0, 0}}), (std::vector<float>{0.001f, 0.004f}));
}

TEST(SurfaceSigma, ComputesQuantiles) {
  SurfaceSigma sigma;
  EXPECT_EQ(sigma.quantile(0.5), 0.0f);
  for (int i = 100; i >= 0; --i) sigma.add(kStep * Eigen::Vector3d(i, i, 0), 0.001 * (i + 1));
  EXPECT_NEAR(sigma.quantile(0.5), 0.051, kRounding);
  EXPECT_NEAR(sigma.quantile(0.95), 0.096, kRounding);
  EXPECT_NEAR(sigma.quantile(1), 0.101, kRounding);
}

TEST(SurfaceSigma, ListsCellsInFixedOrder) {
  SurfaceSigma forwards, backwards;
  const auto add = [](SurfaceSigma& sigma, int i) {
    sigma.add(kStep * Eigen::Vector3d(i % 7 - 3, i / 49 - 3, i / 7 % 7 - 3), 0.001 * (i + 1));
  };
  for (int i = 0; i < 343; ++i) add(forwards, i), add(backwards, 342 - i);
  const auto cells = forwards.cells(), same = backwards.cells();
  ASSERT_EQ(cells.size(), 343u);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    EXPECT_EQ(cells[i].at, same[i].at);
    EXPECT_EQ(cells[i].at, Eigen::Vector3i(i / 49, i / 7 % 7, i % 7) - Eigen::Vector3i(3, 3, 3));
    EXPECT_EQ(SurfaceSigma(cells).at(kStep * cells[i].at.cast<double>()), cells[i].sigma());
  }
}

TEST(SurfaceSigma, IgnoresInvalidNumbers) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  SurfaceSigma sigma;
  for (const double bad : {0.0, -1.0, nan, infinity}) {
    sigma.add(kPlace, bad);
    sigma.add(kPlace, 0.001, bad);
  }
  for (const double far : {nan, infinity, -1e30, 1e6}) sigma.add({far, 0, 0}, 0.001);
  EXPECT_TRUE(sigma.empty());
}

}  // namespace
}  // namespace cairn
