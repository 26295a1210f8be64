// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "floor_plan/layout.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <numbers>
#include <optional>
#include <utility>

#include "floor_plan/storeys.hpp"

namespace cairn::plan {
namespace {

constexpr double kMargin = 10, kRuler = 14;  // mm: of the page, and beside the plan
constexpr Color kBlack = 0x000000, kPaper = 0xffffff, kWall = 0x4a4a4a, kFloor = 0xf4ecdc, kFurniture = 0xe2d8c6,
                kEdge = 0xa89c88, kUnseen = 0x8c8c8c, kUnobserved = 0xf6cfd9, kPath = 0xc1443c, kFine = 0x606060,
                kGridLine = 0xd6d2ca, kLoop = 0x707070, kLoopBetween = 0xd55e00, kAlarm = 0xb00020;
// Colors of several recordings, distinguishable with color blindness (Okabe & Ito 2008).
constexpr std::array<Color, 5> kPaths{0x0072b2, 0xe69f00, 0x009e73, 0xcc79a7, 0x56b4e9};
constexpr double kLegendRow = 5;       // mm
constexpr double kDefaultFooter = 30;  // mm, with two rows of the legend
constexpr int kDefaultRows = 2;

struct Paper {
  std::string name;
  double shorter = 0, longer = 0;  // mm
};
const std::array<Paper, 5> kPapers{
    {{"A4", 210, 297}, {"A3", 297, 420}, {"A2", 420, 594}, {"A1", 594, 841}, {"A0", 841, 1189}}};

/// Size of a plan on the paper. `footer`: mm below the plan.
Point size_of(const Box& box, int scale, double footer) {
  return box.sizes() * (1000.0 / scale) + Point(2 * (kMargin + kRuler), 2 * (kMargin + kRuler) + footer);
}

/// First of the papers with room for a plan, with its size in the plan's orientation.
std::optional<std::pair<std::string, Point>> paper_for(const Point& size, std::size_t papers) {
  for (std::size_t i = 0; i < papers; ++i) {
    const Paper& p = kPapers[i];
    if (size.x() <= p.longer && size.y() <= p.shorter) return {{p.name, {p.longer, p.shorter}}};
    if (size.x() <= p.shorter && size.y() <= p.longer) return {{p.name, {p.shorter, p.longer}}};
  }
  return std::nullopt;
}

struct Page {
  int scale = 0;
  std::string paper;
  Point size = Point::Zero();  // mm
  double footer = kDefaultFooter;
};

Page page_for(const Box& box, int scale, double footer) {
  constexpr std::size_t kPapersToA3 = 2, kAll = kPapers.size();
  const std::array<std::pair<int, std::size_t>, 4> standard{{{50, kPapersToA3}, {100, kAll}, {200, kAll}, {500, kAll}}};
  for (const auto& [s, papers] : standard)
    if (scale == 0)
      if (const auto paper = paper_for(size_of(box, s, footer), papers))
        return {s, paper->first, paper->second, footer};
  const int chosen = scale > 0 ? scale : standard.back().first;
  if (const auto paper = paper_for(size_of(box, chosen, footer), kAll))
    return {chosen, paper->first, paper->second, footer};
  return {chosen, "", size_of(box, chosen, footer).array().ceil().matrix(), footer};
}

/// Transform from meters of the plan to millimeters of the page.
class Drawing {
 public:
  Drawing(const Box& box, double angle, const Page& page)
      : box_(box), turn_(Eigen::Rotation2Dd(-angle)), scale_(1000.0 / page.scale) {
    const Point size = size_of(box, page.scale, page.footer);
    origin_ = Point(kMargin + kRuler, page.size.y() - kMargin - kRuler - page.footer) +
              Point(page.size.x() - size.x(), size.y() - page.size.y()) / 2;
  }
  /// Transforms a point of the rotated plan.
  [[nodiscard]] Point of_turned(const Point& p) const {
    return origin_ + scale_ * Point(p.x() - box_.min().x(), box_.min().y() - p.y());
  }
  [[nodiscard]] Point operator()(const Point& p) const { return of_turned(turn_ * p); }
  [[nodiscard]] Shape operator()(const Area& area) const {
    Shape shape;
    for (const auto& ring : area) shape.rings.push_back(all_of(ring));
    return shape;
  }
  [[nodiscard]] Shape operator()(const Polyline& line) const { return {{all_of(line.points)}, line.closed}; }
  [[nodiscard]] const Box& box() const { return box_; }
  [[nodiscard]] double mm(double meters) const { return scale_ * meters; }

