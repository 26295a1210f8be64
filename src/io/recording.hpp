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

/// Pixels of an enlarged image that are used: the middle of each block of equal ones.
struct BlockPixels {
  Eigen::Vector2i stored = Eigen::Vector2i::Zero();  // size of the images
  std::vector<int> columns, rows;                    // empty: all
};

/// What a folder of images says about itself, whatever its layout. Paths are absolute or relative to the program.
struct Recording {
  struct Entry {
    double timestamp;  // seconds
    std::filesystem::path depth;
    std::filesystem::path colour;                 // empty: none
    double colour_delay = 0;                      // seconds after the depth image
    std::optional<Eigen::Vector3d> acceleration;  // see Frame
    std::filesystem::path confidence;             // 8 bits, of depth's size; empty: none
    /// What took this frame in place of the rig, in pixels of colour: see set_cameras_of_frames(). Empty: the rig.
    std::shared_ptr<const Camera> camera = {};
  };
  std::string layout;  // see Source
  Rig rig;
  /// Nothing is known of the intrinsics, neither from the recording nor from its layout: settle_camera() looks beside.
  bool camera_is_missing = false;
  std::string camera_missing_words;   // and a clause with what the layout has them in; may be empty
  std::filesystem::path camera_file;  // which its reader took the rig from: no file beside it; empty: from none
  bool is_plain = false;              // a folder as people have them
  bool size_is_told = true;           // false: the rig's size is not that of the images
  bool unit_is_told = true;           // false: see_images() guesses depth_scale
  double frame_rate = 0;  // Hz, by which the reader made times of whole numbers; 0: times are the recording's own
  std::vector<Understood> understood;
  std::vector<std::string> warnings, notes;  // of what was found in the folder, a line each
  bool colour_is_told = true;      // false: the layout tells no colour camera, and colour does not lie on depth
  double colour_readout = 0;       // seconds, of a colour camera that is not told
  double depth_scale = 5000.0;     // depth image units per metre
  double most_confidence = 255;    // of those images
  std::vector<AngularRate> gyro;   // in the order of time
  int invalid_depth = 0;           // a second value that means "no measurement", beside 0
  bool bytes_are_swapped = false;  // of depth images with 16 bits
  BlockPixels blocks;              // of depth images that were enlarged; rig.depth has their true size
  std::vector<Entry> entries;
  Trajectory truth;               // world_from_camera; empty when there is none
  bool has_device_poses = false;  // `truth` is what the device itself found
  /// Colour of entry i, bytes R, G, B, 255, where it is no file: i must grow from call to call. Empty: none.
  std::function<std::vector<std::uint32_t>(int)> colour_of;
  std::optional<std::string> ended_early;  // see Source
};

// Each reads one layout, or returns nothing when the folder has another. Errors are thrown with file and line.
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

/// The one order in which all layouts get their cameras, depth_scale and frame_rate: `option` (a file or a known name;
/// empty: none), a camera file in the folder, the recording itself, what its layout is known to have. Where nothing is
/// told, camera_is_missing stays. Throws std::runtime_error for a file that cannot be read.
void settle_camera(const std::filesystem::path& folder, const std::filesystem::path& option, Recording& recording);
/// Whether a camera file in the folder tells another camera than a layout is known to have, whatever its size and
/// readout.
[[nodiscard]] bool is_told_another(const std::filesystem::path& folder, const Camera& known);

/// accelerometer.txt, gyroscope.txt and groundtruth.txt of a folder, for a recording whose entries are there. Files of
/// another time than the images' become a warning. `units_per_second`: of their times.
void add_motion(const std::filesystem::path& folder, Recording& recording, double units_per_second = 1);

/// Looks into some depth images for what nobody tells: the size, the unit and the order of bytes. Scales a camera of
/// another size, and sets `blocks`. Throws where that has another shape, or where none can be read.
void see_images(Recording& recording);
/// How far the ratio of width and height may be beside another's of the same shape: sizes are rounded to whole pixels.
inline constexpr double kMostStretch = 0.02;
/// The size that most of some color images have; nothing where none can be read.
[[nodiscard]] std::optional<Eigen::Vector2i> usual_color_size(const std::vector<Recording::Entry>& entries);
/// The size of an image in pixels; nothing where it cannot be read.
[[nodiscard]] std::optional<Eigen::Vector2i> size_of_image(const std::filesystem::path& file);
/// The same view in another number of pixels.
[[nodiscard]] Camera scaled_to(const Camera& camera, const Eigen::Vector2i& size);
/// Sets the cameras of a recording whose depth is seen from the colour camera's place, perhaps in another size: that of
/// the first depth image that can be read. Throws where that has another shape.
void set_rig_in_one_place(const Camera& colour, Recording& recording);
/// The same for a camera of each entry, as phones with autofocus have them; the first one's is the recording's, and
/// frames of others are turned into it. Says so in `understood`.
void set_cameras_of_frames(const std::vector<Camera>& cameras, Recording& recording);

/// The source with the cameras of a camera.yaml or of this name; as it is without one. Throws std::runtime_error for
/// other sizes.
[[nodiscard]] std::unique_ptr<Source> with_cameras(std::unique_ptr<Source> source,
                                                   const std::filesystem::path& camera_file);

/// The frames of a folder, whatever its layout, as range, camera and find_colour_camera of the options say. Throws
/// std::runtime_error with what is missing, where, and what to do.
[[nodiscard]] std::unique_ptr<Source> open_recording(const std::filesystem::path& folder,
                                                     const SourceOptions& options = {});

}  // namespace cairn
