// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

namespace cairn {

/// How surely an adjusted map knows where its surface lies: the standard deviation along the surface's normal, in cells
/// of kCell a side. In the world frame in which the map was adjusted, before it is turned upright; metres. The same
/// calls of `add` give the same bits everywhere.
class SurfaceSigma {
 public:
  static constexpr double kCell = 0.05;  ///< metres; a cell's centre is a whole multiple of it

  struct Cell {
    Eigen::Vector3i at = Eigen::Vector3i::Zero();  ///< its centre in units of kCell
    double variance = 0;                           ///< sum of weighted variances, m^2
    double weight = 0;                             ///< sum of weights
    [[nodiscard]] float sigma() const;             ///< metres
  };

  SurfaceSigma() = default;
  /// Of cells() of another one.
  explicit SurfaceSigma(const std::vector<Cell>& cells);

  /// Adds a point of the surface to its cell, which keeps the weighted mean of the variances. A point that is not
  /// finite or more than 800 km away adds nothing, nor does a sigma or weight that is no number above 0.
  void add(const Eigen::Vector3d& point, double sigma, double weight = 1);

  [[nodiscard]] bool empty() const { return cells_.empty(); }
  /// At a point: between the centres of the cells around it that are known, else of the known cell with the nearest
  /// centre. None where that is farther than two cells away.
  [[nodiscard]] std::optional<float> at(const Eigen::Vector3d& point) const;
  /// One for each point: at(), and where that knows none the largest of all cells, so that nothing unknown looks sure.
  /// Empty where no cell is known.
  [[nodiscard]] std::vector<float> at_each(const std::vector<Eigen::Vector3f>& points) const;
  /// What lies below this share of the cells, and so of the surface: 0.5 is the median, 1 the largest. 0 where no cell
  /// is known.
  [[nodiscard]] float quantile(double share) const;
  /// Sorted by x, then y, then z.
  [[nodiscard]] std::vector<Cell> cells() const;

 private:
  struct Hash {
    std::size_t operator()(const Eigen::Vector3i& at) const noexcept;
  };
  [[nodiscard]] const Cell* find(const Eigen::Vector3i& at) const;
  std::unordered_map<Eigen::Vector3i, Cell, Hash> cells_;
};

}  // namespace cairn
