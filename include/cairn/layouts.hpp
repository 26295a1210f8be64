// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Recordings in the layouts of other programs and data sets.
#pragma once
#include <filesystem>
#include <memory>
#include <optional>
#include <string_view>

#include "cairn/frame.hpp"
#include "cairn/trajectory.hpp"

namespace cairn {

/// Poses that the device which took a recording found meanwhile, by the timestamps that its frames have with `camera`:
/// an odometry that drifts, no truth (Stray Scanner, the apps that write nerfstudio's layout, RTAB-Map). Empty for
/// other recordings.
[[nodiscard]] Trajectory device_poses(const std::filesystem::path& recording, const std::filesystem::path& camera = {});

/// A folder that is being written in a layout.
class LayoutWriter {
 public:
  virtual ~LayoutWriter() = default;
  /// The frame's images; its pose is Frame::world_from_camera, which must be there. Throws std::runtime_error.
  virtual void add(const Frame& frame) = 0;
  /// What lists the frames: nothing can be read before.
  virtual void finish() = 0;
};

/// Their names.
inline constexpr std::string_view kLayouts[] = {"tum",        "bonn",    "eth3d",        "seven-scenes",
                                                "icl-nuim",   "replica", "open3d",       "rtabmap",
                                                "nerfstudio", "scannet", "stray-scanner"};

/// The only camera that a layout's readers know, with a global shutter; nothing where files tell it.
[[nodiscard]] std::optional<Camera> camera_of_layout(std::string_view layout);

/// Begins a recording in an empty folder. `scannet` writes recording.sens there. Throws std::runtime_error for an
/// unknown layout, and for cameras that the layout cannot tell (a lens, a colour camera of its own, another camera than
/// camera_of_layout), with what to do.
[[nodiscard]] std::unique_ptr<LayoutWriter> write_layout(std::string_view layout, const std::filesystem::path& folder,
                                                         const Rig& rig);

}  // namespace cairn
