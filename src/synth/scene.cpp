// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/synthetic/scene.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <stdexcept>
#include <string_view>

#include "cairn/mapping/pose.hpp"
#include "synth/building.hpp"
#include "synth/rooms.hpp"

namespace cairn {
namespace {

using Shape = Scene::Shape;
using Pattern = Scene::Pattern;
using Eigen::Vector3d;
using Eigen::Vector3f;

Vector3d local(const Scene::Solid& s, const Vector3d& p) {
  return Eigen::AngleAxisd(s.yaw, Vector3d::UnitY()) * (p - s.center.cast<double>());
}

double box_distance(const Vector3d& p, const Vector3d& half) {
  const Vector3d q = p.cwiseAbs() - half;
  return q.cwiseMax(0.0).norm() + std::min(q.maxCoeff(), 0.0);
}

double solid_distance(const Scene::Solid& s, const Vector3d& point) {
  const Vector3d p = local(s, point), half = s.half_size.cast<double>();
  switch (s.shape) {
    case Shape::box:
      return box_distance(p, half);
    case Shape::hollow:
      return -box_distance(p, half);
    case Shape::sphere:
      return p.norm() - half.x();
    case Shape::cylinder: {
      const double r = std::hypot(p.x(), p.z()) - half.x(), y = std::abs(p.y()) - half.y();
      return std::hypot(std::max(r, 0.0), std::max(y, 0.0)) + std::min(std::max(r, y), 0.0);
    }
  }
  return 0;
}

Eigen::Isometry3d camera_pose(const Vector3d& from, const Vector3d& direction, double roll) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  const Vector3d z = direction.normalized(), x = Vector3d::UnitY().cross(z).normalized();
  pose.linear().col(0) = x;
  pose.linear().col(1) = z.cross(x);
  pose.linear().col(2) = z;
  pose.linear() = pose.linear() * Eigen::AngleAxisd(roll, Vector3d::UnitZ());
  pose.translation() = from;
  return pose;
}

/// View direction from yaw in radians (0: along z) and pitch (positive: down).
Vector3d heading(double yaw, double pitch) {
  return {std::sin(yaw) * std::cos(pitch), std::sin(pitch), std::cos(yaw) * std::cos(pitch)};
}

constexpr double kSpeed = 0.5, kSpacing = 0.05;  // meters per second along a path, meters between its points

/// Motion of a hand-held camera relative to its path: pitch, yaw and roll in radians, then meters. Sines with a
/// frequency from each band, and the speed of TUM's freiburg1_xyz and freiburg2_desk in the band (root mean square of
/// each axis of the ground truth).
Vector6d hand_motion(std::uint64_t hand, double t) {
  struct Band {
    double from, to, turn, shift;  // Hz; radians and meters per second
  };
  constexpr std::array<Band, 4> kBands{
      {{0.3, 0.6, 0.06, 0.06}, {0.6, 1.0, 0.055, 0.03}, {1.0, 1.6, 0.07, 0.018}, {1.6, 2.5, 0.07, 0.012}}};
  std::mt19937_64 random(hand);
  const auto uniform = [&] { return static_cast<double>(random() >> 11) / 9007199254740992.0; };
  Vector6d moved = Vector6d::Zero();
  for (int axis = 0; axis < 6; ++axis)
    for (const Band& band : kBands) {
      const double rate = 2 * std::numbers::pi * (band.from + (band.to - band.from) * uniform());
      const double phase = 2 * std::numbers::pi * uniform();
      moved[axis] += std::numbers::sqrt2 * (axis < 3 ? band.turn : band.shift) / rate * std::sin(rate * t + phase);
    }
  return moved;
}

/// Adds the triangles of a grid over a parametric patch.
template <class Point>
void add_patch(Mesh& mesh, int columns, int rows, const Point& point) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  for (int j = 0; j <= rows; ++j)
    for (int i = 0; i <= columns; ++i)
      mesh.positions.push_back(
          point(static_cast<double>(i) / columns, static_cast<double>(j) / rows).template cast<float>());
  const auto at = [&](int i, int j) { return first + static_cast<std::uint32_t>(j * (columns + 1) + i); };
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
}

