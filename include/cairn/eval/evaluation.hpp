// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <array>
#include <utility>
#include <vector>

#include "cairn/mapping/esdf.hpp"
#include "cairn/mapping/frame.hpp"
#include "cairn/mapping/mesh.hpp"
#include "cairn/mapping/reports.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "cairn/synthetic/scene.hpp"

namespace cairn {

struct ErrorStatistics {
  double rmse = 0, mean = 0, median = 0, max = 0;
  double p95 = 0;  ///< 95th percentile
  int count = 0;
};

/// Trajectory error after Sturm et al. 2012, "A benchmark for the evaluation of RGB-D SLAM systems".
struct TrajectoryError {
  ErrorStatistics ate;              ///< meters, after the SE(3) alignment of Horn 1987 / Umeyama 1991
  ErrorStatistics rpe_translation;  ///< meters over `rpe_interval`
  ErrorStatistics rpe_rotation;     ///< radians over `rpe_interval`
  double rpe_interval = 1.0;        ///< seconds
  int estimated_poses = 0;          ///< poses in the estimate
  int matched_poses = 0;            ///< estimated poses with a true pose within 20 ms, one to one
  Eigen::Isometry3d truth_from_estimate = Eigen::Isometry3d::Identity();
};

/// Computes ATE and RPE. Throws std::runtime_error if fewer than three poses match.
[[nodiscard]] TrajectoryError evaluate_trajectory(const Trajectory& estimate, const Trajectory& truth,
                                                  double rpe_interval = 1.0, double max_time_difference = 0.02);

/// Pose of the truth's frame in the estimate's frame, from positions and orientations of all poses. For rendered views,
/// where a milliradian matters; the ATE alignment uses positions only. Throws std::runtime_error if no pose matches.
[[nodiscard]] Eigen::Isometry3d estimate_from_truth(const Trajectory& estimate, const Trajectory& truth);

/// Precision and recall of loop closures.
struct LoopError {
  int loops = 0, right = 0;     ///< `right`: measured pose within 10 cm and 5 degrees of the true pose
  int revisits = 0, found = 0;  ///< keyframes at an earlier place; revisits with a right loop
};
/// Loop closure: measured `i_from_j` between the views at two times.
struct MeasuredLoop {
  double from = 0, to = 0;  ///< seconds
  Eigen::Isometry3d i_from_j = Eigen::Isometry3d::Identity();
};
/// Scores loops against true poses. A revisit is a keyframe with one of the searched keyframes within 0.5 m and 25
/// degrees. Entries without a true pose within `max_time_difference` are
/// ignored.
[[nodiscard]] LoopError evaluate_loops(const std::vector<MeasuredLoop>& loops,
                                       const std::vector<KeyframeInfo>& keyframes, const Trajectory& truth,
                                       double max_time_difference = 0.1);

struct MeshError {
  ErrorStatistics accuracy;      ///< meters, from samples of the estimate to the true surface
  ErrorStatistics completeness;  ///< meters, from samples of the truth to the estimated surface
  struct AtThreshold {
    double threshold;                   ///< meters
    double precision, recall, f_score;  ///< fractions in [0, 1]: accuracy and completeness within the threshold
  };
  std::array<AtThreshold, 3> at{};  ///< 1, 2 and 5 cm (Knapitsch et al. 2017)
};

/// Compares two meshes in the same frame. Draws `samples` points on each surface, uniform by area, seeded; distances
/// are point to triangle. `seen`: the part of the truth seen by the camera, used for completeness; null: all of the
/// truth. Throws std::runtime_error for a mesh without triangles.
[[nodiscard]] MeshError evaluate_mesh(const Mesh& estimate, const Mesh& truth, int samples = 200000,
                                      const Mesh* seen = nullptr);

/// Distance between two reconstructions of the same surface, meters: from samples of the first, uniform by area,
/// seeded, to the second. Counts samples with a nearest point within `reach` that has the same orientation and is not
/// on the second mesh's border (point pairs chosen as in Turk & Levoy 1994, "Zippered Polygon Meshes"). All zero
/// without overlap.
[[nodiscard]] ErrorStatistics evaluate_seam(const Mesh& first, const Mesh& second, double reach = 0.05,
                                            int samples = 20000);

/// Rendered image of a mesh.
struct RenderedView {
  std::vector<float> depth;          ///< meters along z; 0: no surface
  std::vector<std::uint32_t> color;  ///< bytes R, G, B, 255; a mesh without colors is shaded by its normals
};
/// Renders the parts of a mesh, front faces only, with textures or vertex colors. `samples`: supersampling along x and
/// y of a pixel; depth is taken from the first sample.
[[nodiscard]] RenderedView render_mesh(const std::vector<Mesh>& parts, const Camera& camera,
                                       const Eigen::Isometry3d& world_from_camera, int samples = 2);

/// Agreement of rendered views of a mesh with the images of a recording.
struct ViewError {
  double psnr = 0;  ///< dB over all compared pixels and channels
  /// dB after a gain per image and channel, since a map has a single exposure and the images have their own.
  double psnr_with_gain = 0;
  double covered = 0;     ///< fraction of depth pixels with the mesh within 5 cm; only these are compared
  double depth_rmse = 0;  ///< meters along z from the measured depth to the rendered surface, where within 10 cm
  int frames = 0;
};
/// Renders the mesh at every `step`-th frame's pose. `world_from_recording` maps the recording's poses
/// (Frame::world_from_camera) to the mesh's frame. Throws std::runtime_error for a recording without poses or color.
[[nodiscard]] ViewError evaluate_views(const std::vector<Mesh>& parts, Source& recording,
                                       const Eigen::Isometry3d& world_from_recording, int step = 10);

/// Agreement of a map with its own recording; needs no ground truth.
struct MapError {
  struct Range {
    double from, to;        ///< meters, measured depth
    ErrorStatistics depth;  ///< meters along z from the measurement to the mesh, where within 10 cm
    double elsewhere;       ///< fraction of measurements with the mesh more than 10 cm away
    double covered;         ///< fraction of measurements with mesh in view
  };
  std::vector<Range> ranges;  ///< depth ranges with measurements, up to 5 m
  double psnr = 0;            ///< dB, see ViewError; 0: without color
  double psnr_with_gain = 0;  ///< same
  double doubled = 0;  ///< fraction of the surface with a second sheet of the same orientation 5 mm to 5 cm in front or
                       ///< behind: surface reconstructed twice
  int frames = 0;      ///< number of compared frames
};
/// Compares every `step`-th frame that has a pose and is no keyframe, because textures are made from keyframes.
/// `keyframes`: their times, seconds. `only_held_out`: uses only frames with Frame::held_out, unseen by the map if it
/// was built with the same hold-out. `clock_offset`: of the color clock, subtracted from Frame::color_delay, seconds.
/// Throws std::runtime_error if no frame has a pose.
[[nodiscard]] MapError evaluate_map(const std::vector<Mesh>& parts, Source& recording,
                                    const Trajectory& world_from_camera, std::vector<double> keyframes, int step = 10,
                                    bool only_held_out = false, double clock_offset = 0);

/// Topology of a mesh; vertices with identical positions are merged.
struct MeshTopology {
  std::size_t non_manifold_edges = 0;     ///< edges with more than two triangles
  std::size_t non_manifold_vertices = 0;  ///< vertices whose triangles are not connected by edges at the vertex
  std::size_t coincident_triangles = 0;   ///< triangles with the same three vertices as another triangle
  std::size_t degenerate_triangles = 0, unreferenced_vertices = 0;
  std::size_t components = 0;                 ///< components connected by shared vertices
  std::size_t borders = 0, border_edges = 0;  ///< boundary loops (holes and outer borders), and their edges
  double border_length = 0;                   ///< meters
};
[[nodiscard]] MeshTopology examine_topology(const Mesh& mesh);

struct DistanceError {
  ErrorStatistics distance;                ///< absolute error, meters
  double within_voxel = 0;                 ///< fraction of errors below one voxel
  double gradient_mean = 0;                ///< radians between the field's gradient and the true gradient
  int gradients = 0;                       ///< points away from the medial axis
  int right_signs = 0, signs = 0;          ///< points more than a millimeter from the surface
  int all_right_signs = 0, all_signs = 0;  ///< same, including points near unseen surfaces
  int known = 0;                           ///< evaluated points; `distance.count` of them are nearest to a seen surface
};

/// Compares a field with the exact distances of a scene at a point in every fourth known voxel (seeded), if the nearest
/// surface belongs to `seen` and is within reach. Medial axis: the true gradient over a voxel is shorter than 0.98.
[[nodiscard]] DistanceError evaluate_distances(const DistanceField& field, const Scene& scene, const Mesh& seen);

/// Occupancy grid of a height range, in the format of `cairn esdf --costmap`.
struct Costmap {
  enum class Cell : std::uint8_t { free, occupied, unknown };
  int columns = 0, rows = 0;
  double resolution = 0;                             ///< meters per cell
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();  ///< meters, lower left corner; x is the world's z, y its -x
  double low = 0, high = 0;                          ///< meters above the world's origin
  std::vector<Cell> cells;                           ///< row-major, first row at the largest y
};

/// Counts of free and occupied costmap cells, and of truly free cells seen by the cameras.
struct CostmapError {
  int judged = 0, right = 0;
  int wrongly_free = 0;      ///< occupied at some height of the band by a solid with a seen surface
  int wrongly_occupied = 0;  ///< no surface within one and a half cells
  int wrongly_unknown = 0;   ///< free, more than half a cell from all surfaces, with half of the band seen
  int unseen = 0;            ///< correctly free, yet not seen by any camera
  int hidden = 0;            ///< marked free, occupied by an unseen solid: not judged
};

/// Compares a costmap with a scene cut at the same heights. A point is seen if a ray from one of the poses passes
/// through it to a surface within the depth range. Cells are judged against seen surfaces only; cells with unseen
/// solids are counted as `hidden`.
[[nodiscard]] CostmapError evaluate_costmap(const Costmap& costmap, const Scene& scene, const Camera& camera,
                                            const Trajectory& poses, const SurfaceOptions& range = {});

/// Residuals of loop closures on a trajectory.
struct LoopDrift {
  ErrorStatistics shift;  ///< meters
  ErrorStatistics turn;   ///< radians
};
[[nodiscard]] LoopDrift evaluate_loop_drift(const std::vector<MeasuredLoop>& loops,
                                            const Trajectory& world_from_camera);

}  // namespace cairn
