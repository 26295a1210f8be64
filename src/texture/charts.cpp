// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "texture/charts.hpp"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <unordered_map>

#include "mesh/topology.hpp"

// stb's rectangle packer, a header with its implementation.
#define STB_RECT_PACK_IMPLEMENTATION
#define STBRP_STATIC
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#include <stb_rect_pack.h>
#pragma GCC diagnostic pop

namespace cairn {
namespace {

constexpr int kSide = shader::kTileSide;
constexpr int kPadding = 2;                // texels of padding around each chart
constexpr float kMinSmoothCosine = 0.62f;  // minimum cosine between a chart's axis and the smoothed normals in it
constexpr float kMinNormalCosine = 0.2f;   // same for the triangle's own normal
constexpr int kSmoothingIterations = 4;    // iterations for normals
constexpr float kSubtexels = 256;  // corner positions are rounded to these, so that adjacent triangles agree on the
                                   // owner of a texel

using Subtexels = Eigen::Matrix<std::int64_t, 2, 1>;  // fixed-point coordinates in an image

std::array<Subtexels, 3> in_subtexels(const std::array<Eigen::Vector2f, 3>& corners) {
  std::array<Subtexels, 3> p;
  for (std::size_t k = 0; k < 3; ++k)
    p[k] = {std::llround(corners[k].x() * kSubtexels), std::llround(corners[k].y() * kSubtexels)};
  return p;
}

/// Twice the signed area.
std::int64_t cross(const Subtexels& a, const Subtexels& b, const Subtexels& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

/// Calls `visit(x, y)` for texels with their center in the triangle; a center on a common side belongs to only one of
/// the two triangles.
template <class Visit>
void rasterize(std::array<Subtexels, 3> p, const Visit& visit) {
  const std::int64_t area = cross(p[0], p[1], p[2]);
  if (area == 0) return;
  if (area < 0) std::swap(p[1], p[2]);
  constexpr auto kOne = static_cast<std::int64_t>(kSubtexels), kHalf = kOne / 2;
  const Subtexels low = p[0].cwiseMin(p[1]).cwiseMin(p[2]), high = p[0].cwiseMax(p[1]).cwiseMax(p[2]);
  const auto first = [&](std::int64_t v) { return (v - kHalf + kOne - 1) >> 8; };
  const auto last = [&](std::int64_t v) { return (v - kHalf) >> 8; };
  std::array<std::int64_t, 3> bias;
  for (std::size_t k = 0; k < 3; ++k) {
    const Subtexels d = p[(k + 1) % 3] - p[k];
    bias[k] = d.y() < 0 || (d.y() == 0 && d.x() > 0) ? 0 : -1;
  }
  for (std::int64_t y = first(low.y()); y <= last(high.y()); ++y)
    for (std::int64_t x = first(low.x()); x <= last(high.x()); ++x) {
      const Subtexels at(x * kOne + kHalf, y * kOne + kHalf);
      if (cross(p[0], p[1], at) + bias[0] >= 0 && cross(p[1], p[2], at) + bias[1] >= 0 &&
          cross(p[2], p[0], at) + bias[2] >= 0)
        visit(static_cast<int>(x), static_cast<int>(y));
    }
}

struct Shape {
  std::vector<Eigen::Vector3f> normal, smooth;         // by triangle
  std::vector<float> area;                             // by triangle
  std::vector<std::array<std::uint32_t, 3>> adjacent;  // triangles at the sides, or kNone
};

Shape shape_of(const Mesh& mesh) {
  Shape shape;
  const std::size_t n = mesh.triangles.size();
  std::vector<Eigen::Vector3f> weighted;
  for (auto* values : {&weighted, &shape.normal, &shape.smooth}) values->reserve(n);
  shape.area.reserve(n);
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3f& a = mesh.positions[t[0]];
    const Eigen::Vector3f v = 0.5f * (mesh.positions[t[1]] - a).cross(mesh.positions[t[2]] - a);
    shape.area.push_back(v.norm());
    shape.normal.push_back(v / std::max(v.norm(), 1e-20f));
    weighted.push_back(v);
  }
  for (int i = 0; i < kSmoothingIterations; ++i) {
    std::vector<Eigen::Vector3f> of_vertex(mesh.positions.size(), Eigen::Vector3f::Zero());
    for (std::size_t t = 0; t < n; ++t)
      for (const std::uint32_t v : mesh.triangles[t]) of_vertex[v] += weighted[t];
    tbb::parallel_for(std::size_t{0}, n, [&](std::size_t t) {
      const auto& [a, b, c] = mesh.triangles[t];
      const Eigen::Vector3f mean = of_vertex[a] + of_vertex[b] + of_vertex[c];
      weighted[t] = shape.area[t] / std::max(mean.norm(), 1e-20f) * mean;
    });
  }
  for (std::size_t t = 0; t < n; ++t) shape.smooth.push_back(weighted[t].normalized());
  shape.adjacent.assign(n, {kNone, kNone, kNone});
  const std::vector<Side> sides = sides_by_edge(mesh, own_ids(mesh));
  for_each_edge(sides, [&](std::size_t begin, std::size_t end) {
    if (end - begin != 2) return;
    const Side &a = sides[begin], &b = sides[begin + 1];
    shape.adjacent[a.triangle][a.corner] = b.triangle;
    shape.adjacent[b.triangle][b.corner] = a.triangle;
  });
  return shape;
}

/// Axes of the chart's plane; the first is along the longer side of the minimum-area rectangle.
Eigen::Matrix<float, 2, 3> plane_of(const Mesh& mesh, const std::vector<std::uint32_t>& triangles,
                                    const Eigen::Vector3f& axis, float texel) {
  Eigen::Matrix<float, 2, 3> plane;
  const Eigen::Vector3f u = axis.unitOrthogonal();
  plane << u.transpose(), axis.cross(u).transpose();
  std::vector<cv::Point2f> points;
  for (const std::uint32_t t : triangles)
    for (const std::uint32_t v : mesh.triangles[t]) {
      const Eigen::Vector2f p = plane * mesh.positions[v];
      points.emplace_back(p.x(), p.y());
    }
  const cv::RotatedRect box = cv::minAreaRect(points);
  const float angle = (box.angle + (box.size.width < box.size.height ? 90.0f : 0.0f)) * static_cast<float>(CV_PI) / 180;
  return Eigen::Rotation2Df(-angle).toRotationMatrix() * plane / texel;
}

float texel_of(const Mesh& mesh, const std::vector<std::uint32_t>& triangles, std::span<const float> texels) {
  std::vector<float> sizes;
  for (const std::uint32_t t : triangles)
    for (const std::uint32_t v : mesh.triangles[t]) sizes.push_back(texels[v]);
  const auto quartile = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 4);
  std::nth_element(sizes.begin(), quartile, sizes.end());
  return *quartile;
}

Chart chart_of(const Mesh& mesh, std::vector<std::uint32_t> triangles, const Eigen::Matrix<float, 2, 3>& plane) {
  Chart chart{std::move(triangles), plane, Eigen::Vector2f::Constant(1e30f), Eigen::Vector2f::Constant(-1e30f)};
  for (const std::uint32_t t : chart.triangles)
    for (const std::uint32_t v : mesh.triangles[t]) {
      const Eigen::Vector2f p = plane * mesh.positions[v];
      chart.low = chart.low.cwiseMin(p);
      chart.high = chart.high.cwiseMax(p);
    }
  return chart;
}

Eigen::Vector2i size_of(const Chart& chart) {
  return (chart.high - chart.low).array().ceil().cast<int>() + 1 + 2 * kPadding;
}

/// Corners of a triangle in the image of its chart, texels.
std::array<Eigen::Vector2f, 3> corners_in(const Chart& chart, const Mesh& mesh, std::uint32_t triangle) {
  std::array<Eigen::Vector2f, 3> corners;
  for (std::size_t k = 0; k < 3; ++k)
    corners[k] = chart.plane * mesh.positions[mesh.triangles[triangle][k]] - chart.low +
                 Eigen::Vector2f::Constant(kPadding + 0.5f);
  return corners;
}

/// Removes triangles from a chart that would overlap others of the chart; returns them.
std::vector<std::uint32_t> remove_overlapping(Chart& chart, const Mesh& mesh) {
  const Eigen::Vector2i size = size_of(chart);
  std::vector<bool> covered(static_cast<std::size_t>(size.x()) * static_cast<std::size_t>(size.y()), false);
  const auto at = [&](int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(size.x()) + static_cast<std::size_t>(x);
  };
  std::vector<std::uint32_t> kept, out;
  for (const std::uint32_t t : chart.triangles) {
    const std::array<Subtexels, 3> p = in_subtexels(corners_in(chart, mesh, t));
    bool overlaps = false;
    rasterize(p, [&](int x, int y) { overlaps = overlaps || covered[at(x, y)]; });
    if (!overlaps) rasterize(p, [&](int x, int y) { covered[at(x, y)] = true; });
    (overlaps ? out : kept).push_back(t);
  }
  chart.triangles = std::move(kept);
  return out;
}

/// Splits charts that are too large for a texture.
std::vector<Chart> cut(const Mesh& mesh, Chart chart, int max_size) {
  const Eigen::Vector2i parts = size_of(chart).unaryExpr([&](int s) { return 1 + s / (max_size - 2 * kPadding); });
  std::vector<Chart> charts;
  if (parts == Eigen::Vector2i::Ones()) {
    charts.push_back(std::move(chart));
    return charts;
  }
  std::vector<std::vector<std::uint32_t>> of(static_cast<std::size_t>(parts.prod()));
  const Eigen::Vector2f step = (chart.high - chart.low).cwiseQuotient(parts.cast<float>());
  for (const std::uint32_t t : chart.triangles) {
    const auto& [a, b, c] = mesh.triangles[t];
    const Eigen::Vector2f middle =
        chart.plane * ((mesh.positions[a] + mesh.positions[b] + mesh.positions[c]) / 3) - chart.low;
    const Eigen::Vector2i cell =
        middle.cwiseQuotient(step).cast<int>().cwiseMin((parts.array() - 1).matrix()).cwiseMax(0);
    of[static_cast<std::size_t>(cell.y() * parts.x() + cell.x())].push_back(t);
  }
  for (auto& triangles : of)
    if (!triangles.empty()) charts.push_back(chart_of(mesh, std::move(triangles), chart.plane));
  return charts;
}

/// Rectangles of the charts in the texture.
struct Layout {
  int width = 0, height = 1;
  std::vector<stbrp_rect> rects;
};

std::optional<Layout> lay_out(const std::vector<Chart>& charts, int max_size) {
  Layout layout;
  double area = 0;
  int widest = 0;
  for (std::size_t i = 0; i < charts.size(); ++i) {
    const Eigen::Vector2i size = size_of(charts[i]);
    layout.rects.push_back({static_cast<int>(i), size.x(), size.y(), 0, 0, 0});
    area += static_cast<double>(size.x()) * size.y();
    widest = std::max(widest, size.x());
  }
  if (area > static_cast<double>(max_size) * max_size || widest > max_size) return std::nullopt;
  layout.width = std::min(max_size, std::max(widest, (static_cast<int>(std::sqrt(1.06 * area)) + 15) / 16 * 16));
  std::vector<stbrp_node> nodes(static_cast<std::size_t>(layout.width));
  stbrp_context context;
  stbrp_init_target(&context, layout.width, max_size, nodes.data(), layout.width);
  if (!charts.empty() && stbrp_pack_rects(&context, layout.rects.data(), static_cast<int>(charts.size())) == 0)
    return std::nullopt;
  for (const stbrp_rect& r : layout.rects) layout.height = std::max(layout.height, r.y + r.h);
  return layout;
}

/// The mesh with texture coordinates and a separate vertex per chart.
Mesh unwrapped(const Mesh& mesh, const std::vector<Chart>& charts, const Layout& layout) {
  Mesh result;
  result.texture.width = layout.width;
  result.texture.height = layout.height;
  const Eigen::Vector2f scale(1.0f / static_cast<float>(layout.width), 1.0f / static_cast<float>(layout.height));
  std::vector<std::uint32_t> original;  // by vertex of the result
  std::vector<Eigen::Vector2f> texture_coordinates;
  for (std::size_t i = 0; i < charts.size(); ++i) {
    const Eigen::Vector2f offset(static_cast<float>(layout.rects[i].x), static_cast<float>(layout.rects[i].y));
    std::unordered_map<std::uint32_t, std::uint32_t> vertex;
    for (const std::uint32_t t : charts[i].triangles) {
      const auto corners = corners_in(charts[i], mesh, t);
      auto& triangle = result.triangles.emplace_back();
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t v = mesh.triangles[t][k];
        const auto [it, is_new] = vertex.try_emplace(v, static_cast<std::uint32_t>(original.size()));
        if (is_new) {
          original.push_back(v);
          texture_coordinates.push_back((corners[k] + offset).cwiseProduct(scale));
        }
        triangle[k] = it->second;
      }
    }
  }
  result.positions = mesh.positions;
  result.normals = mesh.normals;
  result.colors = mesh.colors;
  take_vertices(result, original);
  result.texture_coordinates = std::move(texture_coordinates);
  return result;
}

