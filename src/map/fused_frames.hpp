// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

namespace cairn {

/// A fused frame, or one that was held out. A run of hours has many: 40 bytes each.
struct FusedFrame {
  double timestamp = 0;        // seconds
  std::uint32_t keyframe = 0;  // the newest at its time
  /// keyframe_from_camera, the logarithm: they lie near each other, so that single precision is right to a micrometre.
  Eigen::Matrix<float, 6, 1> twist = Eigen::Matrix<float, 6, 1>::Zero();
};

/// The frames of a run in their order. Those of a full chunk never change again: copies share it, and a session writes
/// it once, so that a checkpoint after hours costs what one after minutes does.
class FusedFrames {
 public:
  static constexpr std::size_t kChunk = 1024;  // frames
  using Chunk = std::vector<FusedFrame>;

  void push_back(const FusedFrame& frame) {
    rest_.reserve(kChunk);
    rest_.push_back(frame);
    if (rest_.size() == kChunk) full_.push_back(std::make_shared<const Chunk>(std::exchange(rest_, {})));
  }
  /// kChunk frames that follow on full chunks.
  void push_back(std::shared_ptr<const Chunk> chunk) { full_.push_back(std::move(chunk)); }
  [[nodiscard]] std::size_t size() const { return kChunk * full_.size() + rest_.size(); }
  [[nodiscard]] bool empty() const { return size() == 0; }
  [[nodiscard]] const FusedFrame& operator[](std::size_t i) const {
    return i / kChunk < full_.size() ? (*full_[i / kChunk])[i % kChunk] : rest_[i - kChunk * full_.size()];
  }
  [[nodiscard]] const FusedFrame& back() const { return (*this)[size() - 1]; }
  [[nodiscard]] const std::vector<std::shared_ptr<const Chunk>>& full() const { return full_; }
  /// The newest, fewer than a chunk.
  [[nodiscard]] const Chunk& rest() const { return rest_; }

 private:
  std::vector<std::shared_ptr<const Chunk>> full_;
  Chunk rest_;
};

}  // namespace cairn
