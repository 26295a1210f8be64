// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "base/checked_count.hpp"
#include "cairn/mapping/esdf.hpp"

namespace cairn {
namespace {

constexpr int kSide = 16;
constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
constexpr int kMaxBlock = 1 << 27;  // blocks from the origin, so that voxel indices fit into 32 bits
constexpr std::uint64_t kEntriesPerBlock = 64, kAnyEntries = 1 << 16;  // table entries; the field of a floor takes 3 to
                                                                       // 20 per block
constexpr float kMinGradient = 1e-3f;                                  // shorter gradients have no direction
constexpr std::size_t kPointsPerTask = 4096;                           // points per task

int index_in(const Eigen::Vector3i& v) { return (v.x() & 15) << 8 | (v.y() & 15) << 4 | (v.z() & 15); }

std::array<int, 3> key_of(const Eigen::Vector3i& block) { return {block.x(), block.y(), block.z()}; }

std::size_t index_in_box(const Eigen::Vector3i& at, const Eigen::Vector3i& size) {
  const auto number = [](int i) { return static_cast<std::size_t>(i); };
  return (number(at.x()) * number(size.y()) + number(at.y())) * number(size.z()) + number(at.z());
}

void check_sizes(std::size_t points, std::size_t answers) {
  if (points != answers)
    throw std::invalid_argument(std::to_string(points) + " points need as many answers, not " +
                                std::to_string(answers));
}

}  // namespace

DistanceField::DistanceField(float voxel_size, const Eigen::Vector3f& origin, float max_distance, Blocks blocks,
                             const Eigen::Quaternionf& world_from_field)
    : voxel_size_(voxel_size),
      origin_(origin),
      max_distance_(max_distance),
      blocks_(std::move(blocks)),
      world_from_field_(world_from_field) {
  if (blocks_.empty()) return;
  Eigen::AlignedBox3i box;
  for (const auto& [block, samples] : blocks_) {
    if ((block.array() < -kMaxBlock).any() || (block.array() >= kMaxBlock).any())
      throw std::invalid_argument("a block of the distance field is out of range");
    box.extend(block);
  }
  first_ = box.min();
  size_ = box.sizes() + Eigen::Vector3i::Ones();
  if (const std::uint64_t entries = product(size_.x(), size_.y(), size_.z());
      entries <= kEntriesPerBlock * blocks_.size() + kAnyEntries) {
    table_.resize(entries);
    for (const auto& [block, samples] : blocks_) table_[index_in_box(block - first_, size_)] = samples.get();
    return;
  }
  sorted_.reserve(blocks_.size());
  for (const auto& [block, samples] : blocks_) sorted_.push_back({key_of(block), samples.get()});
  std::sort(sorted_.begin(), sorted_.end());
}

const DistanceField::Block* DistanceField::block_of(const Eigen::Vector3i& voxel) const {
  const Eigen::Vector3i block = voxel.unaryExpr([](int i) { return i >> 4; });
  const Eigen::Vector3i b = block - first_;
  if ((b.array() < 0).any() || (b.array() >= size_.array()).any()) return nullptr;
  if (!table_.empty()) return table_[index_in_box(b, size_)];
  const auto key = key_of(block);
  const auto it = std::lower_bound(sorted_.begin(), sorted_.end(), key,
                                   [](const auto& entry, const auto& wanted) { return entry.first < wanted; });
  return it != sorted_.end() && it->first == key ? it->second : nullptr;
}

float DistanceField::at(const Eigen::Vector3i& voxel) const {
  const Block* block = block_of(voxel);
  return block == nullptr ? kUnknown : (*block)[static_cast<std::size_t>(index_in(voxel))];
}

DistanceField::Answer DistanceField::query(const Eigen::Vector3f& point) const {
  const Eigen::Vector3f p = (world_from_field_.conjugate() * point - origin_) / voxel_size_;
  constexpr float kMaxIndex = 1e8f;                       // limit for conversion to int
  if (!(p.cwiseAbs().maxCoeff() < kMaxIndex)) return {};  // rejects NaN, too
  const Eigen::Vector3i low = p.array().floor().cast<int>();
  const Eigen::Vector3f h = p - low.cast<float>();
  std::array<float, 8> corner;  // x << 2 | y << 1 | z
  const Eigen::Vector3i v = low.unaryExpr([](int i) { return i & 15; });
  if ((v.array() < kSide - 1).all()) {  // all eight corner voxels are in the same block
    const Block* block = block_of(low);
    if (block == nullptr) return {};
    const float* s = block->data() + index_in(v);
    corner = {s[0], s[1], s[16], s[17], s[256], s[257], s[272], s[273]};
  } else {
    for (int c = 0; c < 8; ++c)
      corner[static_cast<std::size_t>(c)] = at(low + Eigen::Vector3i(c >> 2, c >> 1 & 1, c & 1));
  }
  const float x0 = 1 - h.x(), y0 = 1 - h.y(), z0 = 1 - h.z(), x1 = h.x(), y1 = h.y(), z1 = h.z();
  const float z00 = corner[0] * z0 + corner[1] * z1, z01 = corner[2] * z0 + corner[3] * z1,
              z10 = corner[4] * z0 + corner[5] * z1, z11 = corner[6] * z0 + corner[7] * z1;
  const float yz0 = z00 * y0 + z01 * y1, yz1 = z10 * y0 + z11 * y1;
  Answer answer{.known = true, .distance = yz0 * x0 + yz1 * x1};
  answer.gradient = {yz1 - yz0, (z01 - z00) * x0 + (z11 - z10) * x1,
                     ((corner[1] - corner[0]) * y0 + (corner[3] - corner[2]) * y1) * x0 +
                         ((corner[5] - corner[4]) * y0 + (corner[7] - corner[6]) * y1) * x1};
  if (std::isnan(answer.distance)) {
    // A corner is unknown: extrapolate from the nearest voxel and its known neighbors.
    const Eigen::Vector3i nearest = p.array().round().cast<int>();
    const float here = at(nearest);
    if (std::isnan(here)) return {};
    for (int axis = 0; axis < 3; ++axis) {
      const float before = at(nearest - Eigen::Vector3i::Unit(axis)), after = at(nearest + Eigen::Vector3i::Unit(axis));
      const float low_side = std::isnan(before) ? here : before, high_side = std::isnan(after) ? here : after;
      const float span = std::isnan(before) || std::isnan(after) ? 1.0f : 2.0f;
      answer.gradient[axis] = (high_side - low_side) / span;
    }
    answer.distance = here + answer.gradient.dot(p - nearest.cast<float>());
  }
  const float length = answer.gradient.norm();
  answer.gradient = length < kMinGradient * voxel_size_
                        ? Eigen::Vector3f::Zero()
                        : Eigen::Vector3f(world_from_field_ * (answer.gradient / length));
  return answer;
}

void DistanceField::query(std::span<const Eigen::Vector3f> points, std::span<Answer> answers) const {
  check_sizes(points.size(), answers.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points.size(), kPointsPerTask), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) answers[i] = query(points[i]);
  });
}

void DistanceField::query(std::span<const Eigen::Vector3f> points, std::span<float> distances,
                          std::span<Eigen::Vector3f> gradients, std::span<bool> known) const {
  for (const std::size_t answers : {distances.size(), gradients.size(), known.size()})
    check_sizes(points.size(), answers);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points.size(), kPointsPerTask), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      const Answer answer = query(points[i]);
      distances[i] = answer.known ? answer.distance : kUnknown;
      gradients[i] = answer.gradient;
      known[i] = answer.known;
    }
  });
}

Eigen::AlignedBox3f DistanceField::bounds() const {
  Eigen::AlignedBox3f box;
  for (const auto& [block, samples] : blocks_)
    for (int i = 0; i < 4096; ++i)
      if (!std::isnan((*samples)[static_cast<std::size_t>(i)])) box.extend(point(voxel(block, i).cast<float>()));
  return box;
}

}  // namespace cairn
