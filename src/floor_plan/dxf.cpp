// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// DXF of AutoCAD Release 12, the version that every CAD program reads: pairs of a group code and a value, a line each
// (Autodesk, DXF Reference).
#include <fmt/format.h>

#include <array>
#include <cctype>
#include <limits>

#include "floor_plan/code_points.hpp"
#include "floor_plan/sheet.hpp"

namespace cairn::plan {
namespace {

/// AutoCAD's first colors, with 7 for the foreground: black or white.
constexpr std::array<Color, 9> kColors{0xff0000, 0xffff00, 0x00ff00, 0x00ffff, 0x0000ff,
                                       0xff00ff, 0x000000, 0x808080, 0xc0c0c0};

/// Number of the color nearest to `color`.
int color_number(Color color) {
  int best = 0, best_error = std::numeric_limits<int>::max();
  for (std::size_t i = 0; i < kColors.size(); ++i) {
    int error = 0;
    for (const unsigned shift : {0U, 8U, 16U}) {
      const int d = static_cast<int>(color >> shift & 255) - static_cast<int>(kColors[i] >> shift & 255);
      error += d * d;
    }
    if (error < best_error) best = static_cast<int>(i) + 1, best_error = error;
  }
  return best;
}

int color_number(const Style& style) {
  for (const auto& color : {style.stroke, style.fill, style.hatch})
    if (color) return color_number(*color);
  return color_number(0);
}

/// Layer name in the characters of Release 12.
std::string layer_name(const std::string& name) {
  std::string upper;
  for (const char c : name)
    if (std::isalnum(static_cast<unsigned char>(c)) != 0)
      upper += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    else if (!upper.empty() && upper.back() != '_')
      upper += '_';
  return upper;
}

/// Text in ASCII: other characters as \U+XXXX. `text`: UTF-8.
std::string ascii(const std::string& text) {
  std::string safe;
  for (const char32_t code : code_points(text))
    safe += code < 0x80 ? std::string(1, static_cast<char>(code))
                        : fmt::format("\\U+{:04X}", static_cast<std::uint32_t>(code));
  return safe;
}

/// Writes the groups of a file.
class Dxf {
 public:
  /// `meters`: per millimeter of the paper; `height`: of the paper, mm.
  Dxf(double meters, double height) : meters_(meters), height_(height) {}
  void text(int code, std::string_view value) { text_ += fmt::format("{:>3}\n{}\n", code, value); }
  void integer(int code, int value) { text_ += fmt::format("{:>3}\n{:>6}\n", code, value); }
  void real(int code, double value) { text_ += fmt::format("{:>3}\n{:.4f}\n", code, value); }
  void length(int code, double mm) { real(code, mm * meters_); }
  /// A point in model space, y up, from a point of the paper. `code`: of x.
  void point(int code, const Point& p) {
    length(code, p.x());
    length(code + 10, height_ - p.y());
    real(code + 20, 0);
  }
  void entity(const char* type, const std::string& layer) {
    text(0, type);
    text(8, layer);
  }
  [[nodiscard]] std::string take() { return std::move(text_); }

 private:
  double meters_, height_;
  std::string text_;
};

void write_header(const Sheet& sheet, Dxf& dxf) {
  dxf.text(0, "SECTION");
  dxf.text(2, "HEADER");
  dxf.text(9, "$ACADVER");
  dxf.text(1, "AC1009");
  dxf.text(9, "$INSUNITS");
  dxf.integer(70, 6);  // meters
  dxf.text(9, "$EXTMIN");
  dxf.point(10, {0, sheet.height});
  dxf.text(9, "$EXTMAX");
  dxf.point(10, {sheet.width, 0});
  dxf.text(0, "ENDSEC");
}

void write_line_type(const char* name, const char* description, std::initializer_list<double> dashes, Dxf& dxf) {
  dxf.text(0, "LTYPE");
  dxf.text(2, name);
  dxf.integer(70, 0);
  dxf.text(3, description);
  dxf.integer(72, 'A');
  dxf.integer(73, static_cast<int>(dashes.size()));
  double total = 0;
  for (const double dash : dashes) total += std::abs(dash);
  dxf.length(40, total);
  for (const double dash : dashes) dxf.length(49, dash);
}

void write_tables(const Sheet& sheet, Dxf& dxf) {
  dxf.text(0, "SECTION");
  dxf.text(2, "TABLES");
  dxf.text(0, "TABLE");
  dxf.text(2, "LTYPE");
  dxf.integer(70, 2);
  write_line_type("CONTINUOUS", "Solid line", {}, dxf);
  write_line_type("DASHED", "__ __ __", {kDash, -kDashGap}, dxf);
  dxf.text(0, "ENDTAB");
  dxf.text(0, "TABLE");
  dxf.text(2, "LAYER");
  dxf.integer(70, static_cast<int>(sheet.layers.size()));
  for (const Layer& layer : sheet.layers) {
    if (layer.is_of_page) continue;
    dxf.text(0, "LAYER");
    dxf.text(2, layer_name(layer.name));
    dxf.integer(70, 0);
    dxf.integer(62, color_number(layer.style));
    dxf.text(6, layer.style.dashed ? "DASHED" : "CONTINUOUS");
  }
  dxf.text(0, "ENDTAB");
  dxf.text(0, "ENDSEC");
}

void write_ring(const std::vector<Point>& ring, bool closed, const std::string& layer, Dxf& dxf) {
  if (ring.size() == 2 && !closed) {
    dxf.entity("LINE", layer);
    dxf.point(10, ring[0]);
    dxf.point(11, ring[1]);
    return;
  }
  dxf.entity("POLYLINE", layer);
  dxf.integer(66, 1);  // vertices follow
  dxf.point(10, {0, 0});
  dxf.integer(70, closed ? 1 : 0);
  for (const Point& p : ring) {
    dxf.entity("VERTEX", layer);
    dxf.point(10, p);
  }
  dxf.entity("SEQEND", layer);
}

void write_label(const Label& label, const std::string& layer, Dxf& dxf) {
  dxf.entity("TEXT", layer);
  if (label.color != 0) dxf.integer(62, color_number(label.color));
  dxf.point(10, label.at);
  dxf.length(40, label.size);
  dxf.text(1, ascii(label.text));
  if (label.upwards) dxf.real(50, 90);
  if (label.align == Align::left) return;
  dxf.integer(72, label.align == Align::middle ? 1 : 2);
  dxf.point(11, label.at);
}

}  // namespace

std::string dxf_of(const Sheet& sheet, int scale) {
  Dxf dxf(1e-3 * scale, sheet.height);
  write_header(sheet, dxf);
  write_tables(sheet, dxf);
  dxf.text(0, "SECTION");
  dxf.text(2, "ENTITIES");
  for (const Layer& layer : sheet.layers) {
    if (layer.is_of_page) continue;
    const std::string name = layer_name(layer.name);
    for (const Shape& shape : layer.shapes)
      for (const auto& ring : shape.rings) write_ring(ring, shape.closed, name, dxf);
    for (const Label& label : layer.labels) write_label(label, name, dxf);
  }
  dxf.text(0, "ENDSEC");
  dxf.text(0, "EOF");
  return dxf.take();
}

}  // namespace cairn::plan
