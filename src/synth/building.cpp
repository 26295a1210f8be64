// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "synth/building.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <random>
#include <set>
#include <stdexcept>
#include <string>

#include "synth/furniture.hpp"

namespace cairn {
namespace {

using Pattern = Scene::Pattern;
using Shape = Scene::Shape;
using Solids = std::vector<Scene::Solid>;
using Eigen::Vector2f;
using Eigen::Vector3d;
using Eigen::Vector3f;

// Meters. A corridor runs along x between two rows of rooms, with a staircase at each end.
constexpr float kStorey = 3, kHalfCorridor = 1.1f, kWidth = 4, kDepth = 4.8f;  // of rooms
constexpr float kDoorAt = 0.9f;                                                // from a room's first corner
constexpr float kLanding = 1.2f, kFlight = 2.4f, kHalfStairs = 1.3f;
constexpr int kSteps = 9;                           // of a flight, half a storey high
constexpr int kSharedOffices = 6, kRoomKinds = 10;  // number of rooms in ten that are identical offices
constexpr double kPathLengthRatio = 1.1;  // assumed length ratio of a path from corner to corner and the curve
                                          // through the corners
constexpr int kClosedDoors = 40;          // percent of the doors off the path
const auto kBelow = static_cast<float>(kFloor);

/// Hash of some numbers, the same on every platform (splitmix64: Steele, Lea & Flood 2014).
std::uint64_t mixed(std::initializer_list<int> numbers) {
  std::uint64_t x = 0x9e3779b97f4a7c15;
  for (const int n : numbers) {
    x += static_cast<std::uint64_t>(n) + 0x9e3779b97f4a7c15;
    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9;
    x = (x ^ x >> 27) * 0x94d049bb133111eb;
    x ^= x >> 31;
  }
  return x;
}
/// Draws from 0 up to `below`, exclusive.
int pick(std::uint64_t& number, int below) {
  const int picked = static_cast<int>(number % static_cast<std::uint64_t>(below));
  number /= static_cast<std::uint64_t>(below);
  return picked;
}
Vector3f tint(std::uint64_t& number) {
  const auto part = [&] { return 0.2f + 0.06f * static_cast<float>(pick(number, 11)); };
  const float red = part(), green = part();
  return {red, green, part()};
}

/// Placement of a part modeled at the origin, optionally rotated by 180 degrees.
struct Place {
  Vector3f at;
  bool is_turned = false;
  [[nodiscard]] Vector3f operator()(const Vector3f& p) const {
    return at + (is_turned ? Vector3f(-p.x(), p.y(), -p.z()) : p);
  }
};
void add(Solids& all, Solids part, const Place& place) {
  for (Scene::Solid& s : part) {
    s.center = place(s.center);
    if (place.is_turned) s.yaw += std::numbers::pi_v<float>;
    all.push_back(s);
  }
}

/// Rooms are numbered storey by storey; consecutive rooms face each other across the corridor.
struct Room {
  int storey, column, side;
};

class Plan {
 public:
  explicit Plan(const BuildingOptions& o) : options_(o) {}
  [[nodiscard]] int floors() const { return options_.floors; }
  /// Number of rooms of a storey, and the number of the first.
  [[nodiscard]] int rooms(int storey) const {
    return options_.rooms / options_.floors + (storey < options_.rooms % options_.floors ? 1 : 0);
  }
  [[nodiscard]] int first(int storey) const {
    return storey * (options_.rooms / options_.floors) + std::min(storey, options_.rooms % options_.floors);
  }
  [[nodiscard]] int columns() const { return (rooms(0) + 1) / 2; }
  [[nodiscard]] float length() const { return kWidth * static_cast<float>(columns()); }
  [[nodiscard]] Room room(int number) const {
    int storey = 0;
    while (number >= first(storey) + rooms(storey)) ++storey;
    return {storey, (number - first(storey)) / 2, (number - first(storey)) % 2};
  }
  static float height(int storey) { return -kStorey * static_cast<float>(storey); }
  /// Placement of coordinates from a room's first corner on the corridor, x along the corridor and z into the room.
  [[nodiscard]] static Place place(const Room& r) {
    const float x = kWidth * static_cast<float>(r.column + r.side);
    return {{x, height(r.storey), r.side == 0 ? kHalfCorridor : -kHalfCorridor}, r.side == 1};
  }
  [[nodiscard]] static float door_x(const Room& r) { return place(r)({kDoorAt, 0, 0}).x(); }
  /// Placement of coordinates from a corridor's end, x outwards.
  [[nodiscard]] Place stairs(int storey, int end) const {
    return {{end == 0 ? 0 : length(), height(storey), 0}, end == 0};
  }

