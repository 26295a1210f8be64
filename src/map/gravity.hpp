// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Which way is down, as what rooms are made of tells it.
#pragma once
#include <Eigen/Core>
#include <optional>
#include <span>

#include "map/structure.hpp"

namespace cairn {

/// What a camera saw, and how it was turned then.
struct StructureView {
  Eigen::Matrix3d world_from_camera = Eigen::Matrix3d::Identity();
  const Structure* structure = nullptr;
};

/// A direction that may be down, and what speaks for it.
struct Down {
  Eigen::Vector3d down = Eigen::Vector3d::UnitY();  // unit length, in the world
  double level = 0, upright = 0;  // shares of the surface that lie level, and that stand upright by it
  double weakest = 0;             // share of the surface that holds it against the turn that least of it holds
};

/// A vote of what the views see. Candidates are the directions in which most of the surface faces, and those that two
/// of them are upright by; each is moved to where it fits best what lies level and what stands upright by it, by turns
/// (Gupta, Arbelaez & Malik 2013, sec. 3.1.2). One is down if it is held by surfaces of at least two directions, and if
/// cameras that are held as people and robots hold them (leaning little to a side, looking ahead or a little down) saw
/// it clearly rather than any other candidate. Nothing where that is not so: a single wall, a sphere.
[[nodiscard]] std::optional<Down> vote_down(std::span<const StructureView> views);

/// The direction near `measured` that level and upright surfaces agree on; nothing where there are too few of them.
[[nodiscard]] std::optional<Down> sharpen_down(std::span<const StructureView> views, const Eigen::Vector3d& measured);

}  // namespace cairn
