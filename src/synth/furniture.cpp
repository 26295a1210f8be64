// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "synth/furniture.hpp"

namespace cairn {
namespace {

using Shape = Scene::Shape;
using Pattern = Scene::Pattern;
using Eigen::Vector3f;

constexpr float kLintel = 0.55f;  // meters

}  // namespace

Scene::Solid box_on_floor(float x, float z, Vector3f size, float above, Pattern pattern, float scale,
                          const Vector3f& color, const Vector3f& second, float yaw) {
  return {Shape::box, {x, static_cast<float>(kFloor) - above - size.y() / 2, z}, size / 2, yaw, pattern, scale, color,
          second};
}

void add_wall(std::vector<Scene::Solid>& s, const Eigen::Vector2f& from, const Eigen::Vector2f& to, float door,
              const Paper& paper) {
  const Eigen::Vector2f along = (to - from).normalized();
  const float length = (to - from).norm(), height = static_cast<float>(kFloor) - kCeiling;
  const auto segment = [&](float begin, float end, float below, float above) {
    const Eigen::Vector2f middle = from + along * (0.5f * (begin + end));
    const float half = 0.5f * (end - begin);
    const Vector3f size(std::abs(along.x()) * half + std::abs(along.y()) * kWall / 2, (above - below) / 2,
                        std::abs(along.y()) * half + std::abs(along.x()) * kWall / 2);
    s.push_back({Shape::box,
                 {middle.x(), static_cast<float>(kFloor) - (below + above) / 2, middle.y()},
                 size,
                 0,
                 paper.pattern,
                 paper.scale,
                 paper.color,
                 paper.second});
  };
  if (door < 0) return segment(0, length, 0, height);
  segment(0, door - kDoor / 2, 0, height);
  segment(door + kDoor / 2, length, 0, height);
  segment(door - kDoor / 2, door + kDoor / 2, height - kLintel, height);
}

void add_table(std::vector<Scene::Solid>& s, float x, float z, float width, float depth, const Vector3f& tint) {
  s.push_back(box_on_floor(x, z, {width, 0.05f, depth}, 0.70f, Pattern::wood, 0.25f, kWood, kDark));
  for (const float i : {-1.0f, 1.0f})
    for (const float k : {-1.0f, 1.0f})
      s.push_back(box_on_floor(x + i * (width / 2 - 0.08f), z + k * (depth / 2 - 0.08f), {0.07f, 0.70f, 0.07f}, 0,
                               Pattern::wood, 0.2f, kDark, kWood));
  s.push_back(box_on_floor(x - width / 4, z, {0.3f, 0.18f, 0.22f}, 0.75f, Pattern::patches, 0.05f, tint, kWhite, 0.5f));
  s.push_back({Shape::cylinder,
               {x + width / 4, static_cast<float>(kFloor) - 0.85f, z + 0.05f},
               {0.06f, 0.1f, 0},
               0,
               Pattern::checker,
               0.04f,
               tint,
               kWhite});
}

void add_shelf(std::vector<Scene::Solid>& s, float x, float z, bool along_x, const Vector3f& tint) {
  const auto size = [&](float width, float height, float depth) {
    return along_x ? Vector3f(width, height, depth) : Vector3f(depth, height, width);
  };
  for (int i = 0; i < 4; ++i)
    s.push_back(box_on_floor(x, z, size(1.3f, 0.04f, 0.3f), 0.05f + 0.45f * static_cast<float>(i), Pattern::wood, 0.3f,
                             kWood, kDark));
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) {
      const float shift = -0.42f + 0.42f * static_cast<float>(k);
      s.push_back(box_on_floor(along_x ? x + shift : x, along_x ? z : z + shift,
                               size(0.26f + 0.05f * static_cast<float>((i + 2 * k) % 3),
                                    0.22f + 0.05f * static_cast<float>((2 * i + k) % 3), 0.22f),
                               0.09f + 0.45f * static_cast<float>(i), Pattern::patches, 0.05f, tint,
                               {0.2f, 0.3f, 0.6f}));
    }
}

void add_picture(std::vector<Scene::Solid>& s, const Vector3f& center, const Vector3f& half, float scale,
                 const Vector3f& tint) {
  s.push_back({Shape::box, center, half, 0, Pattern::patches, scale, tint, {0.2f, 0.3f, 0.8f}});
}

void add_ball(std::vector<Scene::Solid>& s, const Vector3f& center, float radius, const Vector3f& tint) {
  s.push_back({Shape::sphere, center, {radius, 0, 0}, 0, Pattern::checker, radius / 2, tint, kWhite});
}

void add_column(std::vector<Scene::Solid>& s, float x, float z, float radius, float height, const Vector3f& tint) {
  s.push_back({Shape::cylinder,
               {x, static_cast<float>(kFloor) - height / 2, z},
               {radius, height / 2, 0},
               0,
               Pattern::tiles,
               0.12f,
               tint,
               kWhite});
}

std::vector<Eigen::Vector3d> smooth(const std::vector<Eigen::Vector3d>& through) {
  constexpr double kStep = 0.05;
  std::vector<Eigen::Vector3d> path;
  for (std::size_t i = 1; i + 2 < through.size(); ++i) {
    const auto &a = through[i - 1], &b = through[i], &c = through[i + 1], &d = through[i + 2];
    for (int k = 0; k < 100; ++k) {
      const double t = k / 100.0;
      const Eigen::Vector3d p =
          0.5 * (2 * b + t * (c - a) + t * t * (2 * a - 5 * b + 4 * c - d) + t * t * t * (3 * b - a - 3 * c + d));
      if (path.empty() || (p - path.back()).norm() >= kStep) path.push_back(p);
    }
  }
  return path;
}

}  // namespace cairn
