// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Large recordings, split into segments small enough for one run. Each segment is mapped separately; their maps are
// then merged. A project is a folder PLAN:
//
//   PLAN/plan.json             recordings and their segments
//   PLAN/parts/017/part.json   a segment: its folder opens as a recording (open_source)
//   PLAN/maps/017/             map of the segment
//   PLAN/loops/003-017.json    loop closures between two maps
//   PLAN/session/, ...         merged map, see docs/session.md
#pragma once
#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cairn/eval/verdict.hpp"
#include "cairn/mapping/esdf.hpp"
#include "cairn/mapping/export.hpp"
#include "cairn/mapping/map.hpp"
#include "cairn/mapping/mesh.hpp"

namespace cairn {

struct Project {
  /// A recording in the syntax of open_source, no sensor; files by absolute path.
  struct Recording {
    std::string name;
    int frames = 0;
    bool other_camera = false;  ///< camera differs from the first recording's: frames are reprojected to the first
                                ///< camera
  };
  /// Segment: frames [begin, end) of a recording, counted from 0. The next segment of the same recording starts
  /// `overlap` frames before `end`.
  struct Segment {
    std::string name;  ///< at least three digits: 000, 001, ...
    std::size_t recording = 0;
    int begin = 0, end = 0;
  };
  int frames_per_segment = 3000, overlap = 150;
  std::vector<Recording> recordings;
  std::vector<Segment> segments;  ///< in frame order within a recording
};

/// Splits recordings into segments of equal length, with at most frames_per_segment frames and `overlap`, and writes
/// plan.json and each part.json atomically. Extends an existing project: its recordings and segment names are kept, and
/// unchanged files are not rewritten. Throws std::runtime_error for an unreadable recording, a sensor, a recording with
/// another number of frames than in the project, a color camera with another pose than the first recording's or a
/// different shutter, a `folder` that contains a map, and for `options` that differ from the project's (their lists are
/// ignored).
Project plan_project(const std::vector<std::string>& recordings, const std::filesystem::path& folder,
                     const Project& options);

/// Reads plan.json. Throws std::runtime_error with the missing or damaged file, or an unsupported version.
[[nodiscard]] Project read_plan(const std::filesystem::path& folder);

/// Result of match_maps.
struct MatchedMaps {
  int compared = 0, loops = 0;  ///< keyframes of the second map; loop closures to the first
};

/// Finds loop closures between two maps: matches keyframes by features, then aligns their depth images in both
/// directions, and writes the loops to `file` (docs/session.md). Both maps are folders made by `cairn reconstruct`;
/// only their sessions are read, without paged-out voxels. Throws std::runtime_error for maps with different cameras or
/// voxel sizes.
MatchedMaps match_maps(const std::filesystem::path& first, const std::filesystem::path& second,
                       const std::filesystem::path& file, int device = -1);

/// A segment in the merged map.
struct MergedSegment {
  std::string name;
  std::string left_out;           ///< reason for its omission from the merged map; empty: included
  int frames = 0, keyframes = 0;  ///< numbers of its own map
  int recording = 0;              ///< index into the project's recordings
  double moved = 0;               ///< meters since the previous merge, maximum over its keyframes; 0: no previous merge
};

/// MergedSegment::left_out of a map without loop closure or shared frame to the largest component.
inline constexpr const char* kUnjoined = "no loop closure connects it to the others";

/// Coverage of a project by its merged map: good with all segments, bad with less than 80 % of the frames. Segments
/// added after the merge count as missing.
[[nodiscard]] Verdict verdict_of(const Project& plan, const std::vector<MergedSegment>& segments);
/// Segments from PLAN/report.json, written by `cairn optimize`; nullopt before the first run. Throws std::runtime_error
/// if the file cannot be read.
[[nodiscard]] std::optional<std::vector<MergedSegment>> merged_segments(const std::filesystem::path& plan);

/// Result of optimize_project.
struct OptimizedProject {
  std::vector<MergedSegment> segments;
  int loops = 0, inliers = 0;        ///< loop closures between segments; inliers among them
  int overlaps = 0;                  ///< edges from frames shared by consecutive segments
  int pairs = 0, aligned = 0;        ///< overlapping keyframe pairs of two segments; inliers among them
  int keyframes = 0, submaps = 0;    ///< over all merged segments
  int cells = 0, changed_cells = 0;  ///< cells of the merged map; cells to be exported (again)
  double cost_before = 0, cost = 0;  ///< of the pose graph
  double seconds = 0;                ///< duration of the pose graph optimization
};

/// Aligns the segments' maps by shared frames and loop closures, aligns covisible keyframes of different maps,
/// optimizes all poses jointly, and writes the merged session: PLAN/session, which refers to the segments' keyframes
/// and voxels in place, and PLAN/cells/X,Y,Z.json, the sources of each cell. Omits segments without a map and segments
/// not connected to the largest component. Poses that move less than a quarter of a voxel since the previous merge keep
/// their exact previous values, so a new recording changes only its own cells. Throws std::runtime_error if no segment
/// has a map, and for maps with different cameras or voxel sizes.
OptimizedProject optimize_project(const std::filesystem::path& plan, int device = -1);

/// Exports one cell of a project's map: writes FOLDER/tileset.json with its tiles, and FOLDER/map.vdb, each atomically.
/// Vertices on its borders are bit-identical to the neighbors'. `cell`: index from a file name in PLAN/cells. Throws
/// std::runtime_error for a cell outside the map.
ExportReport export_cell(const std::filesystem::path& plan, const std::array<int, 3>& cell,
                         const std::filesystem::path& folder, const ExportOptions& options = {},
                         const ExportProgress& progress = {}, int device = -1);

/// Surface of one cell from a single segment, at its pose in the merged map, in the exported world frame.
struct SegmentSurface {
  std::string name;
  Mesh mesh;
};
/// Per-segment surfaces of a cell, for a comparison of the segments. Throws as export_cell does.
[[nodiscard]] std::vector<SegmentSurface> segment_surfaces(const std::filesystem::path& plan,
                                                           const std::array<int, 3>& cell, int device = -1);
/// Indices of a project's cells, sorted.
[[nodiscard]] std::vector<std::array<int, 3>> cells_of(const std::filesystem::path& plan);

/// One cell of a project's map with its surroundings, read from the voxels of export_cell: for queries at one place,
/// independent of the map's size.
class CellMap {
 public:
  /// `max_distance`: of distance fields, meters. Throws std::runtime_error for a cell outside the map.
  CellMap(const std::filesystem::path& plan, const std::array<int, 3>& cell, double max_distance, int device = -1);

  /// Grids without colors. The first call loads all voxels needed for distances up to `max_distance` in the cell, and
  /// throws std::runtime_error if a required neighbor has not been exported.
  [[nodiscard]] Map& map();
  void set_up_axis(Up up);  ///< same as Map::set_up_axis
  /// True if a world point is in this cell; each point is in exactly one cell.
  [[nodiscard]] bool contains(const Eigen::Vector3f& point) const;
  /// Crops a distance field of map() to the cell; identical there to the field of the entire map.
  [[nodiscard]] std::shared_ptr<const DistanceField> within(const DistanceField& field) const;

 private:
  std::filesystem::path plan_;
  std::array<int, 3> cell_;
  double max_distance_;
  int device_;
  float voxel_size_;
  Eigen::Quaternionf world_from_map_;
  std::optional<Map> map_;
};

/// Writes a tileset over the existing cells of a project's map, PLAN/tiles/X,Y,Z/tileset.json. Returns their number.
/// Throws std::runtime_error naming a cell that has not been exported.
int write_cells_tileset(const std::filesystem::path& plan, const std::filesystem::path& file);

}  // namespace cairn