/// Triangle at each texel of a chart's rectangle, or kNone.
struct TriangleImage {
  int width, height;
  std::vector<std::uint32_t> triangles;

  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  }
  [[nodiscard]] bool contains(int x, int y) const { return x >= 0 && y >= 0 && x < width && y < height; }
};

/// Extends the chart by the padding for texture filters: each padding texel gets an adjacent triangle.
void dilate(TriangleImage& image) {
  for (int ring = 0; ring < kPadding; ++ring) {
    const std::vector<std::uint32_t> before = image.triangles;
    for (int y = 0; y < image.height; ++y)
      for (int x = 0; x < image.width; ++x)
        for (const auto& [dx, dy] : {std::pair(-1, 0), {1, 0}, {0, -1}, {0, 1}, {-1, -1}, {1, -1}, {-1, 1}, {1, 1}})
          if (std::uint32_t& t = image.triangles[image.index(x, y)]; t == kNone && image.contains(x + dx, y + dy))
            t = before[image.index(x + dx, y + dy)];
  }
}

/// Rasterizes a chart. Slivers may cover no texel center; their surroundings are colored nevertheless.
TriangleImage draw(const Chart& chart, const Mesh& mesh, int width, int height, std::uint32_t first) {
  TriangleImage image{width, height, {}};
  image.triangles.assign(image.index(0, height), kNone);
  for (std::uint32_t i = 0; i < chart.triangles.size(); ++i)
    rasterize(in_subtexels(corners_in(chart, mesh, chart.triangles[i])),
              [&](int x, int y) { image.triangles[image.index(x, y)] = first + i; });
  dilate(image);
  return image;
}

