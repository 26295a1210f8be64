// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/pictures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "base/atomic_file.hpp"
#include "base/picture.hpp"

namespace cairn::apps {
namespace {

constexpr int kSliceWidth = 1000;                                   // approximate width of a slice in pixels
constexpr int kMargin = 70;                                         // pixels, for axes
constexpr float kMaxPixelsPerVoxel = 100;                           // maximum in a slice
constexpr std::uint64_t kPixelsPerBlock = 16 * 256;                 // of a costmap: 16 times the area of a block
constexpr std::uint64_t kMinPixels = 1 << 18;                       // of a costmap, regardless of the known area
constexpr int kLegendWidth = 130;                                   // pixels, right of the slice
constexpr std::uint8_t kOccupied = 0, kFree = 254, kUnknown = 205;  // values of map_server

const cv::Scalar kInk(40, 40, 40);
const cv::Vec3b kUnknownColor(225, 225, 225);

/// Color of a distance: red inside, yellow near, blue far, with a thin dark line at the surface.
cv::Vec3b color_of(float distance, float max_distance, float pixel) {
  if (std::abs(distance) < 0.75f * pixel) return {30, 30, 30};
  if (distance < 0) return {60, 60, 200};
  static const cv::Mat palette = [] {
    cv::Mat ramp(1, 256, CV_8U), colors;
    for (int i = 0; i < 256; ++i) ramp.at<std::uint8_t>(i) = static_cast<std::uint8_t>(235 - i * 200 / 255);
    cv::applyColorMap(ramp, colors, cv::COLORMAP_VIRIDIS);
    return colors;
  }();
  const auto step = static_cast<int>(std::clamp(distance / max_distance, 0.0f, 1.0f) * 255.0f);
  cv::Vec3b color = palette.at<cv::Vec3b>(step);
  const float line = std::fmod(distance, 0.25f);
  if (std::min(line, 0.25f - line) < 0.5f * pixel)
    for (int c = 0; c < 3; ++c) color[c] = static_cast<std::uint8_t>(color[c] * 3 / 4);
  return color;
}

void draw_text(cv::Mat& image, const std::string& label, cv::Point at, bool is_centered = false) {
  int base = 0;
  const cv::Size size = cv::getTextSize(label, cv::FONT_HERSHEY_SIMPLEX, 0.45, 1, &base);
  if (is_centered) at.x -= size.width / 2;
  cv::putText(image, label, at, cv::FONT_HERSHEY_SIMPLEX, 0.45, kInk, 1, cv::LINE_AA);
}

double tick_of(double length) {
  for (const double tick : {0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0})
    if (length / tick <= 8) return tick;
  double tick = 20;
  while (length / tick > 8) tick *= 10;
  return tick;
}

/// Multiples of `step` from `begin` to `end`.
std::vector<double> multiples(float begin, float end, double step) {
  const auto first = std::lround(std::ceil(static_cast<double>(begin) / step)),
             last = std::lround(std::floor(static_cast<double>(end) / step));
  std::vector<double> values;
  values.reserve(static_cast<std::size_t>(std::max(0L, last - first + 1)));
  for (long i = first; i <= last; ++i) values.push_back(static_cast<double>(i) * step);
  return values;
}

/// Image geometry of a plane across an axis, seen along the axis. A plane of constant y is the floor plan, with z
/// upward.
struct SliceView {
  int axis, across, down;  // axes of the map
  bool is_flipped;         // rows run against `down`
  float at, pixel;         // meters
  int columns, rows;
  Eigen::AlignedBox3f box;
};

/// `min_pixel`: minimum size of a pixel in meters, for a box without extent.
SliceView slice_view(const Eigen::AlignedBox3f& box, int axis, float at, float min_pixel) {
  SliceView view{.axis = axis,
                 .across = axis == 0 ? 2 : 0,
                 .down = axis == 1 ? 2 : 1,
                 .is_flipped = axis == 1,
                 .at = at,
                 .pixel = 0,
                 .columns = 0,
                 .rows = 0,
                 .box = box};
  const float width = box.sizes()[view.across], height = box.sizes()[view.down];
  view.pixel = std::max({width / kSliceWidth, height / kSliceWidth, min_pixel});
  view.columns = static_cast<int>(width / view.pixel) + 1;
  view.rows = static_cast<int>(height / view.pixel) + 1;
  return view;
}

/// Distances at the pixels, in row order.
std::vector<DistanceField::Answer> distances_on(const SliceView& view, const DistanceField& field) {
  std::vector<Eigen::Vector3f> points;
  for (int row = 0; row < view.rows; ++row)
    for (int column = 0; column < view.columns; ++column) {
      Eigen::Vector3f p;
      p[view.axis] = view.at;
      p[view.across] = view.box.min()[view.across] + view.pixel * static_cast<float>(column);
      p[view.down] =
          view.box.min()[view.down] + view.pixel * static_cast<float>(view.is_flipped ? view.rows - 1 - row : row);
      points.push_back(p);
    }
  std::vector<DistanceField::Answer> answers(points.size());
  field.query(points, answers);
  return answers;
}

void draw_axes(cv::Mat& image, const SliceView& view) {
  cv::rectangle(image, {kMargin - 1, kMargin - 1, view.columns + 2, view.rows + 2}, kInk);
  const int bottom = kMargin + view.rows;
  const float across = view.box.min()[view.across], down = view.box.min()[view.down];
  const auto pixels = [&](double length) { return static_cast<int>(length / static_cast<double>(view.pixel)); };
  const auto label = [](double v) { return fmt::format("{:g}", std::round(v * 10) / 10 + 0.0); };
  const double tick =
      tick_of(static_cast<double>(std::max(view.box.sizes()[view.across], view.box.sizes()[view.down])));
  for (const double v : multiples(across, view.box.max()[view.across], tick)) {
    const int x = kMargin + pixels(v - static_cast<double>(across));
    cv::line(image, {x, bottom}, {x, bottom + 5}, kInk);
    draw_text(image, label(v), {x, bottom + 22}, true);
  }
  for (const double v : multiples(down, view.box.max()[view.down], tick)) {
    const int offset = pixels(v - static_cast<double>(down));
    const int y = kMargin + (view.is_flipped ? view.rows - 1 - offset : offset);
    cv::line(image, {kMargin - 6, y}, {kMargin - 1, y}, kInk);
    draw_text(image, label(v), {kMargin - 30, y + 5}, true);
  }
  draw_text(image, fmt::format("{} (m)", "xyz"[view.across]), {kMargin + view.columns / 2, bottom + 45}, true);
  draw_text(image, fmt::format("{} (m)", "xyz"[view.down]), {kMargin - 55, kMargin - 12});
}

/// Draws the color scale up to `max_distance`, starting at column `left`.
void draw_legend(cv::Mat& image, int left, float max_distance) {
  constexpr int kBarHeight = 180;  // pixels
  for (int y = 0; y < kBarHeight; ++y)
    for (int x = 0; x < 20; ++x)
      image.at<cv::Vec3b>(kMargin + y, left + x) =
          color_of(std::max(1e-3f, max_distance * (1 - static_cast<float>(y) / kBarHeight)), max_distance, 1e-9f);
  cv::rectangle(image, {left - 1, kMargin - 1, 22, kBarHeight + 2}, kInk);
  for (int i = 0; i <= 4; ++i)
    draw_text(image, fmt::format("{:.2f} m", max_distance * static_cast<float>(4 - i) / 4),
              {left + 28, kMargin + i * kBarHeight / 4 + 5});
  int y = kMargin + kBarHeight + 25;
  for (const auto& [color, label] : {std::pair{color_of(0, max_distance, 1), "surface"},
                                     {color_of(-1, max_distance, 0.1f), "behind it"},
                                     {kUnknownColor, "unknown"}}) {
    cv::rectangle(image, {left, y - 10, 20, 14}, cv::Scalar(color[0], color[1], color[2]), cv::FILLED);
    draw_text(image, label, {left + 28, y + 2});
    y += 24;
  }
}

/// Samples a surface with points at most `spacing` from each other.
template <class Visit>
void for_each_point(const Mesh& surface, float spacing, const Visit& visit) {
  for (const auto& t : surface.triangles) {
    const Eigen::Vector3f &a = surface.positions[t[0]], b = surface.positions[t[1]] - a,
                          c = surface.positions[t[2]] - a;
    const int steps = 1 + static_cast<int>(std::max({b.norm(), c.norm(), (b - c).norm()}) / spacing);
    for (int i = 0; i <= steps; ++i)
      for (int k = 0; k + i <= steps; ++k)
        visit(Eigen::Vector3f(a + (static_cast<float>(i) * b + static_cast<float>(k) * c) / static_cast<float>(steps)));
  }
}

}  // namespace

void write_slice(const std::filesystem::path& png, const DistanceField& field, int axis, float at) {
  const Eigen::AlignedBox3f box = field.bounds();
  if (at < box.min()[axis] || at > box.max()[axis])
    throw std::runtime_error(fmt::format("{}: the map has no data at {} = {}; it extends from {:.2f} to {:.2f}",
                                         png.string(), "xyz"[axis], at, box.min()[axis], box.max()[axis]));
  const SliceView view = slice_view(box, axis, at, field.voxel_size() / kMaxPixelsPerVoxel);
  const std::vector<DistanceField::Answer> answers = distances_on(view, field);
  float max_distance = 0;
  for (const auto& a : answers)
    if (a.known) max_distance = std::max(max_distance, a.distance);
  max_distance = std::max(0.1f, std::ceil(max_distance * 10) / 10);
  cv::Mat image(std::max(view.rows, 260) + 2 * kMargin, view.columns + 2 * kMargin + kLegendWidth, CV_8UC3,
                cv::Scalar::all(255));
  for (int row = 0; row < view.rows; ++row)
    for (int column = 0; column < view.columns; ++column) {
      const auto& a = answers[static_cast<std::size_t>(row * view.columns + column)];
      image.at<cv::Vec3b>(row + kMargin, column + kMargin) =
          a.known ? color_of(a.distance, max_distance, view.pixel) : kUnknownColor;
    }
  draw_text(image, fmt::format("signed distance at {} = {:.2f} m, lines every 0.25 m", "xyz"[axis], at), {kMargin, 40});
  draw_axes(image, view);
  draw_legend(image, 2 * kMargin - 30 + view.columns, max_distance);
  cv::cvtColor(image, image, cv::COLOR_BGR2RGB);
  write_png(png, image.cols, image.rows, {image.data, image.total() * 3});
}

Eigen::Vector3i Costmap::voxel_at(const Eigen::Vector3f& point) const {
  return ((point - origin_) / voxel_size_).array().round().cast<int>();
}

Costmap::Pixel* Costmap::find(int x, int z) {
  if (x < box_.min().x() || x > box_.max().x() || z < box_.min().z() || z > box_.max().z()) return nullptr;
  const int columns = box_.sizes().z() + 1;
  return &pixels_[static_cast<std::size_t>(x - box_.min().x()) * static_cast<std::size_t>(columns) +
                  static_cast<std::size_t>(z - box_.min().z())];
}

void Costmap::grow(const Eigen::AlignedBox3i& box) {
  const Eigen::AlignedBox3i before = box_;
  const std::vector<Pixel> pixels = std::move(pixels_);
  box_.extend(box);
  pixels_.assign(static_cast<std::size_t>(box_.sizes().x() + 1) * static_cast<std::size_t>(box_.sizes().z() + 1), {});
  auto from = pixels.begin();
  for (int x = before.min().x(); x <= before.max().x(); ++x) {
    const auto columns = before.sizes().z() + 1;
    std::copy(from, from + columns, find(x, before.min().z()));
    from += columns;
  }
}

void Costmap::add(const DistanceField& field, const Mesh& surface, const Eigen::AlignedBox3f& box,
                  const std::function<bool(const Eigen::Vector3f&)>& contains) {
  if (box.isEmpty()) return;
  if (box_.isEmpty()) {
    voxel_size_ = field.voxel_size();
    origin_ = box.min();
    first_ = static_cast<int>(std::ceil((-band_.high - origin_.y()) / voxel_size_ - 0.5f));
    last_ = static_cast<int>(std::floor((-band_.low - origin_.y()) / voxel_size_ + 0.5f));
  }
  blocks_ += field.blocks().size();
  const double max_pixels = static_cast<double>(kPixelsPerBlock) * static_cast<double>(blocks_) + double{kMinPixels};
  all_.extend(box);
  const Eigen::Vector3d cells = (all_.sizes() / voxel_size_).cast<double>();
  if (!((cells.x() + 2) * (cells.z() + 2) <= max_pixels))
    throw std::runtime_error(
        fmt::format("the map is too sparse for a costmap of its extent, {:.0f} by {:.0f} m; remove distant parts, or "
                    "make the map again",
                    all_.sizes().x(), all_.sizes().z()));
  const Eigen::AlignedBox3i voxels(voxel_at(box.min()), voxel_at(box.max()));
  grow(voxels);
  // Maximum distance of a voxel's surface from its center.
  const float half_diagonal = std::sqrt(3.0f) / 2 * voxel_size_;
  for (int x = voxels.min().x(); x <= voxels.max().x(); ++x)
    for (int z = voxels.min().z(); z <= voxels.max().z(); ++z) {
      Pixel& pixel = *find(x, z);
      for (int i = first_; i <= last_; ++i) {
        const Eigen::Vector3f p = origin_ + voxel_size_ * Eigen::Vector3i(x, i, z).cast<float>();
        if (contains && !contains(p)) continue;
        const auto answer = field.query(p);
        pixel.known += static_cast<std::uint16_t>(answer.known);
        pixel.is_occupied = pixel.is_occupied || (answer.known && answer.distance < half_diagonal);
      }
    }
  // At the border of the observed area, the surface extends slightly beyond the known voxels.
  for_each_point(surface, voxel_size_ / 2, [&](const Eigen::Vector3f& p) {
    if (-p.y() < band_.low || -p.y() > band_.high || (contains && !contains(p))) return;
    const Eigen::Vector3i at = voxel_at(p);
    if (Pixel* pixel = find(at.x(), at.z())) pixel->is_occupied = true;
  });
}

void Costmap::write(const std::filesystem::path& yaml) const {
  const auto meters = [&](const Eigen::Vector3i& voxel) {
    return Eigen::Vector3f(origin_ + voxel_size_ * voxel.cast<float>());
  };
  if (box_.isEmpty() || last_ < box_.min().y() || first_ > box_.max().y() || last_ < first_)
    throw std::runtime_error(fmt::format(
        "{}: the map has no data between {} and {} m{}", yaml.string(), band_.low, band_.high,
        box_.isEmpty()
            ? ""
            : fmt::format("; it extends from {:.2f} to {:.2f}", -meters(box_.max()).y(), -meters(box_.min()).y())));
  // ROS images are seen from above with x right and y up: x is the map's z, y its -x, z its -y.
  const int columns = box_.sizes().z() + 1, rows = box_.sizes().x() + 1, layers = last_ - first_ + 1;
  std::string image(pixels_.size(), '\0');
  std::transform(pixels_.begin(), pixels_.end(), image.begin(), [&](const Pixel& pixel) {
    return static_cast<char>(pixel.is_occupied ? kOccupied : 2 * pixel.known >= layers ? kFree : kUnknown);
  });
  auto pgm = yaml;
  pgm.replace_extension(".pgm");
  write_whole(pgm, fmt::format("P5\n{} {}\n255\n", columns, rows) + image);
  write_whole(yaml, fmt::format("image: {}\nresolution: {:g}\norigin: [{:.4f}, {:.4f}, 0.0]\nnegate: 0\n"
                                "occupied_thresh: 0.65\nfree_thresh: 0.196\n",
                                pgm.filename().string(), voxel_size_, meters(box_.min()).z() - voxel_size_ / 2,
                                -meters(box_.max()).x() - voxel_size_ / 2));
}

}  // namespace cairn::apps
