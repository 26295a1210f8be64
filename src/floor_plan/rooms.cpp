// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "floor_plan/storey_plan.hpp"

namespace cairn::plan {
namespace {

constexpr double kMaxJamb = 0.6;                  // meters of a wall's end, at most
constexpr double kMinDoor = 0.5, kMaxDoor = 1.6;  // meters of a door
constexpr double kMaxDoorShift = 0.1;             // meters between the middles of a door found from both jambs
constexpr double kMaxFacingCosine = -0.9;         // cosine between the normals of the door's two jambs, at most
constexpr double kMinRoomArea = 1.0;              // m2
constexpr double kMinClosedRatio = 0.95;          // share of wall or door in a room's rim

}  // namespace

std::vector<Segment> doors_between(const Grid& grid, const Mask& solid, const SegmentIndex& sides) {
  const auto is_jamb = [&](const Segment& side) {
    const cv::Point inside = grid.cell_of((side.a + side.b) / 2 - 3 * grid.cell * normal_of(side));
    return (side.b - side.a).norm() <= kMaxJamb && grid.contains(inside) && solid(inside) != 0;
  };
  std::vector<Segment> doors;
  for (std::size_t i = 0; i < sides.all().size(); ++i) {
    const Segment& jamb = sides.all()[i];
    if (!is_jamb(jamb)) continue;
    const Point from = (jamb.a + jamb.b) / 2;
    const auto hit = sides.first(from, normal_of(jamb), kMaxDoor, i);
    if (!hit || hit->distance < kMinDoor) continue;
    const Segment& other = sides.all()[hit->side];
    if (normal_of(other).dot(normal_of(jamb)) >= kMaxFacingCosine || !is_jamb(other)) continue;
    const Segment door{from, from + hit->distance * normal_of(jamb)};
    const auto is_same = [&](const Segment& d) { return (d.a + d.b - door.a - door.b).norm() < 2 * kMaxDoorShift; };
    if (std::none_of(doors.begin(), doors.end(), is_same)) doors.push_back(door);  // each jamb finds the door
  }
  return doors;
}

std::vector<Room> rooms_in(const Grid& grid, const Mask& open, const Mask& walls, const std::vector<Segment>& doors) {
  Mask closed = walls.clone();
  for (const Segment& door : doors) cv::line(closed, grid.cell_of(door.a), grid.cell_of(door.b), 255);
  const Mask rooms = open & ~closed;
  cv::Mat1i labels, stats;
  cv::Mat1d middles;
  const int count = cv::connectedComponentsWithStats(rooms, labels, stats, middles, 4);
  std::vector<Room> found;
  for (int i = 1; i < count; ++i) {
    const double area = stats(i, cv::CC_STAT_AREA) * grid.cell * grid.cell;
    if (area < kMinRoomArea) continue;
    const cv::Rect box(stats(i, cv::CC_STAT_LEFT) - 1, stats(i, cv::CC_STAT_TOP) - 1, stats(i, cv::CC_STAT_WIDTH) + 2,
                       stats(i, cv::CC_STAT_HEIGHT) + 2);  // margins are empty
    const Mask room = labels(box) == i;
    Mask rim;
    cv::dilate(room, rim, cv::getStructuringElement(cv::MORPH_CROSS, {3, 3}));
    rim &= ~room;
    const int all = cv::countNonZero(rim), wall = cv::countNonZero(rim & closed(box));
    if (wall < kMinClosedRatio * all) continue;
    cv::Mat1f inside;
    cv::distanceTransform(room, inside, cv::DIST_L2, 5);
    cv::Point middle;
    cv::minMaxLoc(inside, nullptr, nullptr, nullptr, &middle);
    Mask outline = grid.mask();
    outline(box) |= room | rim;
    // A wall's line is in the middle of its cells.
    found.push_back({.middle = grid.center(middle + box.tl()),
                     .area = area + 0.5 * wall * grid.cell * grid.cell,
                     .outline = polygons_of(grid, outline, Edges::straight).front()});
  }
  return found;
}

}  // namespace cairn::plan
