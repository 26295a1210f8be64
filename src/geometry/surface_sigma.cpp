// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/surface_sigma.hpp"

#include <algorithm>
#include <cmath>

namespace cairn {
namespace {

constexpr double kMaxCoordinate = 1 << 24;  // cells from the origin; prevents integer overflow
constexpr int kMaxCellDistance = 2;         // maximum distance to the nearest known cell, in cells

bool is_in_range(const Eigen::Vector3d& in_cells) {
  return (in_cells.array().abs() < kMaxCoordinate).all();
}  // false for NaN

bool precedes(const SurfaceSigma::Cell& a, const SurfaceSigma::Cell& b) {
  return std::lexicographical_compare(a.at.data(), a.at.data() + 3, b.at.data(), b.at.data() + 3);
}

}  // namespace

float SurfaceSigma::Cell::sigma() const { return static_cast<float>(std::sqrt(variance / weight)); }

SurfaceSigma::SurfaceSigma(const std::vector<Cell>& cells) {
  for (const Cell& cell : cells) cells_.emplace(cell.at, cell);
}

std::size_t SurfaceSigma::Hash::operator()(const Eigen::Vector3i& at) const noexcept {
  std::uint64_t h = 0;
  for (const int i : at) h = (h ^ static_cast<std::uint32_t>(i)) * 0x9e3779b97f4a7c15u;
  return h ^ h >> 32;
}

const SurfaceSigma::Cell* SurfaceSigma::find(const Eigen::Vector3i& at) const {
  const auto found = cells_.find(at);
  return found == cells_.end() ? nullptr : &found->second;
}

void SurfaceSigma::add(const Eigen::Vector3d& point, double sigma, double weight) {
  const Eigen::Vector3d in_cells = point / kCell;
  if (!is_in_range(in_cells) || !(sigma > 0) || !(weight > 0) || !std::isfinite(sigma) || !std::isfinite(weight))
    return;
  const Eigen::Vector3i at = in_cells.array().round().cast<int>();
  Cell& cell = cells_.try_emplace(at, Cell{.at = at}).first->second;
  cell.variance += weight * sigma * sigma;
  cell.weight += weight;
}

std::optional<float> SurfaceSigma::at(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d in_cells = point / kCell;
  if (!is_in_range(in_cells)) return std::nullopt;
  const Eigen::Vector3i low = in_cells.array().floor().cast<int>();
  double variance = 0, weight = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3i at = low + Eigen::Vector3i(corner & 1, corner >> 1 & 1, corner >> 2);
    const Cell* cell = find(at);
    if (cell == nullptr) continue;
    const double share = (1 - (in_cells - at.cast<double>()).array().abs()).prod();
    variance += share * cell->variance / cell->weight;
    weight += share;
  }
  constexpr double kMinWeight = 1e-6;  // minimum weight: excludes cells that only touch the point
  if (weight > kMinWeight) return static_cast<float>(std::sqrt(variance / weight));
  const Cell* nearest = nullptr;
  double nearest_squared = kMaxCellDistance * kMaxCellDistance;
  for (int x = -kMaxCellDistance; x <= kMaxCellDistance + 1; ++x)
    for (int y = -kMaxCellDistance; y <= kMaxCellDistance + 1; ++y)
      for (int z = -kMaxCellDistance; z <= kMaxCellDistance + 1; ++z) {
        const Eigen::Vector3i at = low + Eigen::Vector3i(x, y, z);
        const double distance = (in_cells - at.cast<double>()).squaredNorm();
        if (distance > nearest_squared || (distance == nearest_squared && nearest != nullptr)) continue;
        if (const Cell* cell = find(at)) nearest = cell, nearest_squared = distance;
      }
  return nearest == nullptr ? std::nullopt : std::optional(nearest->sigma());
}

std::vector<float> SurfaceSigma::at_each(const std::vector<Eigen::Vector3f>& points) const {
  std::vector<float> sigmas;
  if (empty()) return sigmas;
  const float largest = quantile(1);
  sigmas.reserve(points.size());
  for (const Eigen::Vector3f& point : points) sigmas.push_back(at(point.cast<double>()).value_or(largest));
  return sigmas;
}

float SurfaceSigma::quantile(double share) const {
  if (empty()) return 0;
  std::vector<float> sigmas;
  for (const auto& [at, cell] : cells_) sigmas.push_back(cell.sigma());
  const auto last = static_cast<double>(sigmas.size() - 1);
  const auto nth = sigmas.begin() + static_cast<std::ptrdiff_t>(std::clamp(share, 0.0, 1.0) * last);
  std::nth_element(sigmas.begin(), nth, sigmas.end());
  return *nth;
}

std::vector<SurfaceSigma::Cell> SurfaceSigma::cells() const {
  std::vector<Cell> all;
  all.reserve(cells_.size());
  for (const auto& [at, cell] : cells_) all.push_back(cell);
  std::sort(all.begin(), all.end(), precedes);
  return all;
}

}  // namespace cairn