 private:
  BuildingOptions options_;
};

Scene::Solid slab(const Vector2f& from, const Vector2f& to, float top, float thickness, const Paper& paper) {
  const Vector2f middle = (from + to) / 2, half = (to - from) / 2;
  return {Shape::box,
          {middle.x(), top + thickness / 2, middle.y()},
          {half.x(), thickness / 2, half.y()},
          0,
          paper.pattern,
          paper.scale,
          paper.color,
          paper.second};
}

const Paper kOfficePaper{Pattern::tiles, 0.35f, {0.78f, 0.76f, 0.7f}, {0.66f, 0.64f, 0.58f}};
const Paper kStone{Pattern::tiles, 0.5f, {0.62f, 0.6f, 0.58f}, {0.5f, 0.48f, 0.46f}};
const Paper kCarpet{Pattern::checker, 0.5f, {0.4f, 0.45f, 0.52f}, {0.36f, 0.41f, 0.48f}};
constexpr float kSlab = kStorey - 2.6f;  // between a ceiling and the floor above

void add_chair(Solids& s, float x, float z, const Vector3f& color) {
  s.push_back(box_on_floor(x, z, {0.45f, 0.06f, 0.45f}, 0.42f, Pattern::checker, 0.06f, color, kWhite, 0.3f));
  s.push_back(
      box_on_floor(x - 0.06f, z - 0.2f, {0.45f, 0.45f, 0.05f}, 0.5f, Pattern::tiles, 0.09f, color, kWhite, 0.3f));
  add_column(s, x, z, 0.05f, 0.42f, kGray);
}

/// Identical in every office, to the last book.
Solids office() {
  Solids s;
  add_table(s, 2.7f, 4.3f, 1.5f, 0.75f, {0.7f, 0.25f, 0.2f});
  s.push_back(box_on_floor(2.7f, 4.5f, {0.55f, 0.35f, 0.05f}, 0.87f, Pattern::patches, 0.08f, {0.2f, 0.4f, 0.7f},
                           {0.1f, 0.6f, 0.5f}));
  add_chair(s, 2.7f, 3.65f, {0.2f, 0.45f, 0.35f});
  add_shelf(s, 3.77f, 2.2f, false, {0.6f, 0.35f, 0.2f});
  s.push_back(box_on_floor(0.36f, 4.2f, {0.55f, 1.2f, 0.9f}, 0, Pattern::wood, 0.35f, {0.75f, 0.6f, 0.4f}, kWood));
  add_column(s, 1.6f, 4.5f, 0.16f, 0.4f, {0.3f, 0.35f, 0.6f});
  add_picture(s, {1.9f, -0.35f, 4.73f}, {0.6f, 0.4f, 0.03f}, 0.25f, {0.55f, 0.75f, 0.9f});
  add_picture(s, {0.07f, -0.3f, 2.6f}, {0.03f, 0.35f, 0.5f}, 0.11f, {0.8f, 0.6f, 0.25f});
  return s;
}

Solids meeting_room(std::uint64_t seed) {
  Solids s;
  const Vector3f color = tint(seed);
  add_table(s, 2.3f, 4.25f, 2.6f, 0.8f, color);
  for (const float x : {1.4f, 2.3f, 3.2f}) add_chair(s, x, 3.65f, color);
  add_picture(s, {3.93f, -0.25f, 2.2f}, {0.03f, 0.5f, 1.0f}, 0.3f, kWhite);
  add_column(s, 0.4f, 4.4f, 0.25f, 0.9f, tint(seed));
  add_ball(s, {0.4f, 0.2f, 4.4f}, 0.22f, {0.2f, 0.55f, 0.25f});
  return s;
}

Solids store_room(std::uint64_t seed) {
  Solids s;
  add_shelf(s, 3.77f, 1.5f, false, tint(seed));
  add_shelf(s, 3.77f, 3.0f, false, tint(seed));
  add_shelf(s, 1.4f, 4.57f, true, tint(seed));
  for (int i = 0; i < 4; ++i) {
    const float size = 0.35f + 0.05f * static_cast<float>(pick(seed, 5));
    s.push_back(box_on_floor(2.4f + 0.45f * static_cast<float>(i % 3), 4.3f - 0.1f * static_cast<float>(pick(seed, 3)),
                             {size, size, size}, i == 3 ? 0.6f : 0, Pattern::patches, 0.1f, tint(seed), tint(seed),
                             0.2f * static_cast<float>(i)));
  }
  s.push_back(box_on_floor(0.33f, 3.2f, {0.45f, 1.7f, 1.2f}, 0, Pattern::wood, 0.3f, kWood, kDark));
  return s;
}

Solids kitchen(std::uint64_t seed) {
  Solids s;
  const Vector3f front = tint(seed);
  s.push_back(box_on_floor(2.4f, 4.42f, {3.0f, 0.9f, 0.6f}, 0, Pattern::tiles, 0.5f, front, kGray));
  s.push_back(box_on_floor(2.4f, 4.55f, {3.0f, 0.6f, 0.35f}, 1.5f, Pattern::tiles, 0.5f, front, kGray));
  s.push_back(box_on_floor(0.45f, 4.3f, {0.6f, 1.8f, 0.65f}, 0, Pattern::plain, 0.1f, kWhite, kGray));
  s.push_back(box_on_floor(1.7f, 4.35f, {0.25f, 0.3f, 0.2f}, 0.9f, Pattern::patches, 0.05f, tint(seed), kWhite, 0.4f));
  add_column(s, 3.6f, 1.4f, 0.25f, 1.05f, kWood);
  add_picture(s, {0.07f, -0.3f, 2.6f}, {0.03f, 0.4f, 0.3f}, 0.09f, tint(seed));
  return s;
}

/// Adds two individual objects that distinguish a room from identical rooms.
void add_individual_objects(Solids& s, std::uint64_t seed) {
  const float scale = 0.06f + 0.01f * static_cast<float>(pick(seed, 8));
  const float up = -0.5f + 0.1f * static_cast<float>(pick(seed, 4));
  add_picture(s, {3.1f, up, 0.07f}, {0.2f + 0.05f * static_cast<float>(pick(seed, 5)), 0.25f, 0.03f}, scale,
              tint(seed));
  switch (pick(seed, 3)) {
    case 0:
      return add_ball(s, {3.5f, 1.1f, 0.5f}, 0.2f, tint(seed));
    case 1:
      return add_column(s, 3.55f, 0.5f, 0.18f, 0.6f, tint(seed));
    default:
      s.push_back(
          box_on_floor(3.5f, 0.5f, {0.4f, 0.35f, 0.3f}, 0, Pattern::patches, 0.07f, tint(seed), tint(seed), 0.5f));
  }
}

Solids furniture(int number) {
  std::uint64_t seed = mixed({1, number});
  const int kind = pick(seed, kRoomKinds);
  Solids s = kind < kSharedOffices ? office()
             : kind < 8            ? meeting_room(seed)
             : kind < 9            ? store_room(seed)
                                   : kitchen(seed);
  add_individual_objects(s, mixed({2, number}));
  return s;
}

/// Closed in its frame, or open against the wall.
Scene::Solid door_leaf(bool is_open, std::uint64_t how) {
  constexpr float kHalf = 0.43f, kHeight = 2.05f;
  const float degrees = is_open ? 90.0f + 2.0f * static_cast<float>(pick(how, 10)) : 0.0f;
  const float angle = degrees * std::numbers::pi_v<float> / 180;
  const float hinge_x = kDoorAt - kDoor / 2 + 0.02f, hinge_z = is_open ? kWall / 2 + 0.02f : 0;
  Scene::Solid leaf = box_on_floor(hinge_x + kHalf * std::cos(angle), hinge_z + kHalf * std::sin(angle),
                                   {2 * kHalf, kHeight, 0.04f}, 0, Pattern::wood, 0.4f, {0.65f, 0.55f, 0.42f}, kDark);
  leaf.yaw = angle;
  return leaf;
}

/// Walls to the corridor, to the left and to the outside, floor, and door plate on the corridor.
Solids shell(std::uint64_t seed) {
  Solids s;
  add_wall(s, {0, 0}, {kWidth, 0}, kDoorAt, kOfficePaper);
  add_wall(s, {0, 0}, {0, kDepth}, -1, kOfficePaper);
  add_wall(s, {0, kDepth}, {kWidth, kDepth}, -1, kOfficePaper);
  s.push_back(slab({0, 0}, {kWidth, kDepth}, kBelow, kSlab, kCarpet));
  add_picture(s, {1.55f, 0.0f, -0.06f}, {0.1f, 0.07f, 0.015f}, 0.04f, tint(seed));
  if (pick(seed, 2) == 0)
    add_picture(
        s, {2.6f, -0.3f, -0.06f},
        {0.3f + 0.08f * static_cast<float>(pick(seed, 5)), 0.3f + 0.04f * static_cast<float>(pick(seed, 4)), 0.02f},
        0.07f + 0.01f * static_cast<float>(pick(seed, 9)), tint(seed));
  else if (pick(seed, 3) == 0)
    s.push_back(box_on_floor(2.7f, -0.24f, {0.9f, 0.45f, 0.35f}, 0, Pattern::wood, 0.3f, kWood, kDark));
  return s;
}

/// Steps from the landing up to the landing of the storey above, x outwards.
Solids flights() {
  Solids s;
  const float run = kFlight / kSteps, rise = kStorey / 2 / kSteps;
  for (int i = 0; i < kSteps; ++i)
    for (const bool is_first : {true, false}) {
      const float up = rise * static_cast<float>(i + 1) + (is_first ? 0 : kStorey / 2);
      const float out = run * (static_cast<float>(i) + 0.5f);
      const float x = is_first ? kLanding + out : kLanding + kFlight - out, z = is_first ? 0.65f : -0.65f;
      s.push_back(box_on_floor(x, z, {run, 0.3f, 1.2f}, up - 0.3f, Pattern::tiles, 0.3f, kStone.color, kStone.second));
      if (i % 2 == 0)
        s.push_back(
            box_on_floor(x, z > 0 ? 0.07f : -0.07f, {0.05f, 0.9f, 0.05f}, up, Pattern::wood, 0.2f, kDark, kWood));
    }
  s.push_back(slab({kLanding + kFlight, -kHalfStairs}, {2 * kLanding + kFlight, kHalfStairs}, kBelow - kStorey / 2,
                   0.3f, kStone));
  add_picture(s, {2 * kLanding + kFlight - 0.07f, kBelow - kStorey / 2 - 1.5f, 0.4f}, {0.03f, 0.35f, 0.45f}, 0.1f,
              {0.8f, 0.3f, 0.2f});
  return s;
}

Solids stairwell(bool is_lowest, bool is_highest) {
  Solids s;
  const float outside = 2 * kLanding + kFlight;
  const auto wall = [&](const Vector3f& center, const Vector3f& half) {
    s.push_back({Shape::box, center, half, 0, Pattern::tiles, 0.4f, {0.74f, 0.72f, 0.64f}, {0.6f, 0.58f, 0.5f}});
  };
  const float middle = (kBelow + kCeiling) / 2 + kSlab / 2, half_height = kStorey / 2;  // through the slab below
  for (const float z : {-kHalfStairs, kHalfStairs})
    wall({outside / 2, middle, z}, {outside / 2 + kWall / 2, half_height, kWall / 2});
  wall({outside, middle, 0}, {kWall / 2, half_height, kHalfStairs});
  s.push_back(slab({0, -kHalfStairs}, {is_lowest ? outside : kLanding, kHalfStairs}, kBelow, kSlab, kStone));
  if (is_highest) {
    s.push_back(slab({0, -kHalfStairs}, {outside, kHalfStairs}, kCeiling - kSlab, kSlab, kStone));
    if (!is_lowest)  // rail at the top landing
      s.push_back(box_on_floor(kLanding, 0.68f, {0.06f, 1.0f, 1.2f}, 0, Pattern::wood, 0.2f, kDark, kWood));
  } else {
    const Solids up = flights();
    s.insert(s.end(), up.begin(), up.end());
  }
  return s;
}

Solids corridor(const Plan& plan, int storey) {
  Solids s;
  const float length = plan.length();
  s.push_back(slab({0, -kHalfCorridor}, {length, kHalfCorridor}, kBelow, kSlab, kStone));
  if (storey + 1 == plan.floors())
    s.push_back(slab({0, -kHalfCorridor - kDepth}, {length, kHalfCorridor + kDepth}, kCeiling - kSlab, kSlab,
                     {Pattern::tiles, 0.6f, kWhite, kGray}));
  for (int column = 0; column < plan.columns(); ++column)
    s.push_back({Shape::box,
                 {kWidth * (static_cast<float>(column) + 0.5f), kCeiling + 0.04f, 0},
                 {0.6f, 0.04f, 0.12f},
                 0,
                 Pattern::plain,
                 0.2f,
                 kWhite,
                 kGray});
  // Each room has only its left wall: add the right wall of the last rooms.
  add_wall(s, {length, kHalfCorridor}, {length, kHalfCorridor + kDepth}, -1, kOfficePaper);
  add_wall(s, {0, -kHalfCorridor}, {0, -kHalfCorridor - kDepth}, -1, kOfficePaper);
  return s;
}

/// A missing room is replaced by an empty closed room.
void add_room(Solids& s, const Plan& plan, int storey, int slot, const BuildingOptions& options,
              const std::set<int>& visited) {
  const Place place = Plan::place({storey, slot / 2, slot % 2});
  const bool is_missing = slot >= plan.rooms(storey);
  const int number = plan.first(storey) + slot;
  std::uint64_t how = mixed({5, options.recording, storey, slot});
  const bool is_open = !is_missing && (visited.contains(number) || pick(how, 100) >= kClosedDoors);
  add(s, shell(mixed({3, storey, slot})), place);
  if (!is_missing) add(s, furniture(number), place);
  add(s, {door_leaf(is_open, how)}, place);
}

/// Path of a person through rooms, along corridors and up and down stairs.
class Walk {
 public:
  Walk(const Plan& plan, const BuildingOptions& options) : plan_(plan), options_(options) {
    random_ = std::mt19937_64(mixed({4, options.recording}));
    // Distributes the starts of recordings over the building.
    room_ = static_cast<int>(static_cast<std::int64_t>(options.recording) * 7 % options.rooms);
    const Room first = plan.room(room_);
    storey_ = first.storey;
    x_ = Plan::door_x(first) < plan.length() / 2 ? Plan::door_x(first) + 1.5f : Plan::door_x(first) - 1.5f;
    go({x_, Plan::height(storey_), first.side == 0 ? -0.4f : 0.4f});
    go({x_, Plan::height(storey_), 0});
    visit(room_);
    while (meters_ < kPathLengthRatio * options.meters + 1) next();
  }
  [[nodiscard]] std::vector<Vector3d> path() const {
    std::vector<Vector3d> path = smooth(through_);
    path.resize(std::min(path.size(), static_cast<std::size_t>(options_.meters / 0.05)));
    return path;
  }
  [[nodiscard]] const std::set<int>& rooms() const { return rooms_; }