void add_solid(Mesh& mesh, const Scene::Solid& s, double spacing) {
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(-s.yaw, Vector3d::UnitY()).toRotationMatrix();
  const Vector3d half = s.half_size.cast<double>(), center = s.center.cast<double>();
  const auto place = [&](const Vector3d& p) -> Vector3d { return center + turn * p; };
  const auto steps = [&](double length) { return std::max(1, static_cast<int>(std::ceil(length / spacing))); };
  constexpr double kTurn = 2 * std::numbers::pi;
  if (s.shape == Shape::box || s.shape == Shape::hollow) {
    for (int axis = 0; axis < 3; ++axis)
      for (const double side : {-1.0, 1.0}) {
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        const bool flip = (side > 0) != (s.shape == Shape::box);
        add_patch(mesh, steps(2 * half[u]), steps(2 * half[v]), [&](double a, double b) {
          Vector3d p;
          p[axis] = side * half[axis];
          p[u] = (flip ? 1 - 2 * a : 2 * a - 1) * half[u];
          p[v] = (2 * b - 1) * half[v];
          return place(p);
        });
      }
    return;
  }
  const double r = half.x();
  const int around = std::max(12, steps(kTurn * r));
  if (s.shape == Shape::sphere) {
    add_patch(mesh, around, std::max(6, around / 2), [&](double a, double b) {
      const double polar = std::numbers::pi * b;
      return place(
          r * Vector3d(std::sin(polar) * std::cos(kTurn * a), std::cos(polar), std::sin(polar) * std::sin(kTurn * a)));
    });
    return;
  }
  add_patch(mesh, around, steps(2 * half.y()), [&](double a, double b) {
    return place({r * std::cos(kTurn * a), (1 - 2 * b) * half.y(), r * std::sin(kTurn * a)});
  });
  for (const double side : {-1.0, 1.0})
    add_patch(mesh, around, steps(r), [&](double a, double b) {
      return place({side * b * r * std::cos(kTurn * a), side * half.y(), b * r * std::sin(kTurn * a)});
    });
}

/// True if a point is at least `depth` inside a static solid.
bool is_inside(const std::vector<Scene::Solid>& solids, const Vector3f& point, double depth) {
  return std::any_of(solids.begin(), solids.end(), [&](const Scene::Solid& s) {
    if (s.period > 0) return false;
    // Fast rejection by a bounding ball; only a room contains points far from its center.
    const float reach = 1.01f * s.half_size.norm();
    if (s.shape != Shape::hollow && (point - s.center).squaredNorm() > reach * reach) return false;
    return solid_distance(s, point.cast<double>()) <= -depth;
  });
}

/// Person who walks to and fro in front of the desk.
void add_mover(std::vector<Scene::Solid>& solids) {
  const Vector3f walk(1.5f, 0, 0);
  constexpr float kThereAndBack = 10;  // seconds: 0.9 m/s at most
  solids.push_back({.shape = Shape::cylinder,
                    .center = {0, 0.5f, 1.3f},
                    .half_size = {0.17f, 0.75f, 0},
                    .pattern = Pattern::checker,
                    .color = {0.2f, 0.3f, 0.5f},
                    .swing = walk,
                    .period = kThereAndBack});
  solids.push_back({.shape = Shape::sphere,
                    .center = {0, -0.38f, 1.3f},
                    .half_size = {0.13f, 0, 0},
                    .color = {0.8f, 0.6f, 0.5f},
                    .swing = walk,
                    .period = kThereAndBack});
}

}  // namespace

bool Scene::moves() const {
  return std::any_of(solids.begin(), solids.end(), [](const Solid& s) { return s.period > 0; });
}

std::vector<Scene::Solid> Scene::solids_at(double seconds) const {
  std::vector<Solid> now = solids;
  for (Solid& s : now)
    if (s.period > 0)
      s.center +=
          static_cast<float>(std::cos(2 * std::numbers::pi * seconds / static_cast<double>(s.period))) * s.swing;
  return now;
}

double Scene::distance(const Vector3d& point) const {
  double min_distance = std::numeric_limits<double>::infinity();
  for (const Solid& s : solids)
    if (s.period == 0) min_distance = std::min(min_distance, solid_distance(s, point));
  return min_distance;
}

