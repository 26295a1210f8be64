// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A page of a plan as plain shapes. Millimetres of the paper: x right, y down from its upper left corner.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "plan/grid.hpp"

namespace cairn::plan {

using Colour = std::uint32_t;  // 0xrrggbb

struct Style {
  std::optional<Colour> fill = {};
  std::optional<Colour> hatch = {};  // colour of lines across
  std::optional<Colour> stroke = {};
  double width = 0;  // mm, of the stroke
  bool dashed = false;
};

struct Shape {
  Area rings;  // or lines, where they are not closed
  bool closed = true;
};

enum class Align : std::uint8_t { left, middle, right };

struct Label {
  Point at = Point::Zero();  // on its base line
  std::string text;          // UTF-8
  double size = 2.5;         // mm
  Align align = Align::left;
  bool bold = false;
  bool upwards = false;  // turned to be read from the right
  Colour color = 0x000000;
};

/// What is drawn alike, and can be switched off together.
struct Layer {
  std::string name;
  Style style = {};
  std::vector<Shape> shapes = {};
  std::vector<Label> labels = {};
};

struct Sheet {
  double width = 0, height = 0;
  std::string title;
  std::vector<Layer> layers;  // the first is drawn first
};

inline constexpr double kHatchApart = 1.4, kHatchWidth = 0.1;  // mm
inline constexpr double kDash = 1.5, kDashGap = 1.0;           // mm

/// An SVG with a group a layer, which Inkscape shows as its layers, and text as text. Written by hand since that of
/// cairo has neither: it draws letters as paths.
[[nodiscard]] std::string svg_of(const Sheet& sheet);
/// A PDF with a page a sheet, through cairo. Without the time at which it was made: the same sheets give the same
/// bytes. Throws std::runtime_error where cairo fails.
[[nodiscard]] std::string pdf_of(const std::vector<Sheet>& sheets);

}  // namespace cairn::plan