/// Tiles of a chart. `first`: index of its first triangle in the atlas mesh.
std::vector<TextureAtlas::Tile> tiles_of(const Chart& chart, const Mesh& mesh, const stbrp_rect& rect,
                                         std::uint32_t first) {
  const TriangleImage image = draw(chart, mesh, rect.w, rect.h, first);
  std::vector<TextureAtlas::Tile> tiles;
  for (int y = 0; y < rect.h; y += kSide)
    for (int x = 0; x < rect.w; x += kSide) {
      TextureAtlas::Tile tile{.x = rect.x + x, .y = rect.y + y};
      bool any = false;
      for (int k = 0; k < kSide * kSide; ++k) {
        const int tx = x + k % kSide, ty = y + k / kSide;
        std::uint32_t& triangle = tile.triangles[static_cast<std::size_t>(k)];
        triangle = image.contains(tx, ty) ? image.triangles[image.index(tx, ty)] : kNone;
        any = any || triangle != kNone;
      }
      if (any) tiles.push_back(tile);
    }
  return tiles;
}

/// Triangles in the order in which charts grow from them, the largest flat ones first.
std::vector<std::uint32_t> by_flatness(const Shape& shape) {
  std::vector<std::pair<float, std::uint32_t>> order(shape.area.size());
  tbb::parallel_for(std::size_t{0}, order.size(), [&](std::size_t t) {
    order[t] = {-shape.area[t] * shape.normal[t].dot(shape.smooth[t]), static_cast<std::uint32_t>(t)};
  });
  tbb::parallel_sort(order);
  std::vector<std::uint32_t> triangles(order.size());
  std::transform(order.begin(), order.end(), triangles.begin(), [](const auto& o) { return o.second; });
  return triangles;
}

}  // namespace

