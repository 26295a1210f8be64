// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <memory>
#include <optional>
#include <string>

#include "cairn/frame.hpp"
#include "cairn/trajectory.hpp"

namespace cairn {

struct FrameRange {
  int begin = 0;
  std::optional<int> end;  // one past the last
  int step = 1;
};

/// Opens a recording; the layout is recognised by its files (TUM RGB-D: rgb.txt and depth.txt; 7-Scenes:
/// frame-000000.depth.png; ICL-NUIM: associations.txt with a negative fy; intrinsics.json). Throws std::runtime_error
/// with what is missing, where, and what to do. `synthetic:NAME` is opened by synth/source.hpp, an .oni file by
/// open_openni.
[[nodiscard]] std::unique_ptr<Source> open_recording(const std::filesystem::path& folder, const FrameRange& range = {});

struct OpenNiOptions {
  std::filesystem::path camera;   // camera.yaml: intrinsics, and where the colour camera is when the device cannot
                                  // register depth to colour itself; empty: from the field of view
  std::filesystem::path copy_to;  // .oni file that gets every image, depth exactly; empty: none
};

/// A sensor by its OpenNI2 URI, the first one for an empty URI, or an .oni file. Depth is registered to colour by the
/// device, or colour to depth here. Throws std::runtime_error with what is missing and what to install or allow.
[[nodiscard]] std::unique_ptr<Source> open_openni(const std::string& uri, const OpenNiOptions& options = {});

/// Decodes `ahead` frames in a thread of its own.
[[nodiscard]] std::unique_ptr<Source> read_ahead(std::unique_ptr<Source> source, int ahead = 4);

/// Gives each frame the pose of the trajectory at its time, between two that are at most `max_gap` seconds apart;
/// others get none.
[[nodiscard]] std::unique_ptr<Source> with_poses(std::unique_ptr<Source> source, Trajectory world_from_camera,
                                                 double max_gap = 0.1);

/// True poses that a recording carries, by frame timestamp (groundtruth.txt, frame-*.pose.txt); empty when it has none.
[[nodiscard]] Trajectory recorded_truth(const std::filesystem::path& folder);

}  // namespace cairn
