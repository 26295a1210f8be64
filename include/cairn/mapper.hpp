// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "cairn/esdf.hpp"
#include "cairn/export.hpp"
#include "cairn/frame.hpp"
#include "cairn/mesh.hpp"
#include "cairn/options.hpp"
#include "cairn/trajectory.hpp"

namespace cairn {

struct ReadSession;
class SessionWriter;

enum class Poses {
  tracked,  // found by aligning each frame with the map; the world is the first camera's frame,
            // turned so that gravity points along y where Frame::acceleration tells it
  given     // taken from Frame::world_from_camera
};

enum class FrameState {
  fused,   // has a pose and is part of the map
  lost,    // no trustworthy pose: not fused
  skipped  // could not be used at all
};

/// What became of one frame.
struct FrameReport {
  int index = 0;
  double timestamp = 0.0;  // seconds
  FrameState state = FrameState::skipped;
  std::string reason;         // why lost or skipped
  double inlier_share = 0.0;  // see Alignment in src/track/align.hpp
  double overlap = 0.0;
  double rmse = 0.0;                                       // standard deviations of the depth noise
  double photometric_share = 0.0, photometric_rmse = 0.0;  // brightness in 0..1; 0: no colour was used
  int degenerate_directions = 0, unobserved = 0;           // directions of the pose, of 6
  double moving = 0.0;                                     // share of the image that was left out since it moves
  std::string guess;                                       // where the alignment started
  int iterations = 0;
  int touched_bricks = 0, new_bricks = 0;
  std::map<std::string, double> stage_ms;  // preprocess, raycast, track, fuse, keyframe, esdf, esdf to host
};

/// What Mapper::refine did.
struct Refined {
  int keyframes = 0;
  int pairs_tried = 0, pairs_aligned = 0, pairs_inlier = 0;  // of keyframes that see the same
  double cost_before = 0, cost = 0;                          // see OptimiseReport in src/graph/pose_graph.hpp
};

/// Two keyframes that were recognised as views of the same place.
struct FoundLoop {
  double from = 0, to = 0;                                     // timestamps, seconds
  Eigen::Isometry3d i_from_j = Eigen::Isometry3d::Identity();  // measured
  int corners = 0;                                             // that agreed
  double inlier_share = 0, rmse = 0;  // of the dense alignment, see Alignment in src/track/align.hpp
  bool inlier = true;                 // by the pose graph
};

/// A part of the surface: what lies in one cube of the submap's frame. It replaces what was told of this cube before.
struct SurfacePart {
  int submap = 0;
  Eigen::Vector3i cell = Eigen::Vector3i::Zero();  // the cube's number
  Mesh mesh;                                       // in the submap's frame; may be empty
};

/// What of the surface changed, and where the submaps lie now.
struct SurfaceChanges {
  std::vector<SurfacePart> parts;
  std::vector<Eigen::Isometry3d> world_from_submap;  // by submap; loops move them
};

/// The map from a stream of frames: start here. One frame's way is Mapper::add in src/map/mapper.cpp.
///
///   auto source = cairn::open_recording("rgbd_dataset_freiburg1_desk");
///   cairn::Mapper mapper(source->camera());
///   while (auto frame = source->next()) mapper.add(*frame);
///   cairn::write_mesh("desk.glb", mapper.mesh());
///
/// One thread at a time.
class Mapper {
 public:
  /// `device`: as `cairn devices` numbers them; -1 chooses. Throws std::runtime_error for options out of range (see
  /// check), for a device that cannot be used, and while somebody else writes into Options::session. A session that is
  /// there stays until this one's first checkpoint.
  explicit Mapper(const Camera& camera, const Options& options = {}, Poses poses = Poses::tracked, int device = -1);
  ~Mapper();
  Mapper(Mapper&&) noexcept;

  /// Aligns and fuses the next frame. Bad frames and lost tracking are told in the report. Throws only when the device
  /// fails or its memory does not hold one view; what was fused before can still be read and written.
  FrameReport add(const Frame& frame);
  /// Stages that failed and were switched off since the map can do without them, one line each, in the order in which
  /// it happened.
  [[nodiscard]] const std::vector<std::string>& warnings() const;

  /// Of all fused frames, in the colour camera's clock: with Poses::tracked the depth images' stamps are moved by what
  /// the images tell of the two clocks' difference (Statistics::clock_offset). Frames of pieces that nothing joins with
  /// the largest one are left out.
  /// `recording`: counted from 0 where a session goes on with another one; -1: the last.
  [[nodiscard]] Trajectory trajectory(int recording = -1) const;
  [[nodiscard]] int recordings() const;
  /// The last recording's trajectory for showing it: at most `points` of its poses, two at least, the first and the
  /// newest among them.
  [[nodiscard]] Trajectory path(std::size_t points) const;
  /// Moves the keyframes as all loops so far say, as mesh() and write_map() do: call it before trajectory() and
  /// write_graph() when no frame follows.
  void settle();
  /// Aligns keyframes that see the same with each other and corrects the poses; mesh() and write_map() follow by moving
  /// the submaps. When it fails the poses stay as they are, and a warning tells why.
  Refined refine();
  /// Fuses all frames again with the poses as they are now, instead of bending submaps. `again` is the same recording
  /// from its begin; `step` is called after each of its frames. When it fails the map stays as it is, and a warning
  /// tells why.
  void reintegrate(Source& again, const std::function<void()>& step = {});
  /// When the keyframes were taken and how many earlier ones were looked through for their places.
  [[nodiscard]] std::vector<std::pair<double, int>> keyframes() const;
  /// Loops that were found while the frames came, in their order.
  [[nodiscard]] std::vector<FoundLoop> loops() const;
  /// Writes the keyframes' pose graph by the extension: .g2o, or .svg, a picture of it. Whole or not at all.
  void write_graph(const std::filesystem::path& file) const;

