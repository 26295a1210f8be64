// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "floor_plan/ifc.hpp"

#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <utility>

#include "floor_plan/code_points.hpp"
#include "floor_plan/walls.hpp"

namespace cairn::plan {
namespace {

constexpr double kDoorHeight = 2.0;     // meters: nominal, since the cut is below the lintel
constexpr double kMinLintel = 0.1;      // meters above a door, at least
constexpr double kSlabThickness = 0.1;  // meters, nominal

/// Identifier of an instance: 128 bits as 22 digits, from its text (FNV-1a with two offsets).
std::string global_id(const std::string& of) {
  constexpr const char* kDigits = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_$";
  std::array<std::uint64_t, 2> hash{0xcbf29ce484222325u, 0x84222325cbf29ce4u};
  for (const char c : of)
    for (std::uint64_t& h : hash) h = (h ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  std::string id(1, kDigits[hash[0] >> 62]);
  for (int digit = 9; digit >= 0; --digit) id += kDigits[hash[0] >> 6 * digit & 63];
  for (int digit = 10; digit >= 0; --digit) id += kDigits[hash[1] >> 6 * digit & 63];
  return id;
}

/// String of STEP: other characters than ASCII as UTF-16 in hexadecimal.
std::string step_text(const std::string& text) {
  std::string out = "'";
  for (const char32_t code : code_points(text)) {
    const auto number = static_cast<std::uint32_t>(code);
    if (code == '\'' || code == '\\') out += static_cast<char>(code);  // doubled
    if (code < 0x80)
      out += static_cast<char>(code);
    else
      out += number < 0x10000U ? fmt::format("\\X2\\{:04X}\\X0\\", number) : fmt::format("\\X4\\{:08X}\\X0\\", number);
  }
  return out + "'";
}

/// Writes the instances of a file. Numbers of instances are returned.
class Step {
 public:
  template <class... Args>
  int add(fmt::format_string<Args...> format, Args&&... args) {
    text_ += fmt::format("#{}={};\n", ++last_, fmt::format(format, std::forward<Args>(args)...));
    return last_;
  }
  [[nodiscard]] static std::string list(const std::vector<int>& numbers) {
    std::string out;
    for (const int n : numbers) out += fmt::format("{}#{}", out.empty() ? "" : ",", n);
    return "(" + out + ")";
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
  int last_ = 0;
};

class Model {
 public:
  explicit Model(std::string title) : title_(std::move(title)) {
    const int origin = step_.add("IFCCARTESIANPOINT((0.,0.,0.))");
    up_ = step_.add("IFCDIRECTION((0.,0.,1.))");
    axes_ = step_.add("IFCAXIS2PLACEMENT3D(#{},$,$)", origin);
    const int context = step_.add("IFCGEOMETRICREPRESENTATIONCONTEXT($,'Model',3,1.E-4,#{},$)", axes_);
    body_ = step_.add("IFCGEOMETRICREPRESENTATIONSUBCONTEXT('Body','Model',*,*,*,*,#{},$,.MODEL_VIEW.,$)", context);
    std::vector<int> units;
    for (const auto& [kind, unit] : {std::pair("LENGTHUNIT", "METRE"),
                                     {"AREAUNIT", "SQUARE_METRE"},
                                     {"VOLUMEUNIT", "CUBIC_METRE"},
                                     {"PLANEANGLEUNIT", "RADIAN"}})
      units.push_back(step_.add("IFCSIUNIT(*,.{}.,$,.{}.)", kind, unit));
    const int assigned = step_.add("IFCUNITASSIGNMENT({})", Step::list(units));
    const int project =
        step_.add("IFCPROJECT({},$,{},$,$,$,$,(#{}),#{})", id("project"), step_text(title_), context, assigned);
    place_ = step_.add("IFCLOCALPLACEMENT($,#{})", axes_);
    const int site = step_.add("IFCSITE({},$,'Site',$,$,#{},$,$,.ELEMENT.,$,$,$,$,$)", id("site"), place_);
    building_ =
        step_.add("IFCBUILDING({},$,{},$,$,#{},$,$,.ELEMENT.,$,$,$)", id("building"), step_text(title_), place_);
    aggregate(project, {site});
    aggregate(site, {building_});
  }

  void add(const StoreyPlan& plan, std::size_t number) {
    storey_ = fmt::format("storey {}", number + 1);
    count_ = 0;
    height_ = plan.height;
    const int at = step_.add("IFCAXIS2PLACEMENT3D(#{},$,$)", point({0, 0}, plan.floor));
    place_of_storey_ = step_.add("IFCLOCALPLACEMENT(#{},#{})", place_, at);
    const int storey = step_.add("IFCBUILDINGSTOREY({},$,'Storey {}',$,$,#{},$,$,.ELEMENT.,{:.4f})", id(storey_),
                                 number + 1, place_of_storey_, plan.floor);
    std::vector<int> elements;
    for (const Area& floor : plan.floors)
      elements.push_back(step_.add("IFCSLAB({},$,'Floor',$,$,#{},#{},$,.FLOOR.)", next_id(), place_of_storey_,
                                   shape(floor, -kSlabThickness, kSlabThickness)));
    for (const Wall& wall : walls_of(plan)) add(wall, elements);
    if (!elements.empty())
      step_.add("IFCRELCONTAINEDINSPATIALSTRUCTURE({},$,$,$,{},#{})", next_id(), Step::list(elements), storey);
    std::vector<int> spaces;
    for (const Room& room : plan.rooms)
      if (!room.outline.empty()) spaces.push_back(space(room, spaces.size() + 1));
    if (!spaces.empty()) aggregate(storey, spaces);
    storeys_.push_back(storey);
  }

  [[nodiscard]] std::string finish() {
    aggregate(building_, storeys_);
    return fmt::format(
        "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('ViewDefinition [ReferenceView_V1.2]'),'2;1');\n"
        "FILE_NAME({},'1970-01-01T00:00:00',(''),(''),'Cairn','Cairn','');\nFILE_SCHEMA(('IFC4'));\nENDSEC;\nDATA;\n"
        "{}ENDSEC;\nEND-ISO-10303-21;\n",
        step_text(title_), step_.text());
  }

 private:
  [[nodiscard]] std::string id(const std::string& of) const { return "'" + global_id(title_ + "/" + of) + "'"; }
  [[nodiscard]] std::string next_id() { return id(fmt::format("{}/{}", storey_, count_++)); }
  int point(const Point& p, double z) {
    return step_.add("IFCCARTESIANPOINT(({:.4f},{:.4f},{:.4f}))", p.x(), p.y(), z);
  }
  void aggregate(int whole, const std::vector<int>& parts) {
    step_.add("IFCRELAGGREGATES({},$,$,$,#{},{})", id(fmt::format("parts of {}", whole)), whole, Step::list(parts));
  }
  int ring(const std::vector<Point>& points) {
    std::vector<int> corners;
    corners.reserve(points.size() + 1);
    for (const Point& p : points) corners.push_back(step_.add("IFCCARTESIANPOINT(({:.4f},{:.4f}))", p.x(), p.y()));
    corners.push_back(corners.front());
    return step_.add("IFCPOLYLINE({})", Step::list(corners));
  }
  /// Area extruded upwards from a height above the floor, meters.
  int shape(const Area& area, double from, double height) {
    const int outer = ring(area.front());
    std::vector<int> holes;
    for (std::size_t i = 1; i < area.size(); ++i) holes.push_back(ring(area[i]));
    const int profile = holes.empty()
                            ? step_.add("IFCARBITRARYCLOSEDPROFILEDEF(.AREA.,$,#{})", outer)
                            : step_.add("IFCARBITRARYPROFILEDEFWITHVOIDS(.AREA.,$,#{},{})", outer, Step::list(holes));
    const int at = step_.add("IFCAXIS2PLACEMENT3D(#{},$,$)", point({0, 0}, from));
    const int solid = step_.add("IFCEXTRUDEDAREASOLID(#{},#{},#{},{:.4f})", profile, at, up_, height);
    const int body = step_.add("IFCSHAPEREPRESENTATION(#{},'Body','SweptSolid',(#{}))", body_, solid);
    return step_.add("IFCPRODUCTDEFINITIONSHAPE($,$,(#{}))", body);
  }
  /// Rectangle along a wall, meters along its middle line.
  [[nodiscard]] static Area strip(const Wall& wall, double begin, double end, double thickness) {
    const Point u = (wall.to - wall.from).normalized(), aside = thickness / 2 * left_of(u);
    const Point a = wall.from + begin * u, b = wall.from + end * u;
    return {{a - aside, b - aside, b + aside, a + aside}};
  }

  void add(const Wall& wall, std::vector<int>& elements) {
    const int element =
        step_.add("IFCWALL({},$,'Wall',{},$,#{},#{},$,.NOTDEFINED.)", next_id(),
                  wall.has_two_faces ? "'both faces observed'" : "'one face observed, nominal thickness'",
                  place_of_storey_, shape(strip(wall, 0, wall.length(), wall.thickness), 0, height_));
    elements.push_back(element);
    const double height = std::min(kDoorHeight, height_ - kMinLintel);
    for (const Wall::Opening& door : wall.doors) {
      const Area area = strip(wall, door.begin, door.end, wall.thickness);
      const int opening = step_.add("IFCOPENINGELEMENT({},$,'Opening',$,$,#{},#{},$,.OPENING.)", next_id(),
                                    place_of_storey_, shape(area, 0, height));
      const int leaf = step_.add("IFCDOOR({},$,'Door',$,$,#{},#{},$,{:.4f},{:.4f},.DOOR.,.NOTDEFINED.,$)", next_id(),
                                 place_of_storey_, shape(area, 0, height), height, door.end - door.begin);
      step_.add("IFCRELVOIDSELEMENT({},$,$,$,#{},#{})", next_id(), element, opening);
      step_.add("IFCRELFILLSELEMENT({},$,$,$,#{},#{})", next_id(), opening, leaf);
      elements.push_back(leaf);
    }
  }

  int space(const Room& room, std::size_t number) {
    const int space = step_.add("IFCSPACE({},$,'{}',$,$,#{},#{},'Room {}',.ELEMENT.,.INTERNAL.,$)", next_id(), number,
                                place_of_storey_, shape(room.outline, 0, height_), number);
    const int area = step_.add("IFCQUANTITYAREA('NetFloorArea',$,$,{:.4f},$)", room.area);
    const int quantities = step_.add("IFCELEMENTQUANTITY({},$,'Qto_SpaceBaseQuantities',$,$,(#{}))", next_id(), area);
    step_.add("IFCRELDEFINESBYPROPERTIES({},$,$,$,(#{}),#{})", next_id(), space, quantities);
    return space;
  }

  Step step_;
  std::string title_, storey_;
  int up_ = 0, axes_ = 0, body_ = 0, place_ = 0, building_ = 0, place_of_storey_ = 0, count_ = 0;
  double height_ = 0;
  std::vector<int> storeys_;
};

}  // namespace

std::string ifc_of(const std::vector<StoreyPlan>& storeys, const std::string& title) {
  Model model(title.empty() ? "Cairn" : title);
  for (std::size_t i = 0; i < storeys.size(); ++i) model.add(storeys[i], i);
  return model.finish();
}

}  // namespace cairn::plan
