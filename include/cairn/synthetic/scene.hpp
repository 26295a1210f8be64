// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <vector>

#include "cairn/mapping/camera.hpp"
#include "cairn/mapping/mesh.hpp"
#include "cairn/mapping/trajectory.hpp"

namespace cairn {

/// Synthetic scene with an exact surface: a union of boxes, spheres, cylinders and the walls of a room. World frame:
/// meters, y down; the camera path starts near the origin.
struct Scene {
  enum class Shape { box, sphere, cylinder, hollow };
  enum class Pattern { plain, checker, wood, tiles, patches };
  struct Solid {
    Shape shape = Shape::box;
    Eigen::Vector3f center = Eigen::Vector3f::Zero();
    Eigen::Vector3f half_size = Eigen::Vector3f::Ones();
    float yaw = 0;  ///< radians about the vertical axis
    Pattern pattern = Pattern::plain;
    float scale = 0.1f;  ///< meters, size of the pattern
    Eigen::Vector3f color = Eigen::Vector3f::Constant(0.7f), second = Eigen::Vector3f::Constant(0.4f);
    Eigen::Vector3f swing = Eigen::Vector3f::Zero();  ///< oscillates between center - swing and center + swing
    float period = 0;                                 ///< seconds; 0: static
  };
  std::string name;
  std::vector<Solid> solids;
  std::vector<Eigen::Vector3d> path;  ///< camera path at 5 cm spacing, for paths through rooms
  std::uint64_t hand = 0;             ///< seed of the hand shake, for paths through a building

  [[nodiscard]] bool moves() const;
  /// Solids at their positions at a given time.
  [[nodiscard]] std::vector<Solid> solids_at(double seconds) const;
  /// Distance to the nearest static surface, meters, negative inside a solid; exact outside all solids.
  [[nodiscard]] double distance(const Eigen::Vector3d& point) const;
  /// Pose of a simulated hand-held camera at a given time: 0.2 to 0.6 m/s, at most 45 degrees per second; on paths
  /// through rooms also with side glances at 160 degrees per second.
  [[nodiscard]] Eigen::Isometry3d world_from_camera(double seconds) const;
  /// Duration of the path, seconds; 10 s without a path.
  [[nodiscard]] double duration() const;
  /// Copy of the scene without solids farther than `meters` from all given places.
  [[nodiscard]] Scene around(const std::vector<Eigen::Vector3d>& places, double meters) const;
  /// Static surface as triangles with sides of at most `spacing`, exact at the vertices; excludes hidden parts of
  /// solids.
  [[nodiscard]] Mesh surface(float spacing = 0.02f) const;
};

/// Creates a scene by name: `room` (furnished), `room-with-mover` (a person walks through), `flat` (four rooms, one
/// round), `twin-rooms` (two identical-looking rooms), `sphere`, `plane`, `corridor`, `loop` (a corridor around a
/// block), `door` (closed, at 40 cm), or `building`: storeys of similar offices with stairs, seen by one of many
/// recordings, by default `building?floors=3&rooms=40&recording=0&meters=30`. All recordings of a building share its
/// world; they differ in path and in open doors. Throws std::runtime_error for another name.
[[nodiscard]] Scene synthetic_scene(const std::string& name);

/// Camera of synthetic recordings.
[[nodiscard]] Camera synthetic_camera();

/// Marks the seen triangles of a mesh: the center projects into the image, in front of the camera and within 1 cm of
/// the image's depth. `depth`: meters, row-major.
void mark_seen(const Mesh& mesh, const Camera& camera, const Eigen::Isometry3d& world_from_camera,
               const std::vector<float>& depth, std::vector<bool>& seen);

}  // namespace cairn
