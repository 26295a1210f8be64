// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include "floor_plan/sheet.hpp"

namespace cairn::plan {
namespace {

std::string escaped(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    if (c == '<')
      safe += "&lt;";
    else if (c == '>')
      safe += "&gt;";
    else if (c == '&')
      safe += "&amp;";
    else if (c == '"')
      safe += "&quot;";
    else if (static_cast<unsigned char>(c) >= ' ')
      safe += c;
  }
  return safe;
}

std::string path_of(const Shape& shape) {
  std::string path;
  for (const auto& ring : shape.rings) {
    for (std::size_t i = 0; i < ring.size(); ++i)
      path += fmt::format("{}{:.3f},{:.3f}", i == 0 ? "M" : " ", ring[i].x(), ring[i].y());
    if (shape.closed) path += "Z";
  }
  return path;
}

std::string attributes_of(const Style& style) {
  std::string fill = "none";
  if (style.fill) fill = fmt::format("#{:06x}", *style.fill);
  if (style.hatch) fill = "url(#hatch)";
  std::string text = fmt::format("fill=\"{}\" fill-rule=\"evenodd\"", fill);
  if (style.stroke)
    text += fmt::format(" stroke=\"#{:06x}\" stroke-width=\"{:.2f}\" stroke-linejoin=\"miter\" stroke-linecap=\"{}\"",
                        *style.stroke, style.width, style.dashed ? "butt" : "square");
  if (style.dashed) text += fmt::format(" stroke-dasharray=\"{} {}\"", kDash, kDashGap);
  return text;
}

std::string text_of(const Label& label) {
  constexpr const char* kAnchors[] = {"start", "middle", "end"};
  const std::string turn =
      label.upwards ? fmt::format(" transform=\"rotate(-90 {:.3f} {:.3f})\"", label.at.x(), label.at.y()) : "";
  const std::string color = label.color == 0 ? "" : fmt::format(" fill=\"#{:06x}\"", label.color);
  return fmt::format("<text x=\"{:.3f}\" y=\"{:.3f}\" font-size=\"{}\" text-anchor=\"{}\"{}{}{}>{}</text>\n",
                     label.at.x(), label.at.y(), label.size, kAnchors[static_cast<int>(label.align)],
                     label.bold ? " font-weight=\"bold\"" : "", color, turn, escaped(label.text));
}

}  // namespace

std::string svg_of(const Sheet& sheet) {
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" xmlns:inkscape=\"http://www.inkscape.org/namespaces/inkscape\" "
      "width=\"{0}mm\" height=\"{1}mm\" viewBox=\"0 0 {0} {1}\" font-family=\"sans-serif\">\n<title>{2}</title>\n",
      sheet.width, sheet.height, escaped(sheet.title));
  for (const Layer& layer : sheet.layers)
    if (layer.style.hatch) {
      svg += fmt::format(
          "<defs><pattern id=\"hatch\" patternUnits=\"userSpaceOnUse\" width=\"{0}\" height=\"{0}\" "
          "patternTransform=\"rotate(-45)\">{3}<path d=\"M0,0H{0}\" stroke=\"#{1:06x}\" stroke-width=\"{2}\"/>"
          "</pattern></defs>\n",
          kHatchSpacing, *layer.style.hatch, 2 * kHatchWidth,  // the pattern clips half of the width
          layer.style.fill
              ? fmt::format("<rect width=\"{0}\" height=\"{0}\" fill=\"#{1:06x}\"/>", kHatchSpacing, *layer.style.fill)
              : "");
      break;
    }
  svg += fmt::format("<rect width=\"{}\" height=\"{}\" fill=\"#ffffff\"/>\n", sheet.width, sheet.height);
  for (const Layer& layer : sheet.layers) {
    svg += fmt::format("<g inkscape:groupmode=\"layer\" inkscape:label=\"{}\" {}>\n", escaped(layer.name),
                       attributes_of(layer.style));
    for (const Shape& shape : layer.shapes) svg += "<path d=\"" + path_of(shape) + "\"/>\n";
    if (!layer.labels.empty()) svg += "<g fill=\"#000000\" stroke=\"none\">\n";
    for (const Label& label : layer.labels) svg += text_of(label);
    svg += layer.labels.empty() ? "</g>\n" : "</g>\n</g>\n";
  }
  return svg + "</svg>\n";
}

}  // namespace cairn::plan
