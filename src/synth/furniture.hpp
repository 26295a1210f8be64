// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Parts and furniture of rooms, and paths through them. Meters, y down; the floor is 1.3 m below the origin, and the
// ceiling 1.3 m above it.
#pragma once
#include <vector>

#include "cairn/synthetic/scene.hpp"

namespace cairn {

inline constexpr double kFloor = 1.3;
inline constexpr float kCeiling = -1.3f, kWall = 0.1f, kDoor = 0.9f;
inline const Eigen::Vector3f kWood(0.62f, 0.42f, 0.24f), kDark(0.40f, 0.25f, 0.13f), kWhite(0.85f, 0.84f, 0.80f),
    kGray(0.5f, 0.5f, 0.52f);

/// Texture of a wall.
struct Paper {
  Scene::Pattern pattern;
  float scale;
  Eigen::Vector3f color, second;
};

/// Box on the floor, or `above` it.
[[nodiscard]] Scene::Solid box_on_floor(float x, float z, Eigen::Vector3f size, float above, Scene::Pattern pattern,
                                        float scale, const Eigen::Vector3f& color, const Eigen::Vector3f& second,
                                        float yaw = 0);
/// Adds a wall between two points (x, z) along x or z, with a door of 0.9 m at `door` meters from the first; negative:
/// none.
void add_wall(std::vector<Scene::Solid>& s, const Eigen::Vector2f& from, const Eigen::Vector2f& to, float door,
              const Paper& paper);
/// Adds a table with four legs and two objects on top.
void add_table(std::vector<Scene::Solid>& s, float x, float z, float width, float depth, const Eigen::Vector3f& tint);
/// Adds four boards with books, with the back against a wall along x (`along_x`) or z.
void add_shelf(std::vector<Scene::Solid>& s, float x, float z, bool along_x, const Eigen::Vector3f& tint);
void add_picture(std::vector<Scene::Solid>& s, const Eigen::Vector3f& center, const Eigen::Vector3f& half, float scale,
                 const Eigen::Vector3f& tint);
void add_ball(std::vector<Scene::Solid>& s, const Eigen::Vector3f& center, float radius, const Eigen::Vector3f& tint);
/// Adds an upright cylinder on the floor.
void add_column(std::vector<Scene::Solid>& s, float x, float z, float radius, float height,
                const Eigen::Vector3f& tint);

/// Points every 5 cm on the Catmull-Rom curve through some points, from the second to the second last. The points must
/// be about a meter apart; no distance may exceed twice another.
[[nodiscard]] std::vector<Eigen::Vector3d> smooth(const std::vector<Eigen::Vector3d>& through);

}  // namespace cairn