std::vector<Chart> make_charts(const Mesh& mesh, std::span<const float> texels, int max_size) {
  const Shape shape = shape_of(mesh);
  const std::size_t n = mesh.triangles.size();
  std::vector<Chart> charts;
  std::vector<std::uint32_t> visit(n, 0);  // by triangle: the last growth that reached it
  std::vector<bool> taken(n, false);
  std::uint32_t growth = 0;
  const auto grow = [&](std::uint32_t seed, const Eigen::Vector3f& axis) {
    ++growth;
    std::vector<std::uint32_t> triangles{seed};
    visit[seed] = growth;
    for (std::size_t i = 0; i < triangles.size(); ++i)
      for (const std::uint32_t next : shape.adjacent[triangles[i]]) {
        if (next == kNone || taken[next] || visit[next] == growth) continue;
        visit[next] = growth;
        if (shape.smooth[next].dot(axis) > kMinSmoothCosine && shape.normal[next].dot(axis) > kMinNormalCosine)
          triangles.push_back(next);
      }
    return triangles;
  };
  std::vector<std::uint32_t> seeds = by_flatness(shape);
  while (!seeds.empty()) {
    std::vector<std::uint32_t> retry;
    for (const std::uint32_t seed : seeds) {
      if (taken[seed]) continue;
      const Eigen::Vector3f first =
          shape.smooth[seed].dot(shape.normal[seed]) > kMinNormalCosine ? shape.smooth[seed] : shape.normal[seed];
      std::vector<std::uint32_t> triangles = grow(seed, first);
      Eigen::Vector3f axis = first;
      if (triangles.size() > 1) {
        Eigen::Vector3f mean = Eigen::Vector3f::Zero();
        for (const std::uint32_t t : triangles) mean += shape.area[t] * shape.normal[t];
        mean.normalize();
        if (shape.normal[seed].dot(mean) > kMinNormalCosine) axis = mean, triangles = grow(seed, axis);
      }
      Chart chart = chart_of(mesh, triangles, plane_of(mesh, triangles, axis, texel_of(mesh, triangles, texels)));
      for (const std::uint32_t t : triangles) taken[t] = true;
      for (const std::uint32_t t : remove_overlapping(chart, mesh)) {
        taken[t] = false;
        retry.push_back(t);
      }
      for (Chart& part : cut(mesh, chart_of(mesh, std::move(chart.triangles), chart.plane), max_size))
        charts.push_back(std::move(part));
    }
    seeds = std::move(retry);
  }
  return charts;
}