 private:
  int draw(int below) { return static_cast<int>(random_() % static_cast<std::uint64_t>(below)); }
  void go(const Vector3f& to) {
    if (!through_.empty()) meters_ += (to.cast<double>() - through_.back()).norm();
    through_.push_back(to.cast<double>());
  }
  void go_along_corridor(float x) {
    const int steps = std::max(1, static_cast<int>(std::round(std::abs(x - x_))));
    const float from = x_;
    for (int i = 1; i <= steps; ++i) {
      x_ = from + (x - from) * static_cast<float>(i) / static_cast<float>(steps);
      go({x_, Plan::height(storey_), 0.12f * static_cast<float>(draw(3) - 1)});
    }
  }
  void visit(int number) {
    const Room room = plan_.room(number);
    const Place place = Plan::place(room);
    const float door = Plan::door_x(room);
    go_along_corridor(door + (x_ < door ? -0.6f : 0.6f));
    for (const Vector2f& p : std::initializer_list<Vector2f>{{0.9f, -0.5f},
                                                             {0.9f, 0.5f},
                                                             {1.0f, 1.5f},
                                                             {1.3f, 2.5f},
                                                             {2.1f, 2.9f},
                                                             {2.8f, 2.3f},
                                                             {2.6f, 1.5f},
                                                             {1.8f, 1.1f},
                                                             {1.0f, 0.6f},
                                                             {0.9f, -0.4f}})
      go(place({p.x(), 0, p.y()}));
    x_ = door;
    room_ = number;
    rooms_.insert(number);
  }
  void take_stairs(int end, bool up) {
    go_along_corridor(end == 0 ? 0.6f : plan_.length() - 0.6f);
    const Place place = plan_.stairs(up ? storey_ : storey_ - 1, end);
    std::vector<Vector3f> upwards{{kLanding / 2, 0, 0.5f}};
    for (const float z : {0.65f, -0.65f}) {
      for (int i = 0; i <= 3; ++i) {
        const float share = static_cast<float>(i) / 3;
        const float x = kLanding + kFlight * (z > 0 ? share : 1 - share);
        upwards.push_back({x, -kStorey / 2 * (share + (z > 0 ? 0.0f : 1.0f)), z});
      }
      if (z > 0) upwards.push_back({1.55f * kLanding + kFlight, -kStorey / 2, 0});
    }
    upwards.push_back({kLanding / 2, -kStorey, -0.5f});
    if (!up) std::reverse(upwards.begin(), upwards.end());
    for (const Vector3f& p : upwards) go(place(p));
    storey_ += up ? 1 : -1;
    x_ = end == 0 ? 0.0f : plan_.length();
  }
  /// Moves to another room nearby, or sometimes to another storey.
  void next() {
    constexpr int kStairsOf = 6;  // mean number of moves per storey change
    if (options_.floors > 1 && draw(kStairsOf) == 0)
      take_stairs(x_ < plan_.length() / 2 ? 0 : 1, storey_ == 0 || (storey_ + 1 < options_.floors && draw(2) == 0));
    std::vector<int> near;
    for (int reach = 2; near.empty(); ++reach)
      for (int slot = 0; slot < plan_.rooms(storey_); ++slot) {
        const int number = plan_.first(storey_) + slot;
        if ((number != room_ || plan_.rooms(storey_) == 1) &&
            std::abs(Plan::door_x(plan_.room(number)) - x_) < kWidth * static_cast<float>(reach))
          near.push_back(number);
      }
    visit(near[static_cast<std::size_t>(draw(static_cast<int>(near.size())))]);
  }

