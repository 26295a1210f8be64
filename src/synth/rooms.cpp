// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "synth/rooms.hpp"

#include <cmath>
#include <numbers>

#include "synth/furniture.hpp"

namespace cairn {
namespace {

using Shape = Scene::Shape;
using Pattern = Scene::Pattern;
using Eigen::Vector3f;

/// Points (x, z) at the height of the origin.
std::vector<Eigen::Vector3d> level(const std::vector<Eigen::Vector2d>& points) {
  std::vector<Eigen::Vector3d> level;
  level.reserve(points.size());
  for (const auto& p : points) level.emplace_back(p.x(), 0, p.y());
  return level;
}

/// Walls, floor and rug.
void add_walls(std::vector<Scene::Solid>& s) {
  s.push_back({Shape::hollow,
               {0, 0, 0},
               {2.7f, 1.3f, 2.3f},
               0,
               Pattern::tiles,
               0.4f,
               {0.78f, 0.76f, 0.66f},
               {0.55f, 0.5f, 0.45f}});
  s.push_back(box_on_floor(0, 0, {3.2f, 0.012f, 2.4f}, 0, Pattern::checker, 0.22f, {0.62f, 0.2f, 0.18f},
                           {0.82f, 0.68f, 0.45f}));
}

/// Desk with a screen, books, a lamp and a mug.
void add_desk(std::vector<Scene::Solid>& s) {
  s.push_back(box_on_floor(0.2f, 1.85f, {1.6f, 0.05f, 0.75f}, 0.70f, Pattern::wood, 0.25f, kWood, kDark));
  for (const float x : {-0.52f, 0.92f})
    for (const float z : {1.55f, 2.15f})
      s.push_back(box_on_floor(x, z, {0.07f, 0.70f, 0.07f}, 0, Pattern::wood, 0.2f, kDark, kWood));
  s.push_back(box_on_floor(0.15f, 2.05f, {0.62f, 0.38f, 0.05f}, 0.87f, Pattern::patches, 0.09f, {0.2f, 0.4f, 0.7f},
                           {0.1f, 0.6f, 0.5f}));
  s.push_back(
      box_on_floor(0.15f, 2.02f, {0.24f, 0.13f, 0.18f}, 0.75f, Pattern::plain, 0.1f, {0.25f, 0.25f, 0.27f}, kGray));
  s.push_back(box_on_floor(0.75f, 1.85f, {0.24f, 0.16f, 0.30f}, 0.75f, Pattern::patches, 0.045f, {0.7f, 0.2f, 0.2f},
                           kWhite, 0.4f));
  s.push_back({Shape::cylinder,
               {-0.35f, 0.49f, 1.75f},
               {0.045f, 0.055f, 0},
               0,
               Pattern::checker,
               0.03f,
               {0.85f, 0.3f, 0.2f},
               kWhite});
  s.push_back({Shape::sphere,
               {-0.42f, 0.43f, 2.03f},
               {0.12f, 0, 0},
               0,
               Pattern::checker,
               0.06f,
               {0.9f, 0.75f, 0.3f},
               {0.6f, 0.4f, 0.2f}});
}

/// Chair.
void add_chair(std::vector<Scene::Solid>& s) {
  s.push_back(box_on_floor(0.2f, 1.15f, {0.45f, 0.06f, 0.45f}, 0.42f, Pattern::checker, 0.06f, {0.2f, 0.45f, 0.35f},
                           {0.8f, 0.8f, 0.7f}, 0.3f));
  s.push_back(box_on_floor(0.14f, 0.95f, {0.45f, 0.45f, 0.05f}, 0.50f, Pattern::tiles, 0.09f, {0.2f, 0.45f, 0.35f},
                           {0.8f, 0.8f, 0.7f}, 0.3f));
  s.push_back({Shape::cylinder, {0.2f, 1.09f, 1.15f}, {0.05f, 0.21f, 0}, 0, Pattern::plain, 0.1f, kGray, kGray});
  s.push_back({Shape::cylinder, {0.2f, 1.275f, 1.15f}, {0.25f, 0.025f, 0}, 0, Pattern::plain, 0.1f, kGray, kGray});
}

/// Shelf on the right, with books.
void add_shelf(std::vector<Scene::Solid>& s) {
  s.push_back(box_on_floor(2.55f, 0.6f, {0.03f, 1.9f, 1.5f}, 0, Pattern::wood, 0.3f, kDark, kWood));
  for (int i = 0; i < 5; ++i)
    s.push_back(box_on_floor(2.42f, 0.6f, {0.33f, 0.04f, 1.5f}, 0.05f + 0.45f * static_cast<float>(i), Pattern::wood,
                             0.3f, kWood, kDark));
  for (int i = 0; i < 4; ++i)
    for (int k = 0; k < 3; ++k)
      s.push_back(box_on_floor(2.43f - 0.02f * static_cast<float>((i + k) % 3), 0.12f + 0.45f * static_cast<float>(k),
                               {0.24f, 0.24f + 0.04f * static_cast<float>((2 * i + k) % 3),
                                0.28f + 0.05f * static_cast<float>((i + 2 * k) % 3)},
                               0.09f + 0.45f * static_cast<float>(i), Pattern::patches, 0.05f, {0.6f, 0.3f, 0.2f},
                               {0.2f, 0.3f, 0.6f}));
}

/// Sofa at the back, with cushions.
void add_sofa(std::vector<Scene::Solid>& s) {
  s.push_back(box_on_floor(-0.3f, -1.8f, {2.0f, 0.42f, 0.85f}, 0, Pattern::checker, 0.12f, {0.25f, 0.35f, 0.6f},
                           {0.35f, 0.45f, 0.7f}));
  s.push_back(box_on_floor(-0.3f, -2.12f, {2.0f, 0.45f, 0.22f}, 0.42f, Pattern::checker, 0.12f, {0.25f, 0.35f, 0.6f},
                           {0.35f, 0.45f, 0.7f}));
  for (const float x : {-1.38f, 0.78f})
    s.push_back(box_on_floor(x, -1.8f, {0.18f, 0.62f, 0.85f}, 0, Pattern::checker, 0.12f, {0.22f, 0.3f, 0.55f},
                             {0.35f, 0.45f, 0.7f}));
  s.push_back(
      {Shape::sphere, {-0.9f, 0.74f, -1.85f}, {0.2f, 0, 0}, 0, Pattern::tiles, 0.1f, {0.85f, 0.55f, 0.2f}, kWhite});
  s.push_back(
      {Shape::sphere, {0.4f, 0.76f, -1.9f}, {0.18f, 0, 0}, 0, Pattern::checker, 0.07f, {0.7f, 0.2f, 0.3f}, kWhite});
}

/// Cupboard on the left, with a box and a plant in front of it.
void add_cupboard(std::vector<Scene::Solid>& s) {
  s.push_back(box_on_floor(-2.42f, 0.5f, {0.5f, 0.95f, 1.3f}, 0, Pattern::wood, 0.35f, {0.75f, 0.6f, 0.4f}, kWood));
  s.push_back(box_on_floor(-2.42f, 0.25f, {0.35f, 0.3f, 0.4f}, 0.95f, Pattern::patches, 0.07f, {0.3f, 0.55f, 0.3f},
                           kWhite, 0.5f));
  s.push_back(
      {Shape::cylinder, {-2.4f, 0.2f, 0.85f}, {0.12f, 0.15f, 0}, 0, Pattern::tiles, 0.06f, {0.7f, 0.4f, 0.3f}, kWhite});
  s.push_back({Shape::sphere,
               {-2.4f, -0.1f, 0.85f},
               {0.24f, 0, 0},
               0,
               Pattern::patches,
               0.05f,
               {0.1f, 0.5f, 0.15f},
               {0.3f, 0.6f, 0.2f}});
  s.push_back(box_on_floor(-2.1f, -1.3f, {0.6f, 0.55f, 0.5f}, 0, Pattern::patches, 0.11f, {0.75f, 0.6f, 0.4f},
                           {0.5f, 0.3f, 0.2f}, 0.6f));
  s.push_back({Shape::cylinder,
               {2.1f, 0.95f, -1.6f},
               {0.28f, 0.35f, 0},
               0,
               Pattern::tiles,
               0.12f,
               {0.5f, 0.6f, 0.65f},
               kWhite});
  s.push_back({Shape::sphere,
               {2.1f, 0.38f, -1.6f},
               {0.22f, 0, 0},
               0,
               Pattern::checker,
               0.08f,
               {0.85f, 0.8f, 0.3f},
               {0.3f, 0.3f, 0.3f}});
}

/// Pictures, a door and a window.
void add_pictures(std::vector<Scene::Solid>& s) {
  s.push_back({Shape::box,
               {-1.2f, -0.35f, 2.28f},
               {0.45f, 0.32f, 0.03f},
               0,
               Pattern::patches,
               0.12f,
               {0.8f, 0.3f, 0.2f},
               {0.2f, 0.3f, 0.8f}});
  s.push_back({Shape::box,
               {1.6f, -0.3f, 2.28f},
               {0.3f, 0.4f, 0.03f},
               0,
               Pattern::patches,
               0.08f,
               {0.3f, 0.7f, 0.4f},
               {0.9f, 0.8f, 0.3f}});
  s.push_back({Shape::box,
               {0.2f, -0.45f, -2.28f},
               {0.7f, 0.35f, 0.03f},
               0,
               Pattern::patches,
               0.14f,
               {0.2f, 0.5f, 0.7f},
               {0.9f, 0.6f, 0.4f}});
  s.push_back({Shape::box,
               {-2.68f, 0.25f, -0.75f},
               {0.03f, 1.05f, 0.42f},
               0,
               Pattern::wood,
               0.5f,
               {0.65f, 0.55f, 0.42f},
               kDark});
  s.push_back({Shape::box,
               {2.68f, -0.2f, -0.9f},
               {0.03f, 0.45f, 0.5f},
               0,
               Pattern::tiles,
               0.25f,
               {0.55f, 0.75f, 0.9f},
               kWhite});
}

/// Ceiling lamp and a beam.
void add_lamp(std::vector<Scene::Solid>& s) {
  s.push_back({Shape::box, {0, -1.25f, 0.4f}, {2.7f, 0.06f, 0.09f}, 0, Pattern::wood, 0.3f, kDark, kWood});
  s.push_back({Shape::cylinder,
               {0, -1.12f, -0.5f},
               {0.28f, 0.1f, 0},
               0,
               Pattern::checker,
               0.1f,
               {0.95f, 0.9f, 0.7f},
               {0.8f, 0.6f, 0.3f}});
}

}  // namespace

std::vector<Scene::Solid> furnished_room() {
  std::vector<Scene::Solid> s;
  add_walls(s);
  add_desk(s);
  add_chair(s);
  add_shelf(s);
  add_sofa(s);
  add_cupboard(s);
  add_pictures(s);
  add_lamp(s);
  return s;
}

std::vector<Scene::Solid> flat() {
  std::vector<Scene::Solid> s;
  const Vector3f red(0.7f, 0.25f, 0.2f), green(0.25f, 0.55f, 0.3f), blue(0.25f, 0.35f, 0.65f), ochre(0.8f, 0.6f, 0.25f);
  s.push_back({Shape::hollow,
               {0, 0, 0},
               {4.2f, 1.3f, 3.7f},
               0,
               Pattern::tiles,
               0.4f,
               {0.78f, 0.76f, 0.66f},
               {0.55f, 0.5f, 0.45f}});
  // Two walls cross in the middle; each of the four rooms has two doors.
  add_wall(s, {-4.2f, 0}, {0, 0}, 1.6f, {Pattern::tiles, 0.33f, {0.7f, 0.75f, 0.72f}, {0.5f, 0.55f, 0.5f}});
  add_wall(s, {0, 0}, {4.2f, 0}, 2.6f, {Pattern::checker, 0.28f, {0.76f, 0.7f, 0.6f}, {0.7f, 0.64f, 0.55f}});
  add_wall(s, {0, 0}, {0, 3.7f}, 2.2f, {Pattern::wood, 0.5f, {0.72f, 0.68f, 0.6f}, {0.6f, 0.56f, 0.5f}});
  add_wall(s, {0, -3.7f}, {0, 0}, 1.5f, {Pattern::tiles, 0.25f, {0.75f, 0.65f, 0.62f}, {0.6f, 0.5f, 0.48f}});
  // first room: x < 0, z < 0
  add_table(s, -2.3f, -3.2f, 1.4f, 0.7f, red);
  add_shelf(s, -4.0f, -1.9f, false, green);
  add_ball(s, {-0.5f, 1.05f, -0.55f}, 0.25f, ochre);
  add_picture(s, {-1.0f, -0.3f, -3.68f}, {0.4f, 0.3f, 0.03f}, 0.1f, red);
  add_picture(s, {-1.2f, -0.2f, -0.06f}, {0.45f, 0.35f, 0.03f}, 0.09f, green);
  add_column(s, -0.5f, -3.3f, 0.22f, 0.8f, blue);
  s.push_back(box_on_floor(-2.3f, -1.7f, {1.4f, 0.012f, 1.2f}, 0, Pattern::checker, 0.2f, red, kWhite));
  // second: x < 0, z > 0
  s.push_back(box_on_floor(-3.5f, 3.1f, {1.2f, 0.45f, 1.0f}, 0, Pattern::checker, 0.12f, blue, {0.35f, 0.45f, 0.7f}));
  add_ball(s, {-3.6f, 0.68f, 3.2f}, 0.18f, red);
  add_shelf(s, -1.9f, 3.52f, true, blue);
  s.push_back(box_on_floor(-0.3f, 0.55f, {0.45f, 1.5f, 0.7f}, 0, Pattern::wood, 0.35f, kWood, kDark));
  add_picture(s, {-4.18f, -0.3f, 1.3f}, {0.03f, 0.4f, 0.55f}, 0.11f, ochre);
  add_picture(s, {-0.06f, -0.3f, 3.2f}, {0.03f, 0.25f, 0.3f}, 0.07f, green);
  add_column(s, -3.7f, 0.5f, 0.2f, 1.2f, green);
  s.push_back(box_on_floor(-2.2f, 1.7f, {1.6f, 0.012f, 1.3f}, 0, Pattern::tiles, 0.25f, green, ochre));
  // third: x > 0, z > 0
  add_table(s, 1.6f, 1.2f, 0.9f, 0.8f, green);
  s.push_back(box_on_floor(3.9f, 2.9f, {0.55f, 0.9f, 1.4f}, 0, Pattern::patches, 0.2f, kWhite, kGray));
  s.push_back(box_on_floor(1.2f, 3.4f, {1.6f, 0.85f, 0.55f}, 0, Pattern::wood, 0.4f, {0.75f, 0.6f, 0.4f}, kWood));
  add_column(s, 1.0f, 3.4f, 0.1f, 1.15f, red);
  add_ball(s, {1.6f, 0.3f, 3.35f}, 0.15f, ochre);
  add_picture(s, {2.9f, -0.35f, 3.68f}, {0.5f, 0.35f, 0.03f}, 0.12f, blue);
  add_picture(s, {4.18f, -0.3f, 1.0f}, {0.03f, 0.35f, 0.4f}, 0.08f, red);
  add_picture(s, {1.1f, -0.3f, 0.06f}, {0.45f, 0.3f, 0.03f}, 0.1f, ochre);
  // fourth: x > 0, z < 0
  s.push_back(box_on_floor(3.5f, -3.2f, {1.3f, 0.42f, 0.85f}, 0, Pattern::checker, 0.1f, red, {0.5f, 0.15f, 0.15f}));
  s.push_back(
      box_on_floor(3.5f, -3.52f, {1.3f, 0.45f, 0.2f}, 0.42f, Pattern::checker, 0.1f, red, {0.5f, 0.15f, 0.15f}));
  add_shelf(s, 1.5f, -0.25f, true, red);
  add_ball(s, {0.5f, 1.08f, -0.6f}, 0.22f, green);
  add_column(s, 3.75f, -0.55f, 0.3f, 0.75f, ochre);
  add_ball(s, {3.75f, 0.3f, -0.55f}, 0.22f, green);
  add_picture(s, {4.18f, -0.3f, -1.9f}, {0.03f, 0.4f, 0.6f}, 0.13f, green);
  add_picture(s, {1.5f, -0.35f, -3.68f}, {0.6f, 0.35f, 0.03f}, 0.1f, blue);
  s.push_back(box_on_floor(2.2f, -1.9f, {1.5f, 0.012f, 1.1f}, 0, Pattern::checker, 0.17f, blue, ochre));
  return s;
}

std::vector<Eigen::Vector3d> path_through_flat() {
  return smooth(level({{-0.9, -1.6}, {-1.2, -2.3}, {-2.2, -2.4}, {-3.1, -1.9}, {-3.0, -1.1}, {-2.6, -0.5},
                       {-2.6, 0.5},  {-3.0, 1.3},  {-2.7, 2.2},  {-1.8, 2.5},  {-0.7, 2.2},  {0.6, 2.2},
                       {1.6, 2.5},   {2.6, 2.6},   {3.1, 2.0},   {2.7, 1.2},   {2.6, 0.5},   {2.6, -0.5},
                       {3.0, -1.4},  {2.7, -2.3},  {1.8, -2.6},  {0.6, -2.2},  {-0.6, -2.2}, {-1.4, -2.3},
                       {-2.2, -2.4}, {-3.1, -1.9}, {-3.0, -1.1}, {-2.6, -0.5}, {-2.6, 0.5}}));
}

std::vector<Scene::Solid> corridor_around_a_block() {
  std::vector<Scene::Solid> s;
  s.push_back({Shape::hollow,
               {3, 0, 0},
               {4.2f, 1.3f, 4.2f},
               0,
               Pattern::tiles,
               0.35f,
               {0.75f, 0.72f, 0.6f},
               {0.5f, 0.45f, 0.4f}});
  s.push_back(
      {Shape::box, {3, 0, 0}, {1.8f, 1.3f, 1.8f}, 0, Pattern::patches, 0.25f, {0.5f, 0.6f, 0.65f}, {0.8f, 0.5f, 0.3f}});
  for (int i = 0; i < 16; ++i) {  // boxes and columns along the walls, each with its own size
    const int row = i / 2;
    const float along = -3.6f + 0.9f * static_cast<float>(row), side = i % 2 == 0 ? -0.98f : 6.98f;
    const float height = 0.5f + 0.37f * static_cast<float>(i * 7 % 5);
    s.push_back(box_on_floor(side, along, {0.36f, height, 0.3f + 0.05f * static_cast<float>(i % 4)}, 0,
                             Pattern::patches, 0.08f, {0.3f + 0.04f * static_cast<float>(i), 0.5f, 0.3f},
                             {0.8f, 0.3f, 0.5f}, 0.3f * static_cast<float>(i)));
    s.push_back({Shape::cylinder,
                 {3 + along, 1.3f - height / 2, i % 2 == 0 ? -3.95f : 3.95f},
                 {0.14f, height / 2, 0},
                 0,
                 Pattern::checker,
                 0.07f,
                 {0.7f, 0.3f, 0.2f},
                 {0.9f, 0.8f, 0.6f}});
  }
  return s;
}

std::vector<Scene::Solid> twin_rooms() {
  std::vector<Scene::Solid> s;
  const Vector3f red(0.7f, 0.25f, 0.2f), green(0.25f, 0.55f, 0.3f), blue(0.25f, 0.35f, 0.65f);
  const Paper paper{Pattern::tiles, 0.35f, {0.78f, 0.74f, 0.66f}, {0.55f, 0.5f, 0.45f}};
  // Room at x < 0; has its own floor and ceiling, so that both are identical in the two rooms.
  for (const float y : {static_cast<float>(kFloor) + kWall / 2, kCeiling - kWall / 2})
    s.push_back({Shape::box,
                 {-2, y, 0},
                 {2, kWall / 2, 2.1f},
                 0,
                 Pattern::tiles,
                 0.4f,
                 {0.6f, 0.55f, 0.5f},
                 {0.5f, 0.42f, 0.35f}});
  add_wall(s, {-4, -2.0f}, {0, -2.0f}, -1, paper);
  add_wall(s, {-4, 2.0f}, {0, 2.0f}, -1, paper);
  add_wall(s, {-4, -2.1f}, {-4, 2.1f}, -1, paper);
  add_wall(s, {-kWall / 2, -2.0f}, {-kWall / 2, 2.0f}, 2.0f, paper);
  add_table(s, -2.6f, 1.5f, 1.2f, 0.6f, red);
  add_shelf(s, -3.75f, -0.2f, false, green);
  add_ball(s, {-0.5f, 1.05f, -1.5f}, 0.25f, blue);
  add_column(s, -3.5f, 1.5f, 0.2f, 0.9f, blue);
  s.push_back(box_on_floor(-2.5f, -1.55f, {1.3f, 0.45f, 0.7f}, 0, Pattern::checker, 0.12f, blue, kGray));
  add_picture(s, {-2.2f, -0.3f, -1.94f}, {0.5f, 0.35f, 0.03f}, 0.1f, red);
  add_picture(s, {-1.0f, -0.3f, 1.94f}, {0.4f, 0.3f, 0.03f}, 0.09f, green);
  const std::size_t one = s.size();
  for (std::size_t i = 0; i < one; ++i) {
    Scene::Solid other = s[i];
    other.center.x() = -other.center.x();
    other.center.z() = -other.center.z();
    other.yaw += std::numbers::pi_v<float>;
    s.push_back(other);
  }
  return s;
}

std::vector<Scene::Solid> door() {
  const Vector3f steel(0.72f, 0.72f, 0.74f), wall(0.8f, 0.78f, 0.7f);
  constexpr float kLeaf = 0.4f, kHeight = 2.1f, kWidth = 0.9f;  // meters: distance of the leaf's surface, and its size
  std::vector<Scene::Solid> s;
  const auto add = [&](Vector3f center, const Vector3f& half, Pattern pattern, float scale, const Vector3f& color,
                       const Vector3f& second) {
    center.z() += kLeaf;
    s.push_back({Shape::box, center, half, 0, pattern, scale, color, second});
  };
  const float middle = static_cast<float>(kFloor) - kHeight / 2;
  add({0, middle, 0.02f}, {kWidth / 2, kHeight / 2, 0.02f}, Pattern::wood, 0.3f, kWood, kDark);
  for (const float side : {-1.0f, 1.0f}) {
    add({side * (kWidth / 2 + 0.04f), middle, 0}, {0.04f, kHeight / 2, 0.03f}, Pattern::plain, 0.1f, kWhite, kWhite);
    add({side * (kWidth / 2 + 1.08f), 0, 0.07f}, {1, 1.3f, 0.05f}, Pattern::plain, 0.1f, wall, wall);
  }
  add({0.36f, 0.05f, -0.002f}, {0.02f, 0.11f, 0.002f}, Pattern::plain, 0.1f, steel, steel);
  add({0.36f, 0, -0.025f}, {0.01f, 0.01f, 0.025f}, Pattern::plain, 0.1f, steel, steel);
  add({0.31f, 0, -0.052f}, {0.06f, 0.011f, 0.008f}, Pattern::plain, 0.1f, steel, steel);
  s.push_back(
      {Shape::cylinder, {0.36f, 0.11f, kLeaf - 0.004f}, {0.009f, 0.016f, 0}, 0, Pattern::plain, 0.1f, kGray, kGray});
  return s;
}

std::vector<Eigen::Vector3d> path_through_twin_rooms() {
  const std::vector<Eigen::Vector2d> around{{-0.8, 0.0},  {-1.4, 0.7},  {-2.4, 0.7}, {-3.0, 0.2},
                                            {-2.8, -0.6}, {-1.8, -0.8}, {-0.8, 0.0}};
  std::vector<Eigen::Vector2d> through{{-1.4, -0.4}};
  for (const double sign : {1.0, -1.0, 1.0})
    for (const auto& p : around) through.push_back(sign * p);
  through.push_back({0, 0});
  return smooth(level(through));
}

}  // namespace cairn
