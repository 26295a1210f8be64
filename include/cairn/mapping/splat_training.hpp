// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "cairn/eval/evaluation.hpp"
#include "cairn/mapping/map.hpp"
#include "cairn/mapping/splats.hpp"

namespace cairn {

struct SplatOptions {
  int iterations = 7000;    ///< training steps, one image each
  double max_seconds = 0;   ///< seconds of training; 0: no limit
  float resolution = 0.5f;  ///< size of the training images, relative to the color images
  std::size_t max_splats = 300000;
  int degree = 1;              ///< of the spherical harmonics, 0 to 3: view dependence of the colors
  int images = 300;            ///< maximum number of training images from a recording, in memory at once
  int hold_out = 10;           ///< every N-th image is not trained on, but compared in the end; 0: none
  std::filesystem::path mesh;  ///< mesh compared with the same images; empty: none
};

/// Throws std::runtime_error naming the option, its value and the allowed range.
void check(const SplatOptions& options);

struct SplatProgress {
  int iteration = 0, iterations = 0;  ///< 0 during the preparation
  double psnr = 0;                    ///< dB, over recent training images at their size
  std::size_t splats = 0;
  double seconds = 0;        ///< of training
  std::uint64_t memory = 0;  ///< bytes of the training, estimated; during the preparation
};
/// Called after the preparation of each image and after each step. Returns false to end the training, without a
/// comparison.
using SplatStep = std::function<bool(const SplatProgress& progress)>;

struct SplatReport {
  int iterations = 0, images = 0;     ///< steps; training images
  double psnr = 0;                    ///< dB, over recent training images at their size
  double seconds = 0;                 ///< of training, without preparation and comparison
  std::uint64_t memory = 0;           ///< bytes, estimated: of host and device together
  std::optional<ViewError> held_out;  ///< splats against at most 100 of the held-out images at full size
  std::optional<ViewError> mesh;      ///< mesh against the same
  std::string problem;                ///< reason why the held-out images could not be compared; else empty
};

struct TrainedSplats {
  Splats splats;
  SplatReport report;
};

/// Opens the recording of a map from its start; called at most twice.
using OpenRecording = std::function<std::unique_ptr<Source>()>;

/// Trains splats from a map, starting at its surface: from the keyframes, or from the frames of its last recording that
/// `open` returns: in intervals of equal view change, the sharpest. Results of the same device and number of steps are
/// identical. Throws std::runtime_error for a map without keyframes, color or surface, for a recording without frames
/// of the map, and before the preparation if the free memory is too small.
[[nodiscard]] TrainedSplats train_splats(Map& map, const SplatOptions& options = {}, const SplatStep& on_step = {},
                                         const OpenRecording& open = {});

/// Same as evaluate_views for a mesh. `device`: index of list_devices; -1 chooses.
[[nodiscard]] ViewError evaluate_views(const Splats& splats, Source& recording,
                                       const Eigen::Isometry3d& world_from_recording, int step = 10, int device = -1);

}  // namespace cairn