Eigen::Isometry3d Scene::world_from_camera(double t) const {
  const double sway = 0.03 * std::sin(5.1 * t) + 0.02 * std::sin(8.3 * t + 1.0);     // meters: steps and a hand
  const double shake = 0.02 * std::sin(6.7 * t) + 0.012 * std::sin(11.0 * t + 0.5);  // radians
  const double roll = 0.06 * std::sin(1.3 * t) + 0.5 * shake;
  if (name == "sphere" || name == "plane") {
    const double angle = 0.5 * std::sin(0.6 * t);
    const Vector3d from(0.7 * std::sin(0.6 * t), 0.2 * std::sin(0.9 * t) + sway, 0.15 * std::sin(0.5 * t));
    return camera_pose(from, heading(-angle * 0.6, 0.1 * std::sin(0.8 * t) + shake), roll);
  }
  if (name == "door") {
    // Around the handle, facing it.
    const Vector3d from(0.26 + 0.13 * std::sin(0.9 * t), 0.03 + 0.1 * std::sin(0.7 * t + 0.4) + 0.4 * sway,
                        0.04 * std::sin(0.6 * t));
    return camera_pose(from, heading(-0.25 * std::sin(0.9 * t) + 0.4 * shake, -0.2 * std::sin(0.7 * t + 0.4) + shake),
                       roll);
  }
  if (name == "corridor")
    return camera_pose({0.15 * std::sin(0.7 * t), sway, 0.4 * t},
                       heading(0.35 * std::sin(0.5 * t), 0.15 + 0.1 * std::sin(0.7 * t) + shake), roll);
  if (name == "loop") {
    // A loop around a square of 6 m in 48 s, with rounded corners, facing ahead and slightly outwards.
    const double angle = 2 * std::numbers::pi * t / 48;
    const double c = std::cos(angle), s = std::sin(angle);
    const double bulge = 3.0 / std::pow(std::pow(std::abs(c), 6) + std::pow(std::abs(s), 6), 1.0 / 6);
    const Vector3d from(-bulge * c + 3.0, sway, bulge * s);
    return camera_pose(from, heading(angle - 0.35 + 0.2 * std::sin(0.9 * t), 0.12 + 0.1 * std::sin(0.6 * t) + shake),
                       roll);
  }
  if (!path.empty()) {
    constexpr double kAhead = 0.5;  // meters
    const auto at = [&](double meters) -> Vector3d {
      const double i = std::clamp(meters / kSpacing, 0.0, static_cast<double>(path.size()) - 1.001);
      const auto k = static_cast<std::size_t>(i);
      return path[k] + (i - static_cast<double>(k)) * (path[k + 1] - path[k]);
    };
    const double last = kSpacing * static_cast<double>(path.size() - 1);
    const double along = std::clamp(kSpeed * t, 0.0, last);
    const Vector3d from = at(along), ahead = at(std::min(along + kAhead, last)) - at(along - kAhead);
    // Every 7 s a glance of 80 degrees aside, alternately left and right: 0.75 s there, 0.75 s back.
    constexpr double kGlance = 1.4, kPeriod = 7, kBegin = 3, kTurn = 0.75, kHold = 0.5;
    const double phase = std::fmod(std::max(t, 0.0), kPeriod) - kBegin;
    const auto ease = [](double x) { return x * x * (3 - 2 * x); };
    const double out = ease(std::clamp(phase / kTurn, 0.0, 1.0)),
                 back = ease(std::clamp((phase - kTurn - kHold) / kTurn, 0.0, 1.0));
    const double side = std::fmod(std::max(t, 0.0), 2 * kPeriod) < kPeriod ? -1 : 1;
    const double yaw = std::atan2(ahead.x(), ahead.z()) + side * kGlance * (out - back),
                 pitch = 0.2 + 0.15 * std::sin(0.6 * t);
    if (hand == 0) return camera_pose(from + Vector3d(0, sway, 0), heading(yaw, pitch + shake), roll);
    const Vector6d moved = hand_motion(hand, t);
    return camera_pose(from + moved.tail<3>(), heading(yaw + moved[1], pitch + moved[0]),
                       0.06 * std::sin(1.3 * t) + moved[2]);
  }
  // Around the middle of the room, facing outwards, up and down.
  const double angle = 2 * std::numbers::pi * t / 24 + 0.15 * std::sin(1.1 * t);
  const Vector3d from(0.75 * std::sin(angle) - 0.1, 0.15 * std::sin(0.8 * t) + sway - 0.1,
                      0.55 * std::cos(angle) - 0.35);
  return camera_pose(from, heading(angle + 0.25 * std::sin(0.9 * t), 0.28 + 0.2 * std::sin(0.7 * t) + shake), roll);
}

double Scene::duration() const {
  constexpr double kDefaultDuration = 10;  // seconds
  return path.empty() ? kDefaultDuration : kSpacing * static_cast<double>(path.size() - 1) / kSpeed;
}