  /// Writes all that is needed to go on from here into Options::session, beside the next frames. `note` is given back
  /// by resume. A kill at any moment leaves the last checkpoint that was written.
  void checkpoint(const std::string& note = {});
  /// Waits for the checkpoint being written. Returns why session files cannot be written, or nothing; the map is not
  /// harmed.
  [[nodiscard]] std::string session_problem() const;
  /// Goes on from the session in Options::session as if nothing had happened. Throws std::runtime_error if there is
  /// none, it is damaged, or it was made with another camera or voxel size.
  [[nodiscard]] static Mapper resume(const Camera& camera, const Options& options, int device = -1);
  struct SessionInfo {
    Camera camera;
    float voxel_size = 0, truncation = 0;  // metres
    float min_depth = 0, max_depth = 0;    // metres, see SurfaceOptions
    std::string note;                      // what checkpoint was given
  };
  /// Throws as resume does.
  [[nodiscard]] static SessionInfo session_info(const std::filesystem::path& folder);
  /// A session as it was made, to look at it; other options have their defaults. Nothing in the folder changes, and a
  /// mapper that goes on writing there is not disturbed. Throws as resume does.
  [[nodiscard]] static Mapper open(const std::filesystem::path& folder, int device = -1);
  /// The same to go on with: `to` is another session's folder, where the copy counts from its first checkpoint.
  [[nodiscard]] static Mapper copy(const std::filesystem::path& folder, const std::filesystem::path& to,
                                   int device = -1);
  /// Another recording follows, which begins somewhere in the map or outside of it. Frames are tracked once their place
  /// is recognised; before that they are lost, and after a while they begin a piece of their own.
  void begin_recording();
  struct Merged {
    int compared = 0, loops = 0;  // keyframes of the other session; loops to this one
    bool joined = false;
  };
  /// Adds the map of another session with the same camera and voxels, by what both have seen. Throws std::runtime_error
  /// when they differ, or one has no folder for its session.
  Merged merge(Mapper& other);
  /// The surface as it is in the volume, in the world frame, with normals and colours.
  [[nodiscard]] Mesh mesh();
  /// Writes the surface: clean, simplified, textured and packed as asked for; by the extension .glb, .gltf, .ply, .obj,
  /// or a tileset.json (3D Tiles 1.1) with its tiles beside it. It works cell by cell. Each file whole or not at all,
  /// the one that was asked for last. Throws std::runtime_error with what is wrong and what to do.
  Exported export_mesh(const std::filesystem::path& file, const ExportOptions& options = {},
                       const ExportProgress& progress = {});
  /// The surface as it grows, for showing it: parts that changed since they were asked for, new ones first, as many as
  /// `max_bricks` cubes of 8 voxels hold; well-known places come rarely. `all`: also those. The first call begins to
  /// follow the surface with all that is on the device. Submaps lie as rigid bodies; mesh() bends them.
  [[nodiscard]] SurfaceChanges surface_changes(int max_bricks = 1000, bool all = false);
  /// The distance field of the whole map, made anew from its surface.
  [[nodiscard]] std::shared_ptr<const DistanceField> distances();
  /// With EsdfOptions::live the field as of the last frame, in the frame in which the camera is tracked: that of the
  /// world before loops correct it. Null before the first frame, and once it cannot be made. Any thread may ask while
  /// another one adds frames.
  [[nodiscard]] std::shared_ptr<const DistanceField> live_distances() const;
  /// Writes the grids `tsdf`, `weight` and `colour`, with EsdfOptions::live also `esdf`, to a .vdb file, whole or not
  /// at all.
  void write_map(const std::filesystem::path& file);

  struct Statistics {
    std::string device;
    std::uint64_t device_memory_peak = 0;  // bytes
    std::uint64_t bricks = 0, paged_out = 0, paged_in = 0;
    int keyframes = 0, submaps = 0, components = 0;
    int looked_up = 0, loops_tried = 0;  // keyframes looked for among earlier ones; pairs that were aligned
    double graph_ms = 0, world_ms = 0;   // the longest optimisation; the longest update of the world's volume
    std::uint64_t submap_memory_peak = 0, submaps_read_back = 0;  // bytes on the host; from the disk
    double clock_offset = 0;  // seconds that the colour camera's clock is ahead of the depth camera's
    FocalEvidence focal;
    std::optional<double> tilt;  // radians between the world's y axis and gravity as all fused frames measured it
    std::map<std::string, std::pair<int, double>> kernels;  // calls and total milliseconds on the device, by kernel
  };
  [[nodiscard]] Statistics statistics() const;

 private:
  struct State;
  explicit Mapper(std::unique_ptr<State> state);
  [[nodiscard]] static std::unique_ptr<State> restore(ReadSession read, const Options& options, int device,
                                                      std::unique_ptr<SessionWriter> writer);
  std::unique_ptr<State> state_;
};

}  // namespace cairn
