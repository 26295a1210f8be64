// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/mapping/frame.hpp"
#include "cairn/mapping/trajectory.hpp"

namespace cairn {

struct FrameRange {
  int begin = 0;           ///< first frame, counted from 0
  std::optional<int> end;  ///< one past the last frame
  int step = 1;            ///< every step-th frame
};

/// State of the run that reads a source, for the answers to a program that sends the frames (`tcp:`, `ws:`).
struct TrackingState {
  enum class Is { unknown, tracking, lost };
  std::atomic<Is> is = Is::unknown;  ///< after the last frame
  std::atomic<int> dropped = 0;      ///< frames not used, because the run was slower than the stream
};

struct SourceOptions {
  FrameRange range;
  std::filesystem::path camera;  ///< camera.yaml that overrides the intrinsics of the recording or sensor, and the
                                 ///< color camera's pose (of a sensor: if it cannot register depth to color itself)
  std::optional<SensorModel> sensor;  ///< overrides the noise model known for the recording or sensor
  /// Estimates the color camera's pose (takes seconds) for recordings known to store it wrongly or not at all.
  bool find_color_camera = true;
  bool depth_only = false;        ///< omits color where this is faster: folders of images and .sens files
  std::filesystem::path copy_to;  ///< .oni file for a copy of all images of a sensor, with exact depth; empty: none
  /// Topics of a ROS recording with several cameras; empty: chosen by type, with the most messages.
  std::string depth_topic, color_topic;
  std::shared_ptr<const TrackingState> tracking;  ///< updated by the run; null: unknown
};

/// A topic of a ROS recording.
struct RecordedTopic {
  enum class Holds { depth, color, other };
  std::string name, type;                 ///< type in ROS 1 notation: sensor_msgs/Image
  std::optional<std::uint64_t> messages;  ///< nullopt for a recording without an index
  Holds holds = Holds::other;
};
/// True for the name of a ROS recording: a .bag, .mcap or .db3 file, a rosbag2 folder, or a .zip of these; and for
/// running topics, `ros2:`.
[[nodiscard]] bool is_ros_recording(const std::string& name);
/// Topics of a recording, sorted by name. Throws std::runtime_error for an unreadable file.
[[nodiscard]] std::vector<RecordedTopic> recorded_topics(const std::string& ros_recording);

/// Opens an input by its name:
///
/// - a folder, with its layout detected from its files: TUM RGB-D, ETH3D and Bonn (rgb.txt and depth.txt), 7-Scenes
///   (frame-000000.depth.png), ICL-NUIM (associations.txt with a negative fy), Stray Scanner (rgb.mp4), images with
///   intrinsics.json, nerfstudio (transforms.json), Record3D (metadata.json), Polycam (keyframes), Open3D
///   (intrinsic.json or camera_intrinsic.json), RTAB-Map (rgb, depth and calib or calibration.yaml), Replica (results
///   with traj.txt or cam_params.json);
/// - an .oni file;
/// - an .mkv file of the Azure Kinect's recorder; a .sens file (ScanNet);
/// - a ROS recording: .bag, .mcap or .db3, or a rosbag2 folder with its metadata.yaml;
/// - a .zip of one of these, unpacked into a temporary folder (TMPDIR, else /var/tmp) that remains until another .zip
///   is opened or the program ends;
/// - the folder of a project's segment (building/project.hpp): frames of its recording; `range` counts within the
/// segment;
/// - `openni:` for the first sensor, `openni:URI` for the sensor with this OpenNI2 URI; `realsense:` and `k4a:` (Azure
///   Kinect, Orbbec Femto) for the first camera, with a serial number for another: an unplugged camera is waited for,
///   with a frame with a `problem` each second;
/// - `tcp:PORT`, `tcp:HOST:PORT`, `ws:PORT` or `ws:HOST:PORT`: frames of a program that connects (docs/inputs.md);
///   waits for its first message;
/// - `ros2:` for the topics of a running ROS 2 graph in the domain ROS_DOMAIN_ID, else 0; `ros2:DOMAIN` for another; a
///   publisher that is gone is waited for like a camera;
/// - `synthetic:NAME`, a scene (see synthetic_scene) rendered on the fly.
///
/// Throws std::runtime_error with the missing item, its place and the remedy.
[[nodiscard]] std::unique_ptr<Source> open_source(const std::string& name, const SourceOptions& options = {});

/// True for the name of a sensor: an endless stream in real time.
[[nodiscard]] bool is_sensor(std::string_view name);
/// True for the name of a synthetic scene rendered by open_source.
[[nodiscard]] bool is_synthetic(std::string_view name);

/// Decodes up to `ahead` frames in advance, in its own thread.
[[nodiscard]] std::unique_ptr<Source> read_ahead(std::unique_ptr<Source> source, int ahead = 4);

/// Sets each frame's pose by interpolation of the trajectory at its time, between poses at most `max_gap` seconds from
/// each other; other frames get no pose.
[[nodiscard]] std::unique_ptr<Source> with_poses(std::unique_ptr<Source> source, Trajectory world_from_camera,
                                                 double max_gap = 0.1);

/// Sets Frame::guess in the same manner. The poses have their own world; only relative motion between frames is used.
[[nodiscard]] std::unique_ptr<Source> with_guesses(std::unique_ptr<Source> source, Trajectory guesses,
                                                   double max_gap = 0.1);

/// Selection of held-out frames: every `every`-th frame of `range`, the first after `every` - 1 other frames. 0: none.
struct HoldOut {
  int every = 0;
  FrameRange range;
};
/// Sets Frame::held_out of the selected frames by Frame::index, independent of the source's first frame. Throws
/// std::runtime_error if `every` is 1 or negative.
[[nodiscard]] std::unique_ptr<Source> hold_out(std::unique_ptr<Source> source, const HoldOut& which);

/// Registers color to depth: each depth pixel samples the color image, and the rig has a single camera. Leaves an
/// already registered source unchanged.
[[nodiscard]] std::unique_ptr<Source> with_color_on_depth(std::unique_ptr<Source> source);

/// Ground-truth poses stored with a recording, by frame timestamp (groundtruth.txt, frame-*.pose.txt, odometry.csv,
/// poses in a .sens file or of a synthetic scene); empty without them; .mkv and .oni files have none. For any other
/// file: its poses, see read_trajectory.
[[nodiscard]] Trajectory recorded_truth(const std::filesystem::path& recording);

/// Base of sources that modify the frames of another source or their timing.
class WrappedSource : public Source {
 public:
  explicit WrappedSource(std::unique_ptr<Source> source) : source_(std::move(source)) {}
  const Rig& rig() const override { return source_->rig(); }
  std::string layout() const override { return source_->layout(); }
  std::optional<int> size() const override { return source_->size(); }
  std::optional<std::string> ended_early() const override { return source_->ended_early(); }
  bool has_assumed_rate() const override { return source_->has_assumed_rate(); }
  int dropped() const override { return source_->dropped(); }

 protected:
  std::unique_ptr<Source> source_;
};

/// Frame::index of the first frame of a recording, by its name: 0, except for a segment, whose frames keep the indices
/// of the recording. Ranges (SourceOptions::range) count from it.
[[nodiscard]] int first_index(const std::string& recording);

}  // namespace cairn
