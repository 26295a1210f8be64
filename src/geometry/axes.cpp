// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "geometry/axes.hpp"

#include <initializer_list>

namespace cairn {
namespace {

void turn(Mesh& mesh, Axes axes, Eigen::Vector3f (*by)(const Eigen::Vector3f&, Axes)) {
  if (axes == Axes::world) return;
  for (auto* vectors : {&mesh.positions, &mesh.normals})
    for (Eigen::Vector3f& v : *vectors) v = by(v, axes);
}

}  // namespace

std::string to_string(Axes axes) {
  switch (axes) {
    case Axes::automatic:
      return "automatic";
    case Axes::world:
      return "world";
    case Axes::y_up:
      return "yup";
    case Axes::z_up:
      return "zup";
  }
  return {};
}

// 0 - x instead of -x avoids negative zeros.
Eigen::Vector3f from_world(const Eigen::Vector3f& v, Axes axes) {
  if (axes == Axes::y_up) return {v.x(), 0 - v.y(), 0 - v.z()};
  if (axes == Axes::z_up) return {v.x(), v.z(), 0 - v.y()};
  return v;
}

Eigen::Vector3f to_world(const Eigen::Vector3f& v, Axes axes) {
  if (axes == Axes::y_up) return {v.x(), 0 - v.y(), 0 - v.z()};
  if (axes == Axes::z_up) return {v.x(), 0 - v.z(), v.y()};
  return v;
}

Eigen::Matrix3d matrix_from_world(Axes axes) {
  Eigen::Matrix3d turn;
  for (int axis = 0; axis < 3; ++axis) turn.col(axis) = from_world(Eigen::Vector3f::Unit(axis), axes).cast<double>();
  return turn;
}

void turn_from_world(Mesh& mesh, Axes axes) { turn(mesh, axes, from_world); }
void turn_to_world(Mesh& mesh, Axes axes) { turn(mesh, axes, to_world); }

std::string described(Axes axes) {
  const char* words = axes == Axes::y_up   ? "x right, y up, z back"
                      : axes == Axes::z_up ? "x right, y forward, z up"
                                           : "x right, y down, z forward";
  return "axes " + std::string(to_string(axes)) + ": " + words;
}

std::optional<Axes> axes_in(std::string_view text) {
  for (const Axes axes : {Axes::world, Axes::y_up, Axes::z_up})
    if (text.find(described(axes)) != std::string_view::npos) return axes;
  return std::nullopt;
}

}  // namespace cairn
