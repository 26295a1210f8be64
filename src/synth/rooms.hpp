// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Contents of furnished scenes, and paths through them. The floor is 1.3 m below the origin.
#pragma once
#include <vector>

#include "cairn/synthetic/scene.hpp"

namespace cairn {

/// Room of 5.4 m x 4.6 m.
[[nodiscard]] std::vector<Scene::Solid> furnished_room();

/// Corridor 2.4 m wide around a block, with boxes and columns along its walls.
[[nodiscard]] std::vector<Scene::Solid> corridor_around_a_block();

/// Four furnished rooms around the origin, each with doors to two others: 8.4 m x 7.4 m.
[[nodiscard]] std::vector<Scene::Solid> flat();
/// A loop through its doors and 4 m more, every 5 cm.
[[nodiscard]] std::vector<Eigen::Vector3d> path_through_flat();

/// Two rooms, identical up to a rotation by 180 degrees about the origin, with a door between them.
[[nodiscard]] std::vector<Scene::Solid> twin_rooms();
/// A loop in the first room, a loop in the second, and back.
[[nodiscard]] std::vector<Eigen::Vector3d> path_through_twin_rooms();

/// Closed door with a lever handle, 0.4 m in front of the origin.
[[nodiscard]] std::vector<Scene::Solid> door();

}  // namespace cairn
