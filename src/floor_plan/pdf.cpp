// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <cairo-pdf.h>
#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <numbers>
#include <stdexcept>

#include "floor_plan/sheet.hpp"

namespace cairn::plan {
namespace {

constexpr double kPointsPerMm = 72 / 25.4;  // per millimeter

void set_color(cairo_t* c, Color color) {
  const auto part = [&](int shift) { return (color >> shift & 0xff) / 255.0; };
  cairo_set_source_rgb(c, part(16), part(8), part(0));
}

void add_path(cairo_t* c, const Shape& shape) {
  for (const auto& ring : shape.rings) {
    for (std::size_t i = 0; i < ring.size(); ++i)
      i == 0 ? cairo_move_to(c, ring[i].x(), ring[i].y()) : cairo_line_to(c, ring[i].x(), ring[i].y());
    if (shape.closed) cairo_close_path(c);
  }
}

/// Draws diagonal lines inside the path.
void hatch(cairo_t* c, Color color) {
  double left = 0, top = 0, right = 0, bottom = 0;
  cairo_path_extents(c, &left, &top, &right, &bottom);
  cairo_save(c);
  cairo_clip(c);
  const double spacing = kHatchSpacing * std::numbers::sqrt2;  // along x; lines are at multiples of `spacing` in x + y
  const auto last = static_cast<long>(std::ceil((right + bottom) / spacing));
  for (auto i = static_cast<long>(std::floor((left + top) / spacing)); i < last; ++i) {
    const double sum = static_cast<double>(i) * spacing;
    cairo_move_to(c, sum - top, top);
    cairo_line_to(c, sum - bottom, bottom);
  }
  set_color(c, color);
  cairo_set_line_width(c, kHatchWidth);
  cairo_stroke(c);
  cairo_restore(c);
}

void draw(cairo_t* c, const Style& style, const Shape& shape) {
  if (style.fill) {
    set_color(c, *style.fill);
    add_path(c, shape);
    cairo_fill(c);
  }
  if (style.hatch) {
    add_path(c, shape);
    hatch(c, *style.hatch);
  }
  if (!style.stroke) return;
  const double dashes[] = {kDash, kDashGap};
  set_color(c, *style.stroke);
  cairo_set_line_width(c, style.width);
  cairo_set_dash(c, dashes, style.dashed ? 2 : 0, 0);
  cairo_set_line_cap(c, style.dashed ? CAIRO_LINE_CAP_BUTT : CAIRO_LINE_CAP_SQUARE);
  add_path(c, shape);
  cairo_stroke(c);
}

void draw(cairo_t* c, const Label& label) {
  cairo_select_font_face(c, "sans-serif", CAIRO_FONT_SLANT_NORMAL,
                         label.bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(c, label.size);
  cairo_text_extents_t extents;
  cairo_text_extents(c, label.text.c_str(), &extents);
  const double share = label.align == Align::left ? 0 : label.align == Align::middle ? 0.5 : 1;
  cairo_save(c);
  cairo_translate(c, label.at.x(), label.at.y());
  if (label.upwards) cairo_rotate(c, -std::numbers::pi / 2);
  cairo_move_to(c, -share * extents.x_advance, 0);
  set_color(c, label.color);
  cairo_show_text(c, label.text.c_str());
  cairo_restore(c);
}

cairo_status_t append(void* to, const unsigned char* bytes, unsigned count) {
  static_cast<std::string*>(to)->append(reinterpret_cast<const char*>(bytes), count);
  return CAIRO_STATUS_SUCCESS;
}

}  // namespace

std::string pdf_of(const std::vector<Sheet>& sheets) {
  std::string pdf;
  const std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)> surface(
      cairo_pdf_surface_create_for_stream(append, &pdf, 1, 1), cairo_surface_destroy);
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_TITLE, sheets.front().title.c_str());
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_CREATE_DATE, "");  // default: the current time
  for (const Sheet& sheet : sheets) {
    cairo_pdf_surface_set_size(surface.get(), kPointsPerMm * sheet.width, kPointsPerMm * sheet.height);
    const std::unique_ptr<cairo_t, decltype(&cairo_destroy)> page(cairo_create(surface.get()), cairo_destroy);
    cairo_scale(page.get(), kPointsPerMm, kPointsPerMm);
    cairo_set_fill_rule(page.get(), CAIRO_FILL_RULE_EVEN_ODD);
    for (const Layer& layer : sheet.layers) {
      for (const Shape& shape : layer.shapes) draw(page.get(), layer.style, shape);
      for (const Label& label : layer.labels) draw(page.get(), label);
    }
    cairo_show_page(page.get());
  }
  cairo_surface_finish(surface.get());
  if (const cairo_status_t status = cairo_surface_status(surface.get()); status != CAIRO_STATUS_SUCCESS)
    throw std::runtime_error(fmt::format("the PDF cannot be made: cairo says {}", cairo_status_to_string(status)));
  return pdf;
}

}  // namespace cairn::plan
