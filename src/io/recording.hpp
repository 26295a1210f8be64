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
#include "cairn/io/inspect.hpp"
#include "cairn/io/source.hpp"
#include "cairn/mapping/rig.hpp"
#include "cairn/mapping/trajectory.hpp"

namespace cairn {

/// Pixels used from an enlarged image: the middle of each block of equal pixels.
struct BlockPixels {
  Eigen::Vector2i stored = Eigen::Vector2i::Zero();  // size of the stored images
  std::vector<int> columns, rows;                    // empty: all
};

/// Content of an image folder, independent of its layout. Paths are absolute or relative to the working directory.
struct Recording {
  struct Entry {
    double timestamp;  // seconds
    std::filesystem::path depth;
    std::filesystem::path color;                  // empty: none
    double color_delay = 0;                       // seconds after the depth image
    std::optional<Eigen::Vector3d> acceleration;  // see Frame
    std::filesystem::path confidence;             // 8 bits, in depth's size; empty: none
    /// Camera of this frame, in pixels of color, if it differs from the rig; see set_frame_cameras(). Null: the
    /// rig.
    std::shared_ptr<const Camera> camera = {};
  };
  std::string layout;  // see Source
  Rig rig;
  /// True if neither the recording nor its layout defines intrinsics; resolve_camera() then searches the folder.
  bool camera_is_missing = false;
  std::string camera_hint;            // clause about the layout's missing camera file; may be empty
  std::filesystem::path camera_file;  // file already read into the rig by the layout's reader; empty: none
  bool is_plain = false;              // a user folder without a specific layout
  bool has_image_size = true;         // false: the images' size differs from the rig's
  bool has_depth_scale = true;        // false: infer_depth_format() estimates depth_scale
  double frame_rate = 0;              // Hz, used by the reader to convert frame numbers to times; 0: times are recorded
  bool has_assumed_rate = false;      // frame_rate is neither recorded nor given
  std::vector<Interpretation> interpretations;
  std::vector<std::string> warnings, notes;  // found in the folder, a line each
  bool has_color_camera = true;   // false: no color camera defined by the layout, and color is not registered to depth
  double color_readout = 0;       // seconds, for an undefined color camera
  double depth_scale = 5000.0;    // depth image units per meter
  double max_confidence = 255;    // maximum of the confidence images
  std::vector<AngularRate> gyro;  // in time order
  std::vector<Acceleration> accelerations;  // in time order
  int invalid_depth = 0;                    // second value for "no measurement", besides 0
  bool bytes_are_swapped = false;           // in 16-bit depth images
  BlockPixels blocks;                       // of enlarged depth images; rig.depth has the true size
  std::vector<Entry> entries;
  Trajectory truth;               // world_from_camera; empty: none
  bool has_device_poses = false;  // `truth` is the device's own estimate
  /// Color of entry i, bytes R, G, B, 255, for color not stored in image files; i must increase from call to call.
  /// Empty: none.
  std::function<std::vector<std::uint32_t>(int)> color_of;
  std::optional<std::string> ended_early;  // see Source
};

// Each function reads one layout, and returns empty for a folder of another layout. Throws std::runtime_error with file
// and line.
[[nodiscard]] std::optional<Recording> read_tum(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Recording> read_seven_scenes(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Recording> read_associations(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Recording> read_stray_scanner(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Recording> read_intrinsics_folder(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Recording> read_image_folder(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Recording> read_replica(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Recording> read_rtabmap(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Recording> read_nerfstudio(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Recording> read_record3d(const std::filesystem::path& folder);
[[nodiscard]] std::optional<Recording> read_polycam(const std::filesystem::path& folder);

/// Decides camera, depth_scale and frame_rate for all layouts, in this order: `option` (a file or a known name; empty:
/// none), a camera file in the folder, the recording itself, known values of its layout. Without any of them,
/// camera_is_missing stays set. Throws std::runtime_error for an unreadable file.
void resolve_camera(const std::filesystem::path& folder, const std::filesystem::path& option, Recording& recording);
/// True if a camera file in the folder differs from the layout's known camera in more than size and readout.
[[nodiscard]] bool has_other_camera(const std::filesystem::path& folder, const Camera& known);

/// Reads accelerometer.txt, gyroscope.txt and groundtruth.txt of a folder into a recording with entries. Files that do
/// not overlap the images in time cause a warning. `units_per_second` applies to the files' times.
void add_motion(const std::filesystem::path& folder, Recording& recording, double units_per_second = 1);

/// Samples some depth images to find a missing image size, unit and byte order. Scales the camera to the images' size,
/// and sets `blocks`. Throws if the aspect ratios differ, or if no image is readable.
void infer_depth_format(Recording& recording);
/// Tolerance of the aspect ratio between images of the same shape, because sizes are rounded to whole pixels.
inline constexpr double kMaxAspectError = 0.02;
/// Returns the most common size among some color images; empty if none is readable.
[[nodiscard]] std::optional<Eigen::Vector2i> common_color_size(const std::vector<Recording::Entry>& entries);
/// Returns the size of an image in pixels; empty if unreadable.
[[nodiscard]] std::optional<Eigen::Vector2i> size_of_image(const std::filesystem::path& file);
/// Returns the same camera with another number of pixels.
[[nodiscard]] Camera scaled_to(const Camera& camera, const Eigen::Vector2i& size);
/// Sets the rig of a recording with depth registered to color, perhaps in another size: the size of the first readable
/// depth image. Throws if the aspect ratios differ.
void set_registered_rig(const Camera& color, Recording& recording);
/// The same with a camera for each entry, as for phones with autofocus. The first camera becomes the recording's, and
/// frames of the other cameras are resampled into it. Adds a line to `interpretations`.
void set_frame_cameras(const std::vector<Camera>& cameras, Recording& recording);

/// Applies the cameras of a camera.yaml or of a known name to the source; unchanged for an empty name. Throws
/// std::runtime_error if the sizes differ.
[[nodiscard]] std::unique_ptr<Source> with_cameras(std::unique_ptr<Source> source,
                                                   const std::filesystem::path& camera_file);

/// Opens a folder of any layout, with the options' range, camera and find_color_camera. Throws std::runtime_error with
/// the missing data, the place and a remedy.
[[nodiscard]] std::unique_ptr<Source> open_recording(const std::filesystem::path& folder,
                                                     const SourceOptions& options = {});

}  // namespace cairn
