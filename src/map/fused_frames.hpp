// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

namespace cairn {

/// Fused or held-out frame. Kept at 40 bytes, since a run of hours has many frames.
struct FusedFrame {
  double timestamp = 0;        // seconds
  std::uint32_t keyframe = 0;  // newest keyframe at this time
  /// Logarithm of keyframe_from_camera. The distance is short, so that single precision is accurate to a micrometer.
  Eigen::Matrix<float, 6, 1> twist = Eigen::Matrix<float, 6, 1>::Zero();
};

/// Frames of a run in order. Full chunks are immutable: copies share them, and a session writes each chunk once, so
/// that the cost of a checkpoint does not grow with the duration of the run.
class FusedFrames {
 public:
  static constexpr std::size_t kChunk = 1024;  // frames
  using Chunk = std::vector<FusedFrame>;

  void push_back(const FusedFrame& frame) {
    rest_.reserve(kChunk);
    rest_.push_back(frame);
    if (rest_.size() == kChunk) full_.push_back(std::make_shared<const Chunk>(std::exchange(rest_, {})));
  }
  /// Appends kChunk frames. All frames before must be in full chunks.
  void push_back(std::shared_ptr<const Chunk> chunk) { full_.push_back(std::move(chunk)); }
  [[nodiscard]] std::size_t size() const { return kChunk * full_.size() + rest_.size(); }
  [[nodiscard]] bool empty() const { return size() == 0; }
  [[nodiscard]] const FusedFrame& operator[](std::size_t i) const {
    return i / kChunk < full_.size() ? (*full_[i / kChunk])[i % kChunk] : rest_[i - kChunk * full_.size()];
  }
  [[nodiscard]] const FusedFrame& back() const { return (*this)[size() - 1]; }
  [[nodiscard]] const std::vector<std::shared_ptr<const Chunk>>& full() const { return full_; }
  /// Newest frames, fewer than a chunk.
  [[nodiscard]] const Chunk& rest() const { return rest_; }

 private:
  std::vector<std::shared_ptr<const Chunk>> full_;
  Chunk rest_;
};

}  // namespace cairn