 private:
  [[nodiscard]] std::vector<Point> all_of(const std::vector<Point>& points) const {
    std::vector<Point> drawn;
    drawn.reserve(points.size());
    for (const Point& p : points) drawn.push_back((*this)(p));
    return drawn;
  }
  Box box_;
  Eigen::Rotation2Dd turn_;
  double scale_;  // mm per meter
  Point origin_;  // of the box's lower left corner on the page
};

/// Rotation of the plans in radians: aligns most walls with the paper's edges.
double turned_by(const std::vector<StoreyPlan>& storeys) {
  constexpr double kMinWallRatio = 0.25;  // minimum share of the walls' length
  const auto& walls = std::max_element(storeys.begin(), storeys.end(), [](const auto& a, const auto& b) {
                        return a.walls.share * a.walls.length < b.walls.share * b.walls.length;
                      })->walls;
  return walls.share < kMinWallRatio ? 0 : std::remainder(walls.direction, std::numbers::pi / 2);
}

/// Bounding box of all drawn parts, rotated.
Box extent_of(const std::vector<StoreyPlan>& storeys, const std::vector<Trajectory>& paths, double angle) {
  constexpr double kMinDistance = 0.05;  // meters
  const Eigen::Rotation2Dd turn(-angle);
  Box walls;
  for (const StoreyPlan& storey : storeys)
    for (const Polyline& line : storey.walls.lines)
      for (const Point& p : line.points) walls.extend(Point(turn * p));
  Box box = walls;  // areas that end at the walls, up to a cell or two, do not enlarge it
  const auto extend = [&](const Point& p) {
    if (walls.exteriorDistance(Point(turn * p)) > kMinDistance) box.extend(Point(turn * p));
  };
  for (const StoreyPlan& storey : storeys) {
    for (const auto* areas : {&storey.floors, &storey.furniture})
      for (const Area& area : *areas) std::for_each(area.front().begin(), area.front().end(), extend);
  }
  for (const Trajectory& path : paths)
    for (const StampedPose& pose : path)
      extend({pose.world_from_camera.translation().x(), pose.world_from_camera.translation().z()});
  return box;
}

/// Spacing of meter marks, at least `min_mm` on the paper.
double step_of(double mm_a_meter, double min_mm) {
  for (const double step : {0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0})
    if (step * mm_a_meter >= min_mm) return step;
  return 100;
}

/// 0, and all multiples of a step up to `last`.
std::vector<double> up_to(double last, double step) {
  std::vector<double> places(1 + static_cast<std::size_t>(last / step));
  for (std::size_t i = 0; i < places.size(); ++i) places[i] = static_cast<double>(i) * step;
  return places;
}

Shape line(const Point& a, const Point& b) { return {{{a, b}}, false}; }
Shape rectangle(const Point& a, const Point& b) { return {{{a, {b.x(), a.y()}, b, {a.x(), b.y()}}}, true}; }

/// Grid lines at a spacing of a meter or more.
Layer grid_of(const Drawing& drawing) {
  Layer layer{.name = "Grid", .style = {.stroke = kGridLine, .width = 0.1}, .is_of_page = true};
  const Box& box = drawing.box();
  const double step = std::max(1.0, step_of(drawing.mm(1), 8));
  for (const double x : up_to(box.sizes().x(), step))
    layer.shapes.push_back(line(drawing.of_turned({box.min().x() + x, box.min().y()}),
                                drawing.of_turned({box.min().x() + x, box.max().y()})));
  for (const double y : up_to(box.sizes().y(), step))
    layer.shapes.push_back(line(drawing.of_turned({box.min().x(), box.min().y() + y}),
                                drawing.of_turned({box.max().x(), box.min().y() + y})));
  return layer;
}

/// Rulers in meters from the plan's lower left corner along its lower and left edges, and its extent along the other
/// edges.
Layer rulers_of(const Drawing& drawing) {
  constexpr double kRulerDistance = 5, kTick = 1.5, kTickOverlap = 0.7;  // mm
  Layer layer{.name = "Dimensions", .style = {.stroke = kFine, .width = 0.15}};
  const Point low = drawing.of_turned(drawing.box().min()), high = drawing.of_turned(drawing.box().max());
  const double bottom = low.y() + kRulerDistance, left = low.x() - kRulerDistance, top = high.y() - kRulerDistance,
               right = high.x() + kRulerDistance;
  layer.shapes.push_back(line({low.x(), bottom}, {high.x(), bottom}));
  layer.shapes.push_back(line({left, low.y()}, {left, high.y()}));
  const double step = step_of(drawing.mm(1), 8);
  for (const double m : up_to(drawing.box().sizes().x(), step)) {
    const double x = low.x() + drawing.mm(m);
    layer.shapes.push_back(line({x, bottom}, {x, bottom + kTick}));
    layer.labels.push_back({.at = {x, bottom + kTick + 2.6}, .text = fmt::format("{}", m), .align = Align::middle});
  }
  for (const double m : up_to(drawing.box().sizes().y(), step)) {
    const double y = low.y() - drawing.mm(m);
    layer.shapes.push_back(line({left, y}, {left - kTick, y}));
    layer.labels.push_back({.at = {left - kTick - 0.8, y + 0.9}, .text = fmt::format("{}", m), .align = Align::right});
  }
  layer.shapes.push_back(line({low.x(), top}, {high.x(), top}));
  layer.shapes.push_back(line({right, low.y()}, {right, high.y()}));
  const auto end = [&](const Point& p) {
    layer.shapes.push_back(line(p + Point(-kTickOverlap, kTickOverlap), p - Point(-kTickOverlap, kTickOverlap)));
  };
  for (const Point& p : {Point(low.x(), top), Point(high.x(), top), Point(right, low.y()), Point(right, high.y())})
    end(p);
  layer.labels.push_back({.at = {(low.x() + high.x()) / 2, top - 1.2},
                          .text = fmt::format("{:.2f} m", drawing.box().sizes().x()),
                          .size = 3,
                          .align = Align::middle});
  layer.labels.push_back({.at = {right + 3.4, (low.y() + high.y()) / 2},
                          .text = fmt::format("{:.2f} m", drawing.box().sizes().y()),
                          .size = 3,
                          .align = Align::middle,
                          .upwards = true});
  return layer;
}

/// Range of heights from a storey's floor to the next.
struct Heights {
  double low = 0, high = 0;  // meters
  [[nodiscard]] bool contains(double height) const { return height > low && height <= high; }
};

/// Parts of a path over a storey.
Layer path_of(const Drawing& drawing, const std::string& name, const Style& style, const Trajectory& path,
              const Heights& storey) {
  constexpr double kMaxPathError = 0.02;  // meters: error of a simplified path
  Layer layer{.name = name, .style = style};
  Polyline part;
  const auto end = [&] {
    if (part.points.size() > 1) layer.shapes.push_back(drawing(simplified(part, kMaxPathError)));
    part.points.clear();
  };
  for (const StampedPose& pose : path) {
    const Eigen::Vector3d p = pose.world_from_camera.translation();
    if (storey.contains(height_of(p)))
      part.points.emplace_back(p.x(), p.z());
    else
      end();
  }
  end();
  return layer;
}

/// Loops of a storey; a loop between two storeys belongs to the lower.
Layer loops_of(const Drawing& drawing, const std::string& name, const Style& style, const std::vector<LoopLine>& loops,
               const Heights& storey, bool are_between) {
  Layer layer{.name = name, .style = style};
  for (const LoopLine& loop : loops)
    if (loop.is_between == are_between && storey.contains(std::min(height_of(loop.from), height_of(loop.to))))
      layer.shapes.push_back(line(drawing({loop.from.x(), loop.from.z()}), drawing({loop.to.x(), loop.to.z()})));
  return layer;
}

Layer areas_of(const Drawing& drawing, const char* name, const Style& style, const std::vector<Area>& areas) {
  Layer layer{.name = name, .style = style};
  for (const Area& area : areas) layer.shapes.push_back(drawing(area));
  return layer;
}

Layer rooms_of(const Drawing& drawing, const StoreyPlan& storey) {
  Layer layer{.name = "Rooms"};
  for (const Room& room : storey.rooms)
    layer.labels.push_back({.at = drawing(room.middle) + Point(0, 1.2),
                            .text = fmt::format("{:.1f} m²", room.area),
                            .size = 3.5,
                            .align = Align::middle});
  return layer;
}

/// Scale bar of full meters, alternately filled, with its right end at `right`.
void add_scale_bar(const Page& page, const Point& right, std::vector<Layer>& layers) {
  constexpr double kHigh = 1.6, kMinSection = 10, kUnit = 3;  // mm; the unit after the last number exceeds the bar
  constexpr int kSections = 5;
  const double mm = 1000.0 / page.scale, step = std::max(1.0, step_of(mm, kMinSection));
  const Point at = right - Point(kSections * step * mm + kUnit, 0);
  Layer dark{.name = "Scale bar", .style = {.fill = kBlack}, .is_of_page = true};
  Layer frame{.name = "Scale bar, frame", .style = {.stroke = kBlack, .width = 0.15}, .is_of_page = true};
  for (int i = 0; i <= kSections; ++i) {
    const Point corner = at + Point(i * step * mm, 0);
    frame.labels.push_back({.at = corner - Point(0, 1),
                            .text = fmt::format("{}{}", i * step, i == kSections ? " m" : ""),
                            .align = Align::middle});
    if (i < kSections && i % 2 == 0) dark.shapes.push_back(rectangle(corner, corner + Point(step * mm, kHigh)));
  }
  frame.shapes.push_back(rectangle(at, at + Point(kSections * step * mm, kHigh)));
  layers.push_back(std::move(dark));
  layers.push_back(std::move(frame));
}

struct LegendEntry {
  std::string text;
  Style style;
  bool is_line = false;
};

/// Calls `place(meaning, at)` with the position of each legend entry, starting at `at`; returns the number of rows
/// filled up to `right`.
template <class Place>
int lay_out_legend(const std::vector<LegendEntry>& entries, Point at, double right, const Place& place) {
  constexpr double kEntrySpacing = 12.5, kLetterWidth = 1.42;  // mm
  const double left = at.x();
  int rows = 1;
  for (const LegendEntry& m : entries) {
    const double width = kEntrySpacing + kLetterWidth * static_cast<double>(m.text.size());
    if (at.x() + width > right && at.x() > left) at = {left, at.y() + kLegendRow}, ++rows;
    place(m, at);
    at.x() += width;
  }
  return rows;
}

void add_legend(const std::vector<LegendEntry>& entries, const Point& first, double right, std::vector<Layer>& layers) {
  constexpr double kBox = 6, kHigh = 3.2;  // mm
  lay_out_legend(entries, first, right, [&](const LegendEntry& m, const Point& at) {
    Layer layer{.name = fmt::format("Legend: {}", m.text), .style = m.style, .is_of_page = true};
    layer.shapes.push_back(m.is_line ? line(at + Point(0, kHigh / 2), at + Point(kBox, kHigh / 2))
                                     : rectangle(at, at + Point(kBox, kHigh)));
    layer.labels.push_back({.at = at + Point(kBox + 1.5, 2.5), .text = m.text});
    layers.push_back(std::move(layer));
  });
}

/// UTC date of the earliest path, if its clock counts from 1970.
std::string date_of(const std::vector<Trajectory>& paths) {
  constexpr double kClock = 946684800;  // seconds from 1970 to 2000: smaller stamps count from an arbitrary start
  double first = 0;
  for (const Trajectory& path : paths)
    if (!path.empty() && (first == 0 || path.front().timestamp < first)) first = path.front().timestamp;
  if (first < kClock) return "";
  const auto seconds = static_cast<std::time_t>(first);
  std::tm day{};
  gmtime_r(&seconds, &day);
  return fmt::format("{:04}-{:02}-{:02}", day.tm_year + 1900, day.tm_mon + 1, day.tm_mday);
}

/// Data shared by all pages of a plan.
struct Plan {
  const std::vector<StoreyPlan>& storeys;
  const std::vector<Trajectory>& paths;
  const std::vector<LoopLine>& loops;
  const PlanOptions& options;
  Page page;
  Drawing drawing;
};

const Style kSolidStyle{.fill = kWall}, kFaceStyle{.stroke = kBlack, .width = 0.3}, kFloorStyle{.fill = kFloor},
    kFurnitureStyle{.fill = kFurniture, .stroke = kEdge, .width = 0.1}, kUnseenStyle{.hatch = kUnseen},
    kDoorStyle{.stroke = kFine, .width = 0.15, .dashed = true}, kUnobservedStyle{.fill = kUnobserved, .hatch = kUnseen},
    kLoopStyle{.stroke = kLoop, .width = 0.13}, kLoopBetweenStyle{.stroke = kLoopBetween, .width = 0.2};

Style path_style(std::size_t recording, std::size_t recordings) {
  if (recordings < 2) return {.stroke = kPath, .width = 0.2, .dashed = true};
  return {.stroke = kPaths[recording % kPaths.size()], .width = 0.35, .dashed = true};
}

std::string name_of(const PlanOptions& options, std::size_t recording) {
  return recording < options.recordings.size() && !options.recordings[recording].empty()
             ? options.recordings[recording]
             : fmt::format("recording {}", recording);
}

Layer doors_of(const Drawing& drawing, const StoreyPlan& storey) {
  constexpr double kSize = 2, kDistance = 0.8;  // mm
  Layer layer{.name = "Doors", .style = kDoorStyle};
  for (const Segment& door : storey.doors) {
    const Point a = drawing(door.a), b = drawing(door.b), along = (b - a).cwiseAbs();
    const bool is_upwards = along.y() > along.x();
    layer.shapes.push_back(line(a, b));
    layer.labels.push_back({.at = (a + b) / 2 - (is_upwards ? Point(kDistance, 0) : Point(0, kDistance)),
                            .text = fmt::format("{:.2f}", (door.b - door.a).norm()),
                            .size = kSize,
                            .align = Align::middle,
                            .upwards = is_upwards});
  }
  return layer;
}

/// Draws the camera's paths and loops on a storey.
void add_paths(const Plan& plan, std::size_t i, std::vector<Layer>& layers, std::vector<LegendEntry>& entries) {
  const double infinity = std::numeric_limits<double>::infinity();
  const Heights storey{plan.storeys[i].floor, i + 1 < plan.storeys.size() ? plan.storeys[i + 1].floor : infinity};
  const std::size_t recordings = plan.paths.size();
  if (plan.options.loops) {  // below the paths
    layers.push_back(loops_of(plan.drawing, "Loops", kLoopStyle, plan.loops, storey, false));
    entries.push_back({"the same place, within a recording", kLoopStyle, true});
  }
  if (plan.options.loops && recordings > 1) {
    layers.push_back(loops_of(plan.drawing, "Loops between recordings", kLoopBetweenStyle, plan.loops, storey, true));
    entries.push_back({"the same place, of two recordings", kLoopBetweenStyle, true});
  }
  for (std::size_t r = 0; plan.options.path && r < recordings; ++r) {
    const Style style = path_style(r, recordings);
    const std::string name = recordings > 1 ? ": " + name_of(plan.options, r) : "";
    Layer layer = path_of(plan.drawing, "Path of the camera" + name, style, plan.paths[r], storey);
    if (layer.shapes.empty() && recordings > 1) continue;  // not on this storey
    entries.push_back({recordings > 1 ? "path: " + name_of(plan.options, r) : "path of the camera", style, true});
    layers.push_back(std::move(layer));
  }
}

/// Layers of the drawing; adds the meanings of its parts to the legend.
std::vector<Layer> layers_of(const Plan& plan, std::size_t i, std::vector<LegendEntry>& entries) {
  const StoreyPlan& storey = plan.storeys[i];
  const Drawing& drawing = plan.drawing;
  std::vector<Layer> layers{areas_of(drawing, "Floor", kFloorStyle, storey.floors), grid_of(drawing)};
  if (!storey.solid.empty())
    entries.push_back({"wall or object, cut, both faces seen", {.fill = kWall, .stroke = kBlack, .width = 0.3}});
  entries.push_back({"one face seen", kFaceStyle, true});
  if (!storey.furniture.empty()) {
    layers.push_back(areas_of(drawing, "Furniture", kFurnitureStyle, storey.furniture));
    entries.push_back({"lower than the cut", kFurnitureStyle});
  }
  entries.push_back({"floor seen", kFloorStyle});
  entries.push_back({"floor not seen", {.fill = kPaper, .stroke = kEdge, .width = 0.1}});
  if (plan.options.coverage) {
    layers.push_back(areas_of(drawing, "Not looked at", kUnobservedStyle, storey.unseen));
    entries.push_back(
        {fmt::format("not observed: {:.1f} m², {:.1f} %", storey.unobserved_area, 100 * storey.unobserved_share),
         {.fill = kUnobserved, .hatch = kUnseen, .stroke = kUnseen, .width = 0.1}});
  } else if (!storey.unseen.empty()) {
    layers.push_back(areas_of(drawing, "Not seen", kUnseenStyle, storey.unseen));
    entries.push_back({"nothing seen", {.hatch = kUnseen, .stroke = kUnseen, .width = 0.1}});
  }
  layers.push_back(areas_of(drawing, "Walls, solid", kSolidStyle, storey.solid));
  Layer& faces = layers.emplace_back(Layer{.name = "Walls, faces", .style = kFaceStyle});
  for (const Polyline& l : storey.walls.lines) faces.shapes.push_back(drawing(l));
  add_paths(plan, i, layers, entries);
  if (!storey.doors.empty()) {
    layers.push_back(doors_of(drawing, storey));
    entries.push_back({"opening, width in m", kDoorStyle, true});
  }
  if (!storey.rooms.empty()) layers.push_back(rooms_of(drawing, storey));
  layers.push_back(rulers_of(drawing));
  return layers;
}

/// Title, date, storey, drawing parameters, and agreement with the map.
Layer title_of(const Plan& plan, std::size_t i, const std::string& title, const Point& at) {
  const StoreyPlan& storey = plan.storeys[i];
  std::string line;
  if (plan.storeys.size() > 1)
    line = fmt::format("Storey {} of {}, floor at {:+.2f} m · ", i + 1, plan.storeys.size(),
                       storey.floor - plan.storeys.front().floor);
  line += fmt::format("cut {:.2f} m above the floor · ", plan.options.height);
  if (const std::string date = date_of(plan.paths); !date.empty()) line += fmt::format("recorded {} (UTC) · ", date);
  line += fmt::format("1:{}{}", plan.page.scale, plan.page.paper.empty() ? "" : " on " + plan.page.paper);
  return {.name = "Title",
          .labels = {{.at = at, .text = title, .size = 5, .bold = true},
                     {.at = at + Point(0, 5.5), .text = line, .size = 3},
                     {.at = at + Point(0, 9.5),
                      .text = fmt::format(
                          "Lines are {:.0f} mm from the map's surface on the mean, 95 % of it within {:.0f} mm",
                          1e3 * storey.walls.mean_off, 1e3 * storey.walls.p95_off)}}};
}

/// Recordings absent from the map, above the drawing: as many names as the page has room for.
Layer missing_of(const Plan& plan) {
  constexpr double kSize = 3.5, kLetterWidth = 2.1;  // mm
  const auto& missing = plan.options.missing;
  std::string text = fmt::format("Not in this map, whole or in part: {} of {} recordings", missing.size(),
                                 std::max(plan.options.recordings.size(), missing.size()));
  const double room = (plan.page.size.x() - 2 * kMargin) / kLetterWidth;
  std::size_t named = 0;
  for (const std::string& name : missing) {
    if (static_cast<double>(text.size() + name.size() + 6) > room) break;
    text += (named++ == 0 ? ": " : ", ") + name;
  }
  if (named > 0 && named < missing.size()) text += ", …";
  return {.name = "Missing",
          .labels = {{.at = {kMargin, kMargin}, .text = text, .size = kSize, .bold = true, .color = kAlarm}}};
}

constexpr double kLegendBelow = 12.5, kTitleBelow = 6;  // mm

/// Additional height of the largest legend below the usual two rows.
double additional_footer(const Plan& plan) {
  int rows = kDefaultRows;
  for (std::size_t i = 0; i < plan.storeys.size(); ++i) {
    std::vector<LegendEntry> entries;
    (void)layers_of(plan, i, entries);
    rows = std::max(rows, lay_out_legend(entries, {kMargin, 0}, plan.page.size.x() - kMargin, [](auto...) {}));
  }
  return kLegendRow * (rows - kDefaultRows);
}

Sheet sheet_of(const Plan& plan, std::size_t i) {
  const Page& page = plan.page;
  const std::string title = plan.options.title.empty() ? "Floor plan" : plan.options.title;
  std::vector<LegendEntry> entries;
  Sheet sheet{.width = page.size.x(), .height = page.size.y(), .title = title, .layers = layers_of(plan, i, entries)};
  const Point at(kMargin, page.size.y() - kMargin - page.footer + kTitleBelow);
  const double right = page.size.x() - kMargin;
  sheet.layers.push_back(title_of(plan, i, title, at));
  if (!plan.options.missing.empty()) sheet.layers.push_back(missing_of(plan));
  add_scale_bar(page, {right, at.y()}, sheet.layers);
  add_legend(entries, at + Point(0, kLegendBelow), right, sheet.layers);
  return sheet;
}

std::size_t shapes_in(const Sheet& sheet, const char* layer) {
  const auto found =
      std::find_if(sheet.layers.begin(), sheet.layers.end(), [&](const Layer& l) { return l.name == layer; });
  return found == sheet.layers.end() ? 0 : found->shapes.size();
}

}  // namespace

Pages laid_out(const std::vector<StoreyPlan>& storeys, const std::vector<Trajectory>& paths,
               const std::vector<LoopLine>& loops, const PlanOptions& options) {
  const double angle = turned_by(storeys);
  const Box box = extent_of(storeys, options.path || options.loops ? paths : std::vector<Trajectory>{}, angle);
  const auto plan_on = [&](const Page& page) {
    return Plan{storeys, paths, loops, options, page, Drawing(box, angle, page)};
  };
  Page page = page_for(box, options.scale, kDefaultFooter);
  if (const double more = additional_footer(plan_on(page)); more > 0)
    page = page_for(box, options.scale, kDefaultFooter + more);
  const Plan plan = plan_on(page);
  Pages pages{.sheets = {}, .scale = page.scale, .paper = page.paper};
  for (std::size_t i = 0; i < storeys.size(); ++i) {
    const Sheet& sheet = pages.sheets.emplace_back(sheet_of(plan, i));
    const auto between = static_cast<int>(shapes_in(sheet, "Loops between recordings"));
    pages.loops += static_cast<int>(shapes_in(sheet, "Loops")) + between;
    pages.loops_between += between;
  }
  return pages;
}

}  // namespace cairn::plan
