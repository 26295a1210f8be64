// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What the depth camera errs by: surfels are eliminated as where they are put is what the views say on average.
#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <vector>

#include "adjust/bundle.hpp"
#include "base/between_nodes.hpp"

namespace cairn {
namespace {

constexpr int kNodePixels = 16;    // of the camera's own image, from node to node
constexpr std::size_t kParts = 4;  // sums of surfels, added up in this order on every machine
constexpr double kPrior = 0.005;   // 1/m, standard deviation of an offset
constexpr double kSmooth = 0.001;  // 1/m, of the difference of neighbours
constexpr double kUnseen = 1e4;    // m^2: a node that is known worse than to a hundredth of 1/m stays at zero
constexpr double kHeld = 1e14;
constexpr double kFloor = 1e-3;  // a surfel that nothing holds

/// Nodes that a pixel's offset is made of, and their shares.
struct Nodes {
  std::array<int, 4> node;
  std::array<double, 4> share;
  Nodes(const DepthCorrection& grid, const Eigen::Vector2f& place) {
    const BetweenNodes across(place.x(), grid.columns), down(place.y(), grid.rows);
    const int first = down.first * grid.columns + across.first;
    const double u = static_cast<double>(across.share), v = static_cast<double>(down.share);
    node = {first, first + 1, first + grid.columns, first + grid.columns + 1};
    share = {(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v};
  }
};

}  // namespace

struct Bundle::CorrectionSums {
  Eigen::MatrixXd information;  // lower triangle
  Eigen::VectorXd right;
  std::vector<double> own;  // before surfels are eliminated
};

void Bundle::find_correction() {
  const Camera& own = cameras_.rig.depth;
  if (own.width < 2 * kNodePixels || own.height < 2 * kNodePixels) return;
  correction_.columns = own.width / kNodePixels, correction_.rows = own.height / kNodePixels;
  correction_.offsets.assign(static_cast<std::size_t>(correction_.columns * correction_.rows), 0.0f);
  places_.clear();
  for (int y = 0; y < cameras_.depth.height; ++y)
    for (int x = 0; x < cameras_.depth.width; ++x) places_.push_back(cameras_.measured_at(x, y));
  offsets_.assign(places_.size(), 0);
}

void Bundle::add_to(CorrectionSums& sums, std::size_t s) const {
  struct Entry {
    int node;
    double with_surfel;
  };
  std::vector<Entry> entries;
  double information = kFloor, gap = 0;
  Seen seen;
  for (std::uint32_t o = first_[s]; o < first_[s + 1]; ++o) {
    if (!look(surfels_[s], seen_by_[o], false, seen)) continue;
    const Residual& r = seen.residual[0];
    const Nodes nodes(correction_, places_[seen.pixel]);
    const double weight = r.weight / kTogether, by_surfel = r.by_surfel[0];
    information += weight * by_surfel * by_surfel;
    gap += weight * by_surfel * r.value;
    for (std::size_t i = 0; i < 4; ++i) {
      const double by_node = seen.by_offset * nodes.share[i];
      entries.push_back({nodes.node[i], weight * by_surfel * by_node});
      sums.right[nodes.node[i]] -= weight * by_node * r.value;
      for (std::size_t j = 0; j <= i; ++j)
        sums.information(nodes.node[i], nodes.node[j]) += weight * by_node * seen.by_offset * nodes.share[j];
      sums.own[static_cast<std::size_t>(nodes.node[i])] += weight * by_node * by_node;
    }
  }
  for (const Entry& i : entries) {
    sums.right[i.node] += i.with_surfel * gap / information;
    for (const Entry& j : entries)
      if (j.node <= i.node) sums.information(i.node, j.node) -= i.with_surfel * j.with_surfel / information;
  }
}

void Bundle::settle_correction() {
  const auto nodes = static_cast<Eigen::Index>(correction_.offsets.size());
  std::vector<CorrectionSums> parts(kParts, {.information = Eigen::MatrixXd::Zero(nodes, nodes),
                                             .right = Eigen::VectorXd::Zero(nodes),
                                             .own = std::vector<double>(correction_.offsets.size(), 0.0)});
  tbb::parallel_for(std::size_t{0}, kParts, [&](std::size_t p) {
    for (std::size_t s = p * surfels_.size() / kParts; s < (p + 1) * surfels_.size() / kParts; ++s) add_to(parts[p], s);
  });
  CorrectionSums& sum = parts[0];
  for (std::size_t p = 1; p < kParts; ++p) {
    sum.information += parts[p].information, sum.right += parts[p].right;
    for (std::size_t i = 0; i < sum.own.size(); ++i) sum.own[i] += parts[p].own[i];
  }
  const auto offset = [&](Eigen::Index i) {
    return static_cast<double>(correction_.offsets[static_cast<std::size_t>(i)]);
  };
  const auto is_seen = [&](Eigen::Index i) { return sum.own[static_cast<std::size_t>(i)] > kUnseen; };
  const auto smooth = [&](Eigen::Index i, Eigen::Index j) {
    if (!is_seen(i) || !is_seen(j)) return;
    constexpr double kInformation = 1 / (kSmooth * kSmooth);
    sum.information(i, i) += kInformation, sum.information(j, j) += kInformation;
    sum.information(j, i) -= kInformation;
    sum.right[i] -= kInformation * (offset(i) - offset(j)), sum.right[j] -= kInformation * (offset(j) - offset(i));
  };
  for (Eigen::Index i = 0; i < nodes; ++i) {
    sum.information(i, i) += is_seen(i) ? 1 / (kPrior * kPrior) : kHeld;
    sum.right[i] -= offset(i) / (kPrior * kPrior);
    if ((i + 1) % correction_.columns != 0) smooth(i, i + 1);
    if (i + correction_.columns < nodes) smooth(i, i + correction_.columns);
  }
  const Eigen::VectorXd step = sum.information.selfadjointView<Eigen::Lower>().ldlt().solve(sum.right);
  for (Eigen::Index i = 0; i < nodes; ++i)
    correction_.offsets[static_cast<std::size_t>(i)] += static_cast<float>(step[i]);
  for (std::size_t i = 0; i < places_.size(); ++i) offsets_[i] = correction_.at(places_[i].x(), places_[i].y());
}

}  // namespace cairn