Scene Scene::around(const std::vector<Vector3d>& places, double meters) const {
  Scene near = *this;
  std::erase_if(near.solids, [&](const Solid& s) {
    return std::none_of(places.begin(), places.end(),
                        [&](const Vector3d& place) { return solid_distance(s, place) <= meters; });
  });
  return near;
}

Mesh Scene::surface(float spacing) const {
  constexpr double kHidden = 1e-5;  // meters inside another solid
  Mesh all, mesh;
  for (const Solid& s : solids)
    if (s.period == 0) add_solid(all, s, spacing);
  mesh.positions = std::move(all.positions);
  std::vector<char> hidden(mesh.positions.size());  // by vertex
  for (std::size_t v = 0; v < hidden.size(); ++v) hidden[v] = is_inside(solids, mesh.positions[v], kHidden);
  for (const auto& t : all.triangles) {
    if (hidden[t[0]] || hidden[t[1]] || hidden[t[2]]) continue;
    // The center of a curved solid's triangle is slightly inside the solid itself, so the corners are tested as well.
    const Vector3f center = (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3.0f;
    const double sagitta = 0.02 * spacing;
    if (!is_inside(solids, center, kHidden + sagitta)) mesh.triangles.push_back(t);
  }
  return mesh;
}

Scene synthetic_scene(const std::string& name) {
  constexpr std::string_view kBuilding = "building";
  if (name == kBuilding) return building({});
  if (name.starts_with(kBuilding) && name[kBuilding.size()] == '?')
    return building(building_options(std::string_view(name).substr(kBuilding.size() + 1)));
  Scene scene{.name = name};
  if (name == "room" || name == "room-with-mover") {
    scene.solids = furnished_room();
    if (name == "room-with-mover") add_mover(scene.solids);
  } else if (name == "sphere") {
    scene.solids.push_back({Shape::sphere,
                            {0, 0, 1.8f},
                            {0.6f, 0, 0},
                            0,
                            Pattern::checker,
                            0.15f,
                            {0.8f, 0.3f, 0.2f},
                            {0.9f, 0.85f, 0.7f}});
  } else if (name == "plane") {
    scene.solids.push_back(
        {Shape::box, {0, 0, 2.5f}, {6, 6, 0.5f}, 0, Pattern::patches, 0.15f, {0.7f, 0.6f, 0.3f}, {0.2f, 0.4f, 0.6f}});
  } else if (name == "corridor") {
    scene.solids.push_back({Shape::hollow,
                            {0, 0, 13},
                            {1.0f, 1.3f, 15},
                            0,
                            Pattern::patches,
                            0.3f,
                            {0.7f, 0.65f, 0.5f},
                            {0.4f, 0.45f, 0.5f}});
  } else if (name == "door") {
    scene.solids = door();
  } else if (name == "loop") {
    scene.solids = corridor_around_a_block();
  } else if (name == "flat") {
    scene.solids = flat();
    scene.path = path_through_flat();
  } else if (name == "twin-rooms") {
    scene.solids = twin_rooms();
    scene.path = path_through_twin_rooms();
  } else {
    throw std::runtime_error(
        "there is no synthetic scene '" + name +
        "': choose room, room-with-mover, flat, twin-rooms, sphere, plane, corridor, loop, door or building");
  }
  return scene;
}

Camera synthetic_camera() { return {640, 480, 525.0, 525.0, 319.5, 239.5, {}}; }

void mark_seen(const Mesh& mesh, const Camera& camera, const Eigen::Isometry3d& world_from_camera,
               const std::vector<float>& depth, std::vector<bool>& seen) {
  constexpr double kDepthTolerance = 0.01;  // meters
  const Eigen::Isometry3d camera_from_world = world_from_camera.inverse();
  seen.resize(mesh.triangles.size());
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (seen[i]) continue;
    const auto& t = mesh.triangles[i];
    const Vector3d p = camera_from_world *
                       ((mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3.0f).cast<double>();
    if (p.z() <= 0) continue;
    const Eigen::Vector2d pixel = camera.project(p);
    const int x = static_cast<int>(std::lround(pixel.x())), y = static_cast<int>(std::lround(pixel.y()));
    if (x < 0 || y < 0 || x >= camera.width || y >= camera.height) continue;
    const float z = depth[static_cast<std::size_t>(y * camera.width + x)];
    seen[i] = z > 0 && std::abs(z - p.z()) < kDepthTolerance;
  }
}

}  // namespace cairn
