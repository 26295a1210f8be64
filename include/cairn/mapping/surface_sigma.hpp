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

/// Uncertainty of an adjusted map's surface: standard deviation along the surface normal, per cubic cell with side
/// kCell. In the world frame of the adjustment, before gravity alignment; meters. The same calls of `add` give
/// bit-identical results on all machines.
class SurfaceSigma {
 public:
  static constexpr double kCell = 0.05;  ///< meters; cell centers are integer multiples

  struct Cell {
    Eigen::Vector3i at = Eigen::Vector3i::Zero();  ///< center in units of kCell
    double variance = 0;                           ///< sum of weighted variances, m^2
    double weight = 0;                             ///< sum of weights
    [[nodiscard]] float sigma() const;             ///< meters
  };

  SurfaceSigma() = default;
  /// Restores from cells().
  explicit SurfaceSigma(const std::vector<Cell>& cells);

  /// Adds a surface point to the sums of its cell. Ignores points that are not
  /// finite or beyond 800 km, and any sigma or weight that is not positive.
  void add(const Eigen::Vector3d& point, double sigma, double weight = 1);

  [[nodiscard]] bool empty() const { return cells_.empty(); }
  /// Sigma at a point: interpolated between the centers of known cells around it, else from the known cell with the
  /// nearest center. Empty if this is more than two cells away.
  [[nodiscard]] std::optional<float> at(const Eigen::Vector3d& point) const;
  /// Sigma for each point: at(), or the largest of all cells if unknown, so that unknown surface never appears certain.
  /// Empty if no cell is known.
  [[nodiscard]] std::vector<float> at_each(const std::vector<Eigen::Vector3f>& points) const;
  /// Quantile over the cells, an approximation by surface area: 0.5 is the median, 1 the maximum. 0 if no cell is
  /// known.
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
