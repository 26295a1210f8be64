// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <array>
#include <utility>
#include <vector>

#include "cairn/esdf.hpp"
#include "cairn/frame.hpp"
#include "cairn/mesh.hpp"
#include "cairn/scene.hpp"
#include "cairn/trajectory.hpp"

namespace cairn {

struct ErrorStatistics {
  double rmse = 0, mean = 0, median = 0, max = 0;
  double p95 = 0;  ///< that 95 % do not exceed
  int count = 0;
};

/// Sturm et al. 2012, "A benchmark for the evaluation of RGB-D SLAM systems".
struct TrajectoryError {
  ErrorStatistics ate;              ///< metres, after the SE(3) alignment of Horn 1987 / Umeyama 1991
  ErrorStatistics rpe_translation;  ///< metres over `rpe_interval`
  ErrorStatistics rpe_rotation;     ///< radians over `rpe_interval`
  double rpe_interval = 1.0;        ///< seconds
  int estimated_poses = 0;          ///< poses in the estimate
  int matched_poses = 0;            ///< of them with a true pose within 20 ms, one to one
  Eigen::Isometry3d truth_from_estimate = Eigen::Isometry3d::Identity();
};

/// Throws std::runtime_error when fewer than three poses match.
[[nodiscard]] TrajectoryError evaluate_trajectory(const Trajectory& estimate, const Trajectory& truth,
                                                  double rpe_interval = 1.0, double max_time_difference = 0.02);

/// Where the truth's frame lies in the estimate's, by positions and orientations of all poses: for pictures, where a
/// milliradian matters; the ATE's alignment looks at positions alone. Throws std::runtime_error when no pose matches.
[[nodiscard]] Eigen::Isometry3d estimate_from_truth(const Trajectory& estimate, const Trajectory& truth);

/// How well places were recognised.
struct LoopError {
  int loops = 0, right = 0;     ///< a loop is right if its measured pose is within 10 cm and 5 degrees of the true one
  int revisits = 0, found = 0;  ///< keyframes that look at an earlier place, and those of them with a right loop
};
/// `i_from_j` as measured between the views at two times.
struct LoopMeasured {
  double from = 0, to = 0;  ///< seconds
  Eigen::Isometry3d i_from_j = Eigen::Isometry3d::Identity();
};
/// `keyframes`: times, and how many of the earlier ones were looked through; a revisit has one of these within 0.5 m
/// and 25 degrees. What has no true pose within `max_time_difference` does not count.
[[nodiscard]] LoopError evaluate_loops(const std::vector<LoopMeasured>& loops,
                                       const std::vector<std::pair<double, int>>& keyframes, const Trajectory& truth,
                                       double max_time_difference = 0.1);

struct MeshError {
  ErrorStatistics accuracy;      ///< metres, from samples of the estimate to the truth's surface
  ErrorStatistics completeness;  ///< metres, from samples of the truth to the estimate's surface
  struct AtThreshold {
    double threshold;                   ///< metres
    double precision, recall, f_score;  ///< shares in [0, 1]: accuracy and completeness within the threshold
  };
  std::array<AtThreshold, 3> at{};  ///< 1, 2 and 5 cm (Knapitsch et al. 2017)
};

/// Samples both surfaces evenly by area, `samples` points each, seeded; distances are to triangles, not to vertices.
/// All meshes are in the same frame. `seen`: the part of the truth that the camera saw, on which completeness is
/// measured; null: all of it. Throws std::runtime_error for a mesh without triangles.
[[nodiscard]] MeshError evaluate_mesh(const Mesh& estimate, const Mesh& truth, int samples = 200000,
                                      const Mesh* seen = nullptr);

/// How far two surfaces of the same thing lie from each other: from samples of the first, evenly by area, seeded, to
/// the second, metres; of those where both are: whose nearest point lies within `reach`, faces the same side, and is
/// not on the second's border, behind which it goes on unseen (as pairs of points are chosen in Turk & Levoy 1994,
/// "Zippered Polygon Meshes"). Nothing where none is.
[[nodiscard]] ErrorStatistics evaluate_seam(const Mesh& first, const Mesh& second, double reach = 0.05,
                                            int samples = 20000);

/// A mesh as a camera sees it.
struct RenderedView {
  std::vector<float> depth;           ///< metres along z; 0: nothing
  std::vector<std::uint32_t> colour;  ///< bytes R, G, B, 255; a mesh without colours is shaded by its normals
};
/// Draws the parts of a mesh, front sides alone, with their textures or vertex colours. `samples`: along x and y of a
/// pixel; depth is the first one's.
[[nodiscard]] RenderedView render_mesh(const std::vector<Mesh>& parts, const Camera& camera,
                                       const Eigen::Isometry3d& world_from_camera, int samples = 2);

/// How well pictures of a mesh agree with a recording's.
struct ViewError {
  double psnr = 0;  ///< dB over all pixels and channels that were compared
  double covered =
      0;  ///< share of the recording's depth pixels where the mesh lies within 5 cm of it: these are compared
  int frames = 0;
};
/// `world_from_recording` moves the recording's poses, Frame::world_from_camera, to the mesh. Every `step`-th frame is
/// looked at. Throws std::runtime_error for a recording without poses or colour.
[[nodiscard]] ViewError evaluate_views(const std::vector<Mesh>& parts, Source& recording,
                                       const Eigen::Isometry3d& world_from_recording, int step = 10);

/// How well a map agrees with the recording that it was made from: what can be known without a true path.
struct MapError {
  struct Range {
    double from, to;        ///< metres that the camera measured
    ErrorStatistics depth;  ///< metres from what was measured to the mesh along z, where it lies within 10 cm
    double elsewhere;       ///< share of what was measured where the mesh is more than 10 cm off
    double covered;         ///< share where it is there
  };
  std::vector<Range> ranges;  ///< those in which something was measured, up to 5 m
  double psnr = 0;            ///< dB, as of ViewError; 0: without colour
  double doubled = 0;  ///< share of the surface that has another sheet before or behind it, 5 mm to 5 cm away, that
                       ///< faces the same way: what was seen twice and came to lie in two places
  int frames = 0;      ///< that were compared
};
/// Every `step`-th frame is looked at that has a pose and is no keyframe: textures are made from keyframes.
/// `keyframes`: their times, seconds. `only_held_out`: of the frames with Frame::held_out, which the map has never
/// seen, if it was made with the same ones held out. Colour is taken to be of the depth image's time. Throws
/// std::runtime_error where no frame has a pose.
[[nodiscard]] MapError evaluate_map(const std::vector<Mesh>& parts, Source& recording,
                                    const Trajectory& world_from_camera, std::vector<double> keyframes, int step = 10,
                                    bool only_held_out = false);

/// How a mesh's triangles hang together; vertices at the very same place count as one.
struct MeshTopology {
  std::size_t non_manifold_edges = 0;     ///< of more than two triangles
  std::size_t non_manifold_vertices = 0;  ///< whose triangles do not all hang together by sides that end there
  std::size_t coincident_triangles = 0;   ///< with the three vertices of another one
  std::size_t degenerate_triangles = 0, unreferenced_vertices = 0;
  std::size_t components = 0;                 ///< that no vertex joins
  std::size_t borders = 0, border_edges = 0;  ///< boundary_edges of holes and outer edges
  double border_length = 0;                   ///< metres
};
[[nodiscard]] MeshTopology examine_topology(const Mesh& mesh);

struct DistanceError {
  ErrorStatistics distance;                ///< metres, absolute
  double within_voxel = 0;                 ///< share of these that are less than a voxel
  double gradient_mean = 0;                ///< radians between the field's gradient and the true one
  int gradients = 0;                       ///< points away from the medial axis
  int right_signs = 0, signs = 0;          ///< of points that are farther than a millimetre from the surface
  int all_right_signs = 0, all_signs = 0;  ///< likewise, near surfaces that nobody saw as well
  int known = 0;  ///< points looked at; of them `distance.count` are nearest to a surface that was seen
};

/// Compares a field with a scene's exact distances at a point in every fourth known voxel (seeded), where the nearest
/// surface belongs to `seen` and is within reach. The medial axis is where the true gradient over a voxel is shorter
/// than 0.98.
[[nodiscard]] DistanceError evaluate_distances(const DistanceField& field, const Scene& scene, const Mesh& seen);

/// Occupancy of a band of heights, as `cairn esdf --costmap` writes it.
struct Costmap {
  enum class Cell : std::uint8_t { free, occupied, unknown };
  int columns = 0, rows = 0;
  double resolution = 0;                             ///< metres
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();  ///< metres, of the lower left corner; x is the world's z, y its -x
  double low = 0, high = 0;                          ///< metres above the world's origin
  std::vector<Cell> cells;                           ///< row by row, the first one at the largest y
};

/// Cells that a costmap calls free or occupied, and those that are free and that cameras saw.
struct CostmapError {
  int judged = 0, right = 0;
  int wrongly_free = 0;      ///< in some height of the band a solid is there, and a camera saw its surface there
  int wrongly_occupied = 0;  ///< no surface is nearer than one and a half cells
  int wrongly_unknown = 0;   ///< free, farther than half a cell from all surfaces, and half of the band was seen
  int unseen = 0;            ///< rightly free, and yet no camera saw any of it
  int hidden = 0;            ///< called free, though a solid is there that no camera saw: not judged
};

/// Compares a costmap with a scene cut at the same heights. A point was seen when from one of the poses a ray goes
/// through it to a surface within the range of depth. What no camera saw, a map cannot know: a cell is held against the
/// surfaces that were seen, and those of `hidden` are counted beside.
[[nodiscard]] CostmapError evaluate_costmap(const Costmap& costmap, const Scene& scene, const Camera& camera,
                                            const Trajectory& poses, const SurfaceOptions& range = {});

/// How far a trajectory leaves the loops open that were found on it.
struct LoopDrift {
  ErrorStatistics shift;  ///< metres
  ErrorStatistics turn;   ///< radians
};
[[nodiscard]] LoopDrift evaluate_loop_drift(const std::vector<LoopMeasured>& loops,
                                            const Trajectory& world_from_camera);

}  // namespace cairn
