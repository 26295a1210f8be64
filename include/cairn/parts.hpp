// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Recordings of a building cut into parts, each small enough for one run, which are mapped on their own and put
// together afterwards. A plan is a folder:
//
//   PLAN/plan.json             what recordings there are, and their parts
//   PLAN/parts/017/part.json   a part: its folder opens as a recording does (open_source)
//   PLAN/maps/017/             its map
//   PLAN/loops/003-017.json    where two maps see the same
//   PLAN/session/, ...         the map of all, see docs/formats.md
#pragma once
#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cairn/esdf.hpp"
#include "cairn/export.hpp"
#include "cairn/map.hpp"
#include "cairn/mesh.hpp"
#include "cairn/verdict.hpp"

namespace cairn {

struct PartsPlan {
  /// A recording as open_source takes it, no sensor; files by their whole path.
  struct Recording {
    std::string name;
    int frames = 0;
    bool other_camera = false;  ///< than the first one: its frames are turned into those which that would have taken
  };
  /// Frames [begin, end) of a recording, counted from 0. What follows on it in the same recording begins `overlap`
  /// frames before its end.
  struct Part {
    std::string name;  ///< three digits or more: 000, 001, ...
    std::size_t recording = 0;
    int begin = 0, end = 0;
  };
  int frames_per_part = 3000, overlap = 150;
  std::vector<Recording> recordings;
  std::vector<Part> parts;  ///< of a recording in the order of its frames
};

/// Cuts recordings into parts of equal length, of frames_per_part and overlap at most, and writes plan.json and each
/// part.json, whole or not at all. A plan that is there grows: recordings that it has stay as they are, with their
/// parts' names, and its files are not touched where nothing of them changes. Throws std::runtime_error for a recording
/// that cannot be read, is a sensor, or has another number of frames than the plan knows, for one whose colour camera
/// looks from elsewhere than the first one's or whose shutter is another, where `folder` holds a map, and where
/// `options`, of which the lists are not looked at, differ from those of the plan that is there.
PartsPlan plan_parts(const std::vector<std::string>& recordings, const std::filesystem::path& folder,
                     const PartsPlan& options);

/// Throws std::runtime_error with what is missing or damaged: no plan, or one of another version.
[[nodiscard]] PartsPlan read_plan(const std::filesystem::path& folder);

/// Frame::index of the first frame of a recording, by its name: 0, but of a part, whose frames are its recording's.
/// Ranges (SourceOptions::range) count from it.
[[nodiscard]] int first_index(const std::string& recording);

/// What match_maps did.
struct MatchedMaps {
  int compared = 0, loops = 0;  ///< keyframes of the second map; those that see a place of the first
};

/// Looks for the keyframes of one map among those of another, by corners and then by aligning their depth images both
/// ways, and writes the loops that it finds: docs/formats.md. Both are folders that `cairn reconstruct` has made, of
/// which nothing but their sessions is read, and of these no voxels that were put away. Throws std::runtime_error for
/// maps of different cameras or voxels.
MatchedMaps match_maps(const std::filesystem::path& first, const std::filesystem::path& second,
                       const std::filesystem::path& file, int device = -1);

/// A part in the map of all.
struct JoinedPart {
  std::string name;
  std::string left_out;           ///< why it is not in the map; empty: it is
  int frames = 0, keyframes = 0;  ///< of its own map
  int recording = 0;              ///< of the plan
  double moved = 0;               ///< metres since the last time, its keyframe that moved most; none: 0
};

/// JoinedPart::left_out of a map that no loop and no shared frame ties to the largest piece.
inline constexpr const char* kUnjoined = "nothing joins it with the others";

/// How much of a plan is in its map: good with all parts, bad with less than 80 % of the frames. Parts that were
/// planned after the map was made are not in it.
[[nodiscard]] Verdict verdict_of(const PartsPlan& plan, const std::vector<JoinedPart>& joined);
/// The parts by PLAN/report.json, which `cairn optimise` writes; nothing before it. Throws std::runtime_error where the
/// file cannot be read.
[[nodiscard]] std::optional<std::vector<JoinedPart>> joined_parts(const std::filesystem::path& plan);

/// What optimise_parts did.
struct OptimisedParts {
  std::vector<JoinedPart> parts;
  int loops = 0, believed = 0;     ///< between parts; those that agree with each other and with the rest
  int overlaps = 0;                ///< frames that two parts of a recording share and that tie them
  int pairs = 0, aligned = 0;      ///< keyframes of two parts that lie near each other then; those that agree with all
  int keyframes = 0, submaps = 0;  ///< of all parts that are joined
  int cells = 0, changed_cells = 0;  ///< of the map, and those that have to be made (again)
  double cost_before = 0, cost = 0;  ///< of the pose graph
  double seconds = 0;                ///< that the graph took
};

/// Lays all maps of a plan to each other, by frames that parts of a recording share and by loops between them, aligns
/// keyframes of two maps that see much of the same then, moves them to where all agree best, and writes the map of all:
/// PLAN/session, which leaves keyframes and voxels where they are, and PLAN/cells/X,Y,Z.json, what each cell of the map
/// is made of. Parts without a map, and those that nothing joins with the largest piece, are left out. What hardly
/// moves since the last time (a quarter of a voxel) stays exactly where it was, so that the cells of a new recording
/// are the only ones that change. Throws std::runtime_error where no part has a map, and for maps of different cameras
/// or voxels.
OptimisedParts optimise_parts(const std::filesystem::path& plan, int device = -1);

/// Makes one cell of a plan's map: writes FOLDER/tileset.json and its tiles, and FOLDER/map.vdb, each whole or not at
/// all. Borders are those of the neighbours to the last bit. `cell`: as PLAN/cells names it. Throws std::runtime_error
/// for a cell that the map does not reach.
Exported export_cell(const std::filesystem::path& plan, const std::array<int, 3>& cell,
                     const std::filesystem::path& folder, const ExportOptions& options = {},
                     const ExportProgress& progress = {}, int device = -1);

/// What one part alone has seen of a cell, where the map of all has put it, in the written world.
struct PartSurface {
  std::string name;
  Mesh mesh;
};
/// For comparing the parts of a plan's map with each other. Throws as export_cell does.
[[nodiscard]] std::vector<PartSurface> part_surfaces(const std::filesystem::path& plan, const std::array<int, 3>& cell,
                                                     int device = -1);
/// The cells of a plan's map, sorted.
[[nodiscard]] std::vector<std::array<int, 3>> cells_of(const std::filesystem::path& plan);

/// One cell of a plan's map and what lies around it, as export_cell has written their voxels: for what is asked of one
/// place at a time, however large the map is.
class CellMap {
 public:
  /// With all that tells distances of up to `max_distance` metres in the cell. Throws std::runtime_error for a cell
  /// that the map does not reach, and where one that lies so near has not been made.
  CellMap(const std::filesystem::path& plan, const std::array<int, 3>& cell, double max_distance, int device = -1);

  [[nodiscard]] Map& map() { return map_; }  ///< grids alone, without colours
  void stand_up(Up up);                      ///< as Map::stand_up
  /// Whether a point of the world lies in the cell, and so in no other.
  [[nodiscard]] bool contains(const Eigen::Vector3f& point) const;
  /// What of a field of map() lies in the cell: the field of the whole map there.
  [[nodiscard]] std::shared_ptr<const DistanceField> within(const DistanceField& field) const;

 private:
  struct Around;
  explicit CellMap(Around around);
  std::array<int, 3> cell_;
  float voxel_size_;
  Map map_;
  Eigen::Quaternionf world_from_map_;
};

/// Writes a tileset over the cells of a plan's map that are there, PLAN/tiles/X,Y,Z/tileset.json. Returns how many.
/// Throws std::runtime_error naming a cell that has not been made.
int write_cells_tileset(const std::filesystem::path& plan, const std::filesystem::path& file);

}  // namespace cairn
