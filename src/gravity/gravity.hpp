// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Estimates the gravity direction from the surfaces of rooms.
#pragma once
#include <Eigen/Core>
#include <optional>
#include <span>

#include "gravity/structure.hpp"

namespace cairn {

/// Structure seen by a camera, with the camera's rotation.
struct StructureView {
  Eigen::Matrix3d world_from_camera = Eigen::Matrix3d::Identity();
  const Structure* structure = nullptr;
};

/// Candidate for the gravity direction, with its support.
struct GravityCandidate {
  Eigen::Vector3d down = Eigen::Vector3d::UnitY();  // unit length, in the world
  double horizontal = 0, vertical = 0;              // shares of horizontal and of vertical surface
  double min_constraint = 0;                        // share of surface that constrains the least constrained rotation
};

/// Votes for the gravity direction. Candidates are the dominant surface normals and the cross products of pairs of
/// them. Each is fitted alternately to horizontal and vertical surfaces (Gupta, Arbelaez & Malik 2013, sec. 3.1.2). A
/// candidate is accepted if surfaces of at least two directions determine it and if the camera poses, with a prior for
/// people and robots (little roll, looking ahead or slightly down), make it clearly more likely than every other
/// candidate. Empty if none qualifies, as for a single wall or a sphere.
[[nodiscard]] std::optional<GravityCandidate> vote_gravity(std::span<const StructureView> views);

/// Refines `measured` to the nearby direction supported by horizontal and vertical surfaces. Empty if there is too
/// little surface.
[[nodiscard]] std::optional<GravityCandidate> refine_gravity(std::span<const StructureView> views,
                                                             const Eigen::Vector3d& measured);

}  // namespace cairn
