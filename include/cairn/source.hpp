// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "cairn/frame.hpp"
#include "cairn/trajectory.hpp"

namespace cairn {

struct FrameRange {
  int begin = 0;           ///< frame, counted from 0
  std::optional<int> end;  ///< one past the last
  int step = 1;            ///< every step-th
};

struct SourceOptions {
  FrameRange range;
  std::filesystem::path
      camera;  ///< camera.yaml in place of the intrinsics that the recording or sensor tells, and where
               ///< the colour camera is (of a sensor: when it cannot register depth to colour itself)
  std::optional<SensorModel> sensor;  ///< in place of the model that the recording or sensor is known for
  /// Whether a colour camera is looked for (seconds) where a recording is known to tell it wrongly or not at all.
  bool find_colour_camera = true;
  bool depth_only = false;  ///< frames have no colour where that is faster: of folders of images and of .sens files
  std::filesystem::path copy_to;  ///< .oni file that gets every image of a sensor, depth exactly; empty: none
  /// Of a ROS recording with several cameras; empty: chosen by type, that with the most messages.
  std::string depth_topic, colour_topic;
};

/// What a ROS recording holds under a name.
struct RecordedTopic {
  enum class Holds { depth, colour, other };
  std::string name, type;                 ///< type as in ROS 1: sensor_msgs/Image
  std::optional<std::uint64_t> messages;  ///< nothing where the recording has no index
  Holds holds = Holds::other;
};
/// Whether a name is that of a ROS recording: a .bag, .mcap or .db3 file, a folder of rosbag2, or a .zip of these.
[[nodiscard]] bool is_ros_recording(const std::string& name);
/// Its topics, by name. Throws std::runtime_error for a file that cannot be read.
[[nodiscard]] std::vector<RecordedTopic> recorded_topics(const std::string& ros_recording);

/// Opens an input by its name:
///
/// - a folder, whose layout is recognised by its files: TUM RGB-D, ETH3D and Bonn (rgb.txt and depth.txt), 7-Scenes
///   (frame-000000.depth.png), ICL-NUIM (associations.txt with a negative fy), Stray Scanner
///   (rgb.mp4), images with intrinsics.json, nerfstudio (transforms.json), Record3D (metadata.json), Polycam
///   (keyframes), Open3D (intrinsic.json or camera_intrinsic.json), RTAB-Map (rgb, depth and calib or
///   calibration.yaml), Replica (results with traj.txt or cam_params.json);
/// - an .oni file;
/// - an .mkv file of the Azure Kinect's recorder; a .sens file (ScanNet);
/// - a recording of ROS: .bag, .mcap or .db3, or the folder of rosbag2 with its metadata.yaml;
/// - a .zip of one of these, which is unpacked into a temporary folder (TMPDIR, else /var/tmp) that stays until another
///   .zip is opened or the program ends;
/// - a folder of a part of a plan (parts.hpp): its recording's frames, of which `range` counts those of the part;
/// - `openni:` for the first sensor, `openni:URI` for the one that OpenNI2 has under this URI;
/// - `synthetic:NAME`, a scene (see synthetic_scene) rendered on the fly.
///
/// Throws std::runtime_error with what is missing, where, and what to do.
[[nodiscard]] std::unique_ptr<Source> open_source(const std::string& name, const SourceOptions& options = {});

/// Whether a name is a sensor's, which has no end and waits for nobody.
[[nodiscard]] bool is_sensor(std::string_view name);
/// Whether a name is that of a scene which open_source renders.
[[nodiscard]] bool is_synthetic(std::string_view name);

/// Decodes `ahead` frames in a thread of its own.
[[nodiscard]] std::unique_ptr<Source> read_ahead(std::unique_ptr<Source> source, int ahead = 4);

/// Gives each frame the pose of the trajectory at its time, between two that are at most `max_gap` seconds apart;
/// others get none.
[[nodiscard]] std::unique_ptr<Source> with_poses(std::unique_ptr<Source> source, Trajectory world_from_camera,
                                                 double max_gap = 0.1);

/// The same for Frame::guess: poses in a world of their own, of which only the steps from frame to frame are used.
[[nodiscard]] std::unique_ptr<Source> with_guesses(std::unique_ptr<Source> source, Trajectory guesses,
                                                   double max_gap = 0.1);

/// Which frames are for judging the map alone: of those that `range` takes from a recording every `every`-th, the
/// first of them after `every` - 1 others. None where it is 0.
struct HoldOut {
  int every = 0;
  FrameRange range;
};
/// Marks these frames as Frame::held_out, wherever the source begins: see Frame::index. Throws std::runtime_error where
/// `every` is 1 or negative.
[[nodiscard]] std::unique_ptr<Source> hold_out(std::unique_ptr<Source> source, const HoldOut& which);

/// Colour as the depth camera sees it: each depth pixel asks the colour image for what it shows, and the rig has one
/// camera. A source whose colour lies on depth stays as it is.
[[nodiscard]] std::unique_ptr<Source> with_colour_on_depth(std::unique_ptr<Source> source);

/// Poses that a recording carries for the truth, by frame timestamp (groundtruth.txt, frame-*.pose.txt, odometry.csv,
/// those in a .sens file, a synthetic scene's own); empty when it has none, as .mkv and .oni files never do. Of a file
/// that is no recording: its poses, see read_trajectory.
[[nodiscard]] Trajectory recorded_truth(const std::filesystem::path& recording);

/// A source that changes how or when the frames of another one are given.
class WrappedSource : public Source {
 public:
  explicit WrappedSource(std::unique_ptr<Source> source) : source_(std::move(source)) {}
  const Rig& rig() const override { return source_->rig(); }
  std::string layout() const override { return source_->layout(); }
  std::optional<int> size() const override { return source_->size(); }
  std::optional<std::string> ended_early() const override { return source_->ended_early(); }
  int dropped() const override { return source_->dropped(); }

 protected:
  std::unique_ptr<Source> source_;
};

}  // namespace cairn
