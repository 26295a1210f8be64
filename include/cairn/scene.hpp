// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <vector>

#include "cairn/camera.hpp"
#include "cairn/mesh.hpp"
#include "cairn/trajectory.hpp"

namespace cairn {

/// A scene whose surface is known exactly: a union of boxes, spheres, cylinders and the walls of a room. World frame:
/// metres, y down; the path starts near the origin.
struct Scene {
  enum class Shape { box, sphere, cylinder, hollow };
  enum class Pattern { plain, checker, wood, tiles, patches };
  struct Solid {
    Shape shape = Shape::box;
    Eigen::Vector3f centre = Eigen::Vector3f::Zero();
    Eigen::Vector3f half_size = Eigen::Vector3f::Ones();
    float yaw = 0;  ///< radians about the vertical
    Pattern pattern = Pattern::plain;
    float scale = 0.1f;  ///< metres, of the pattern
    Eigen::Vector3f colour = Eigen::Vector3f::Constant(0.7f), second = Eigen::Vector3f::Constant(0.4f);
    Eigen::Vector3f swing = Eigen::Vector3f::Zero();  ///< it moves to and fro between centre - swing and centre + swing
    float period = 0;                                 ///< seconds; 0: it stands still
  };
  std::string name;
  std::vector<Solid> solids;
  std::vector<Eigen::Vector3d> way;  ///< the path every 5 cm, where it leads through rooms
  std::uint64_t hand = 0;            ///< whose hand shakes, on a way through a building

  [[nodiscard]] bool moves() const;
  /// The solids as they are at a time.
  [[nodiscard]] std::vector<Solid> solids_at(double seconds) const;
  /// Distance to the nearest surface that stands still, in metres, negative inside a solid; exact outside of all
  /// solids.
  [[nodiscard]] double distance(const Eigen::Vector3d& point) const;
  /// The pose of a hand-held-like camera at a time: 0.2 to 0.6 m/s, at most 45 degrees a second; on a
  /// way through rooms also with glances aside of 160 degrees a second.
  [[nodiscard]] Eigen::Isometry3d world_from_camera(double seconds) const;
  /// When a way ends; 10 s where there is none.
  [[nodiscard]] double duration() const;
  /// The scene without the solids that are farther than this from all of these places.
  [[nodiscard]] Scene around(const std::vector<Eigen::Vector3d>& places, double metres) const;
  /// The surface of what stands still as triangles with sides of at most `spacing`, exact at its vertices; hidden parts
  /// of solids are left out.
  [[nodiscard]] Mesh surface(float spacing = 0.02f) const;
};

/// `room` (furnished), `room-with-mover` (somebody walks through it), `flat` (four rooms, once around), `twin-rooms`
/// (two that look alike), `sphere`, `plane`, `corridor`, `loop` (a corridor around a block), or `building`: storeys of
/// offices that look alike, with stairs, as one of many recordings meets it, by default
/// `building?floors=3&rooms=40&recording=0&metres=30`. All its recordings have the same world; what differs is the way
/// and which doors are open. Throws std::runtime_error for another name.
[[nodiscard]] Scene synthetic_scene(const std::string& name);

/// The camera that synthetic recordings have.
[[nodiscard]] Camera synthetic_camera();

/// For each triangle of a mesh whether it is seen: its centre projects into an image, in front of the camera and within
/// 1 cm of that image's depth. `depth`: metres, row-major, one image a pose.
void mark_seen(const Mesh& mesh, const Camera& camera, const Eigen::Isometry3d& world_from_camera,
               const std::vector<float>& depth, std::vector<bool>& seen);

}  // namespace cairn
