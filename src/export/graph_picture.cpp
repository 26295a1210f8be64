// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "export/graph_picture.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <stdexcept>

#include "base/atomic_file.hpp"

namespace cairn {
namespace {

constexpr double kWidth = 900, kMargin = 40;  // pixels
constexpr double kLegend = 60;                // pixels above the drawing
constexpr const char *kTracked = "#b9b9b9", *kCorrected = "#1f5fbf", *kLoop = "#e2711d", *kRefused = "#c1121f";

Eigen::Vector2d from_above(const Eigen::Isometry3d& pose) { return {pose.translation().x(), -pose.translation().z()}; }

}  // namespace

void write_graph_picture(const std::filesystem::path& file, const Atlas& atlas) {
  const auto component_of = atlas.components();
  const std::size_t main = atlas.keyframes.empty() ? 0 : atlas.main_component();
  Eigen::AlignedBox2d box;
  for (std::size_t k = 0; k < atlas.keyframes.size(); ++k) {
    if (component_of[k] != main) continue;
    box.extend(from_above(atlas.world_from_camera[k]));
    box.extend(from_above(atlas.keyframes[k].odometry_from_camera));
  }
  if (box.isEmpty()) box.extend(Eigen::Vector2d::Zero());
  box.extend(box.min() - Eigen::Vector2d::Constant(0.1));
  box.extend(box.max() + Eigen::Vector2d::Constant(0.1));
  const double scale = (kWidth - 2 * kMargin) / box.sizes().maxCoeff();
  const double height = scale * box.sizes().y() + 2 * kMargin + kLegend;
  const auto pixel = [&](const Eigen::Vector2d& p) -> Eigen::Vector2d {
    return Eigen::Vector2d(kMargin, kMargin + kLegend) + scale * (p - box.min());
  };
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" viewBox=\"0 0 {0:.0f} {1:.0f}\" "
      "font-family=\"sans-serif\" font-size=\"14\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
      kWidth, height);
  const auto line = [&](const Eigen::Vector2d& a, const Eigen::Vector2d& b, const char* colour, double width) {
    svg += fmt::format(
        "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" stroke-width=\"{}\"/>\n", a.x(),
        a.y(), b.x(), b.y(), colour, width);
  };
  const auto way = [&](const char* colour, double width, const auto& pose_of) {
    for (std::size_t k = 1; k < atlas.keyframes.size(); ++k)
      if (component_of[k] == main && atlas.keyframes[k].follows)
        line(pixel(from_above(pose_of(k - 1))), pixel(from_above(pose_of(k))), colour, width);
  };
  way(kTracked, 2, [&](std::size_t k) { return atlas.keyframes[k].odometry_from_camera; });
  int loops = 0, refused = 0;
  for (const Loop& loop : atlas.loops) {
    if (loop.corners == 0 || component_of[loop.edge.j] != main) continue;
    ++(loop.inlier ? loops : refused);
    line(pixel(from_above(atlas.world_from_camera[loop.edge.i])),
         pixel(from_above(atlas.world_from_camera[loop.edge.j])), loop.inlier ? kLoop : kRefused, 1.2);
  }
  way(kCorrected, 2, [&](std::size_t k) { return atlas.world_from_camera[k]; });
  for (std::size_t k = 0; k < atlas.keyframes.size(); ++k) {
    if (component_of[k] != main) continue;
    const Eigen::Vector2d p = pixel(from_above(atlas.world_from_camera[k]));
    const bool begins_submap = k == 0 || atlas.keyframes[k].submap != atlas.keyframes[k - 1].submap;
    svg += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{}\" fill=\"{}\" stroke=\"{}\"/>\n", p.x(), p.y(),
                       begins_submap ? 5 : 2, begins_submap ? "white" : kCorrected, kCorrected);
  }
  double left = kMargin;
  const auto legend = [&](const char* colour, const std::string& text) {
    line({left, 30}, {left + 24, 30}, colour, 3);
    svg += fmt::format("<text x=\"{:.0f}\" y=\"35\">{}</text>\n", left + 30, text);
    left += 55 + 7.6 * static_cast<double>(text.size());
  };
  legend(kTracked, "as tracked");
  legend(kCorrected, fmt::format("corrected ({} keyframes; rings: submaps)",
                                 std::count(component_of.begin(), component_of.end(), main)));
  legend(kLoop, fmt::format("{} loops", loops));
  if (refused > 0) legend(kRefused, fmt::format("{} not believed", refused));
  const double metres = std::pow(10, std::floor(std::log10(200 / scale)));
  line({kMargin, height - 16}, {kMargin + metres * scale, height - 16}, "black", 2);
  svg += fmt::format("<text x=\"{:.0f}\" y=\"{:.0f}\">{} m, seen from above</text>\n</svg>\n",
                     kMargin + metres * scale + 8, height - 11, metres);
  write_whole(file, svg);
}

}  // namespace cairn
