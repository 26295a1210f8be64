// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Page of a plan as simple shapes. Millimeters of the paper: x right, y down from its upper left corner.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "floor_plan/grid.hpp"

namespace cairn::plan {

using Color = std::uint32_t;  // 0xrrggbb

struct Style {
  std::optional<Color> fill = {};
  std::optional<Color> hatch = {};  // color of diagonal lines
  std::optional<Color> stroke = {};
  double width = 0;  // mm, of the stroke
  bool dashed = false;
};

struct Shape {
  Area rings;  // or open lines if not closed
  bool closed = true;
};

enum class Align : std::uint8_t { left, middle, right };

struct Label {
  Point at = Point::Zero();  // on its baseline
  std::string text;          // UTF-8
  double size = 2.5;         // mm
  Align align = Align::left;
  bool bold = false;
  bool upwards = false;  // rotated for reading from the right
  Color color = 0x000000;
};

/// Shapes with a common style, switched on and off together.
struct Layer {
  std::string name;
  Style style = {};
  std::vector<Shape> shapes = {};
  std::vector<Label> labels = {};
  bool is_of_page = false;  // grid, scale bar and legend: absent from a drawing in true size
};

struct Sheet {
  double width = 0, height = 0;
  std::string title;
  std::vector<Layer> layers;  // in drawing order
};

inline constexpr double kHatchSpacing = 1.4, kHatchWidth = 0.1;  // mm
inline constexpr double kDash = 1.5, kDashGap = 1.0;             // mm

/// SVG with a group per layer, shown by Inkscape as a layer, and with text as text. cairo's SVG has neither: it draws
/// letters as paths.
[[nodiscard]] std::string svg_of(const Sheet& sheet);
/// DXF in meters, x right and y up from the page's lower left corner, with the sheet's layers. `scale`: of the sheet,
/// 1:scale. Areas are closed polylines.
[[nodiscard]] std::string dxf_of(const Sheet& sheet, int scale);
/// PDF with a page per sheet, made by cairo. Contains no creation time: the same sheets give the same bytes. Throws
/// std::runtime_error if cairo fails.
[[nodiscard]] std::string pdf_of(const std::vector<Sheet>& sheets);

}  // namespace cairn::plan
