// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Recordings in the layouts of other programs and data sets.
#pragma once
#include <filesystem>
#include <memory>
#include <optional>
#include <string_view>

#include "cairn/mapping/frame.hpp"
#include "cairn/mapping/trajectory.hpp"

namespace cairn {

/// Odometry poses recorded by the device itself, at the timestamps of its frames read with `camera`: poses with drift,
/// not ground truth (Stray Scanner, apps with nerfstudio's layout, RTAB-Map). Empty for other recordings.
[[nodiscard]] Trajectory device_poses(const std::filesystem::path& recording, const std::filesystem::path& camera = {});

/// Writer of a recording folder in a given layout.
class LayoutWriter {
 public:
  virtual ~LayoutWriter() = default;
  /// Adds a frame's images and its pose, the required Frame::world_from_camera. Throws std::runtime_error.
  virtual void add(const Frame& frame) = 0;
  /// Writes the list of frames; the folder is not readable before.
  virtual void finish() = 0;
};

/// Names of the layouts.
inline constexpr std::string_view kLayouts[] = {"tum",        "bonn",    "eth3d",        "seven-scenes",
                                                "icl-nuim",   "replica", "open3d",       "rtabmap",
                                                "nerfstudio", "scannet", "stray-scanner"};

/// The fixed camera, with a global shutter, assumed by readers of a layout; nullopt if the layout stores its camera.
[[nodiscard]] std::optional<Camera> camera_of_layout(std::string_view layout);

/// Starts a recording in an empty folder. `scannet` writes recording.sens there. Throws std::runtime_error, with the
/// remedy, for an unknown layout and for cameras that the layout cannot represent (a lens, a separate color camera, a
/// camera other than camera_of_layout).
[[nodiscard]] std::unique_ptr<LayoutWriter> write_layout(std::string_view layout, const std::filesystem::path& folder,
                                                         const Rig& rig);

}  // namespace cairn