std::optional<TextureAtlas> pack(const Mesh& mesh, const std::vector<Chart>& charts, int max_size) {
  const std::optional<Layout> layout = lay_out(charts, max_size);
  if (!layout) return std::nullopt;
  TextureAtlas atlas;
  atlas.charts = static_cast<int>(charts.size());
  atlas.mesh = unwrapped(mesh, charts, *layout);
  std::vector<std::uint32_t> first;  // first triangle of each chart
  std::uint32_t triangles = 0;
  for (const Chart& chart : charts) {
    first.push_back(triangles);
    triangles += static_cast<std::uint32_t>(chart.triangles.size());
  }
  std::vector<std::vector<TextureAtlas::Tile>> of_chart(charts.size());
  tbb::parallel_for(std::size_t{0}, charts.size(),
                    [&](std::size_t i) { of_chart[i] = tiles_of(charts[i], mesh, layout->rects[i], first[i]); });
  std::size_t count = 0;
  for (const auto& tiles : of_chart) count += tiles.size();
  atlas.tiles.reserve(count);
  for (auto& tiles : of_chart) {
    atlas.tiles.insert(atlas.tiles.end(), tiles.begin(), tiles.end());
    tiles = {};
  }
  return atlas;
}

std::size_t TextureAtlas::texel(const Tile& tile, std::size_t k) const {
  const auto x = static_cast<std::size_t>(tile.x) + k % kSide, y = static_cast<std::size_t>(tile.y) + k / kSide;
  return y * static_cast<std::size_t>(mesh.texture.width) + x;
}

