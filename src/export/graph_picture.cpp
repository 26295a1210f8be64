// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/graph_picture.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "base/atomic_file.hpp"

namespace cairn {
namespace {

constexpr double kWidth = 900, kMargin = 40;  // pixels
constexpr double kLegend = 60;                // pixels above the drawing
constexpr const char *kTracked = "#b9b9b9", *kCorrected = "#1f5fbf", *kLoop = "#e2711d", *kRejected = "#c1121f";

Eigen::Vector2d from_above(const Eigen::Isometry3d& pose) { return {pose.translation().x(), -pose.translation().z()}; }

/// SVG drawing that fills the width.
class Svg {
 public:
  /// `box`: extent of the drawing, meters.
  explicit Svg(const Eigen::AlignedBox2d& box)
      : low_(box.min()),
        scale_((kWidth - 2 * kMargin) / box.sizes().maxCoeff()),
        height_(scale_ * box.sizes().y() + 2 * kMargin + kLegend),
        text_(fmt::format("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" "
                          "viewBox=\"0 0 {0:.0f} {1:.0f}\" font-family=\"sans-serif\" font-size=\"14\">\n"
                          "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
                          kWidth, height_)) {}

  /// Draws a line between two points in meters.
  void line(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const char* color, double width) {
    line_px(pixel(a), pixel(b), color, width);
  }
  void circle(const Eigen::Vector2d& place, int radius, const char* fill, const char* stroke) {
    const Eigen::Vector2d p = pixel(place);
    text_ += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{}\" fill=\"{}\" stroke=\"{}\"/>\n", p.x(), p.y(),
                         radius, fill, stroke);
  }
  /// Adds a color's entry to the legend, right of the previous entry.
  void legend(const char* color, const std::string& text) {
    line_px({legend_end_, 30}, {legend_end_ + 24, 30}, color, 3);
    text_ += fmt::format("<text x=\"{:.0f}\" y=\"35\">{}</text>\n", legend_end_ + 30, text);
    legend_end_ += 55 + 7.6 * static_cast<double>(text.size());
  }
  /// Draws a scale bar, a power of ten in meters, and ends the drawing.
  [[nodiscard]] std::string with_scale() {
    const double meters = std::pow(10, std::floor(std::log10(200 / scale_)));
    line_px({kMargin, height_ - 16}, {kMargin + meters * scale_, height_ - 16}, "black", 2);
    return text_ + fmt::format("<text x=\"{:.0f}\" y=\"{:.0f}\">{} m, seen from above</text>\n</svg>\n",
                               kMargin + meters * scale_ + 8, height_ - 11, meters);
  }

 private:
  [[nodiscard]] Eigen::Vector2d pixel(const Eigen::Vector2d& p) const {
    return Eigen::Vector2d(kMargin, kMargin + kLegend) + scale_ * (p - low_);
  }
  void line_px(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const char* color, double width) {
    text_ += fmt::format(
        "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" stroke-width=\"{}\"/>\n", a.x(),
        a.y(), b.x(), b.y(), color, width);
  }

  Eigen::Vector2d low_;
  double scale_, height_;  // pixels per meter; pixels
  std::string text_;
  double legend_end_ = kMargin;
};

/// Tracked and corrected poses of a component's keyframes, with a margin.
Eigen::AlignedBox2d box_of(const Atlas& atlas, const Eigen::Isometry3d& turn,
                           const std::vector<std::size_t>& component_of, std::size_t main) {
  Eigen::AlignedBox2d box;
  for (std::size_t k = 0; k < atlas.keyframes.size(); ++k) {
    if (component_of[k] != main) continue;
    box.extend(from_above(turn * atlas.world_from_camera[k]));
    box.extend(from_above(turn * atlas.keyframes[k].odometry_from_camera));
  }
  if (box.isEmpty()) box.extend(Eigen::Vector2d::Zero());
  box.extend(box.min() - Eigen::Vector2d::Constant(0.1));
  box.extend(box.max() + Eigen::Vector2d::Constant(0.1));
  return box;
}

}  // namespace

void write_graph_picture(const std::filesystem::path& file, const Atlas& atlas) {
  const auto component_of = atlas.components();
  const std::size_t main = atlas.keyframes.empty() ? 0 : atlas.main_component();
  const Eigen::Isometry3d turn(atlas.upright().world_from_tracked);
  Svg svg(box_of(atlas, turn, component_of, main));
  const auto path = [&](const char* color, const auto& pose_of) {
    for (std::size_t k = 1; k < atlas.keyframes.size(); ++k)
      if (component_of[k] == main && atlas.keyframes[k].follows)
        svg.line(from_above(pose_of(k - 1)), from_above(pose_of(k)), color, 2);
  };
  const auto corrected = [&](std::size_t k) { return turn * atlas.world_from_camera[k]; };
  path(kTracked, [&](std::size_t k) { return turn * atlas.keyframes[k].odometry_from_camera; });
  int loops = 0, rejected = 0;
  for (const Loop& loop : atlas.loops) {
    if (loop.feature_inliers == 0 || component_of[loop.edge.j] != main) continue;
    ++(loop.inlier ? loops : rejected);
    svg.line(from_above(corrected(loop.edge.i)), from_above(corrected(loop.edge.j)), loop.inlier ? kLoop : kRejected,
             1.2);
  }
  path(kCorrected, corrected);
  for (std::size_t k = 0; k < atlas.keyframes.size(); ++k) {
    if (component_of[k] != main) continue;
    const bool begins_submap = k == 0 || atlas.keyframes[k].submap != atlas.keyframes[k - 1].submap;
    svg.circle(from_above(corrected(k)), begins_submap ? 5 : 2, begins_submap ? "white" : kCorrected, kCorrected);
  }
  svg.legend(kTracked, "as tracked");
  svg.legend(kCorrected, fmt::format("corrected ({} keyframes; rings: submaps)",
                                     std::count(component_of.begin(), component_of.end(), main)));
  svg.legend(kLoop, fmt::format("{} loops", loops));
  if (rejected > 0) svg.legend(kRejected, fmt::format("{} rejected", rejected));
  write_whole(file, svg.with_scale());
}

}  // namespace cairn
