// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/lines.hpp"
#include "cairn/inspect.hpp"
#include "cairn/rig.hpp"
#include "cairn/source.hpp"
#include "cairn/trajectory.hpp"

namespace cairn {

/// What a folder of images says about itself, whatever its layout. Paths are absolute or relative to the program.
struct Recording {
  struct Entry {
    double timestamp;  // seconds
    std::filesystem::path depth;
    std::filesystem::path colour;                 // empty: none
    double colour_delay = 0;                      // seconds after the depth image
    std::optional<Eigen::Vector3d> acceleration;  // see Frame
    std::filesystem::path confidence;             // 8 bits, of depth's size; empty: none
  };
  std::string layout;  // see Source
  Rig rig;
  /// Of the intrinsics nothing is known: what to do is told for this folder. Empty: they are.
  std::filesystem::path camera_missing;
  bool is_plain = false;     // a folder as people have them: see_images() is for it
  bool size_is_told = true;  // false: the rig's size is not that of the images
  bool unit_is_told = true;  // false: depth_scale is what the layout has where nothing else is told
  std::vector<Understood> understood;
  std::vector<std::string> warnings, notes;  // of what was found in the folder, a line each
  bool colour_is_told = true;     // false: the layout tells no colour camera, and colour does not lie on depth
  double colour_readout = 0;      // seconds, of a colour camera that is not told
  double depth_scale = 5000.0;    // depth image units per metre
  double most_confidence = 255;   // of those images
  std::vector<AngularRate> gyro;  // in the order of time
  int invalid_depth = 0;          // a second value that means "no measurement", beside 0
  std::vector<Entry> entries;
  Trajectory truth;  // world_from_camera; empty when there is none
  /// Colour of entry i, bytes R, G, B, 255, where it is no file: i must grow from call to call. Empty: none.
  std::function<std::vector<std::uint32_t>(int)> colour_of;
  std::optional<std::string> ended_early;  // see Source
};

// Each reads one layout, or returns nothing when the folder has another. Errors are thrown with file and line.
[[nodiscard]] std::optional<Recording> read_tum(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Recording> read_seven_scenes(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Recording> read_icl_nuim(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Recording> read_stray_scanner(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Recording> read_intrinsics_folder(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Recording> read_image_folder(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Recording> read_replica(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Recording> read_rtabmap(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Recording> read_nerfstudio(const std::filesystem::path& folder);

/// Looks into some images of a plain folder for what nobody tells: the size, and the unit of depth. Scales a camera of
/// another size. Throws where that has another shape, or where none can be read.
void see_images(Recording& recording);
/// How far the ratio of width and height may be beside another's of the same shape: sizes are rounded to whole pixels.
inline constexpr double kMostStretch = 0.02;
/// The size of an image in pixels; nothing where it cannot be read.
[[nodiscard]] std::optional<Eigen::Vector2i> size_of_image(const std::filesystem::path& file);
/// The same view in another number of pixels.
[[nodiscard]] Camera scaled_to(const Camera& camera, const Eigen::Vector2i& size);
/// Sets the cameras of a recording whose depth is seen from the colour camera's place, perhaps in another size: that of
/// the first depth image that can be read. Throws where that has another shape.
void set_rig_in_one_place(const Camera& colour, Recording& recording);

/// The source with the cameras of a camera.yaml or of this name; as it is without one. Throws std::runtime_error for
/// other sizes.
[[nodiscard]] std::unique_ptr<Source> with_cameras(std::unique_ptr<Source> source,
                                                   const std::filesystem::path& camera_file);

/// The frames of a folder, whatever its layout, as range, camera and find_colour_camera of the options say. Throws
/// std::runtime_error with what is missing, where, and what to do.
[[nodiscard]] std::unique_ptr<Source> open_recording(const std::filesystem::path& folder,
                                                     const SourceOptions& options = {});

}  // namespace cairn