  const Plan& plan_;
  const BuildingOptions& options_;
  std::mt19937_64 random_;
  std::vector<Vector3d> through_;
  std::set<int> rooms_;
  int room_ = 0, storey_ = 0;
  float x_ = 0;
  double meters_ = 0;
};

double number_of(std::string_view key, std::string_view text, double min, double max) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !(value >= min && value <= max))
    throw std::runtime_error(
        fmt::format("synthetic building: {} is {}: give a number from {} to {}", key, text, min, max));
  return value;
}

}  // namespace

BuildingOptions building_options(std::string_view query) {
  BuildingOptions options;
  while (!query.empty()) {
    const std::string_view part = query.substr(0, query.find('&'));
    query.remove_prefix(std::min(query.size(), part.size() + 1));
    const std::string_view key = part.substr(0, part.find('='));
    const std::string_view value = key.size() < part.size() ? part.substr(key.size() + 1) : std::string_view();
    if (key == "floors")
      options.floors = static_cast<int>(number_of(key, value, 1, 100));
    else if (key == "rooms")
      options.rooms = static_cast<int>(number_of(key, value, 1, 10000));
    else if (key == "recording")
      options.recording = static_cast<int>(number_of(key, value, 0, 1000000));
    else if (key == "meters" || key == "metres")  // the name before version 0.2
      options.meters = number_of(key, value, 1, 100000);
    else
      throw std::runtime_error(
          fmt::format("synthetic building: unknown option '{}': choose floors, rooms, recording or meters", key));
  }
  if (options.rooms < options.floors)
    throw std::runtime_error(
        fmt::format("synthetic building: {} rooms are too few for {} floors: give at least one room per floor",
                    options.rooms, options.floors));
  return options;
}

Scene building(const BuildingOptions& options) {
  const Plan plan(options);
  const Walk walk(plan, options);
  Scene scene{.name = "building", .solids = {}, .path = walk.path()};
  scene.hand = 1 + static_cast<std::uint64_t>(options.recording);
  for (int storey = 0; storey < options.floors; ++storey) {
    add(scene.solids, corridor(plan, storey), {{0, Plan::height(storey), 0}});
    for (const int end : {0, 1})
      add(scene.solids, stairwell(storey == 0, storey + 1 == options.floors), plan.stairs(storey, end));
    for (int slot = 0; slot < 2 * plan.columns(); ++slot)
      add_room(scene.solids, plan, storey, slot, options, walk.rooms());
  }
  return scene;
}

}  // namespace cairn