shader::Texel TextureAtlas::point(const Tile& tile, std::size_t k) const {
  if (tile.triangles[k] == kNone) return {};
  const auto& triangle = mesh.triangles[tile.triangles[k]];
  const auto at = [&](std::size_t corner) -> Eigen::Vector2f {
    return mesh.texture_coordinates[triangle[corner]].cwiseProduct(
        Eigen::Vector2f(static_cast<float>(mesh.texture.width), static_cast<float>(mesh.texture.height)));
  };
  const auto i = static_cast<int>(k);
  const int x = tile.x + i % kSide, y = tile.y + i / kSide;
  const Eigen::Vector2f texel(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
  const Eigen::Vector2f a = at(0), ab = at(1) - a, ac = at(2) - a, q = texel - a;
  const float area = ab.x() * ac.y() - ab.y() * ac.x();
  float b = 0, c = 0;
  if (std::abs(area) > 1e-9f) {
    b = (q.x() * ac.y() - q.y() * ac.x()) / area;
    c = (ab.x() * q.y() - ab.y() * q.x()) / area;
  }
  const std::array<float, 3> weight{1 - b - c, b, c};
  Eigen::Vector3f position = Eigen::Vector3f::Zero(), normal = position, color = position;
  for (std::size_t corner = 0; corner < 3; ++corner) {
    const std::uint32_t v = triangle[corner];
    position += weight[corner] * mesh.positions[v];
    const float inside = std::clamp(weight[corner], 0.0f, 1.0f);
    if (!mesh.normals.empty()) normal += inside * mesh.normals[v];
    if (!mesh.colors.empty())
      color += inside * Eigen::Vector3f(mesh.colors[v][0], mesh.colors[v][1], mesh.colors[v][2]);
  }
  const auto byte = [](float f) { return static_cast<std::uint32_t>(std::lround(std::clamp(f, 0.0f, 255.0f))); };
  return {position, shader::pack_normal(normal.norm() > 1e-6f ? normal : Eigen::Vector3f::UnitZ()),
          byte(color.x()) | byte(color.y()) << 8 | byte(color.z()) << 16};
}

void fill_between(Texture& texture, std::vector<bool> known) {
  struct Level {
    int width, height;
    std::vector<Eigen::Vector3f> color;
    std::vector<float> weight;
  };
  // Pull-push (Gortler et al. 1996): means of known texels at coarser and coarser levels, then each unknown texel from
  // the next coarser level.
  const auto index = [](int width, int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  };
  std::vector<Level> levels;
  const auto halved = [&](int width, int height, const auto& color, const auto& weight) {
    Level half{(width + 1) / 2, (height + 1) / 2, {}, {}};
    half.color.resize(index(half.width, 0, half.height));
    half.weight.resize(half.color.size());
    tbb::parallel_for(0, half.height, [&](int y) {
      for (int x = 0; x < half.width; ++x) {
        Eigen::Vector3f sum = Eigen::Vector3f::Zero();
        float total = 0;
        for (int k = 0; k < 4; ++k) {
          const int fx = 2 * x + (k & 1), fy = 2 * y + (k >> 1);
          if (fx >= width || fy >= height) continue;
          const float w = weight(index(width, fx, fy));
          sum += w * color(index(width, fx, fy));
          total += w;
        }
        half.color[index(half.width, x, y)] = total > 0 ? Eigen::Vector3f(sum / total) : sum;
        half.weight[index(half.width, x, y)] = total > 0 ? 1.0f : 0.0f;
      }
    });
    return half;
  };
  const auto vector = [&](std::size_t i) {
    return Eigen::Vector3f(texture.texels[i][0], texture.texels[i][1], texture.texels[i][2]);
  };
  levels.push_back(
      halved(texture.width, texture.height, vector, [&](std::size_t i) { return known[i] ? 1.0f : 0.0f; }));
  while (levels.back().width > 1 || levels.back().height > 1) {
    const Level& fine = levels.back();
    levels.push_back(halved(
        fine.width, fine.height, [&](std::size_t i) { return fine.color[i]; },
        [&](std::size_t i) { return fine.weight[i]; }));
  }
  for (std::size_t l = levels.size() - 1; l-- > 0;) {
    Level& fine = levels[l];
    const Level& coarse = levels[l + 1];
    for (int y = 0; y < fine.height; ++y)
      for (int x = 0; x < fine.width; ++x)
        if (const std::size_t i = index(fine.width, x, y); fine.weight[i] == 0)
          fine.color[i] = coarse.color[index(coarse.width, x / 2, y / 2)];
  }
  for (int y = 0; y < texture.height; ++y)
    for (int x = 0; x < texture.width; ++x)
      if (const std::size_t i = index(texture.width, x, y); !known[i])
        for (int c = 0; c < 3; ++c)
          texture.texels[i][static_cast<std::size_t>(c)] =
              static_cast<std::uint8_t>(std::lround(levels[0].color[index(levels[0].width, x / 2, y / 2)][c]));
}

}  // namespace cairn
