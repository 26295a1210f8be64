// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <cassert>
#include <utility>

#include "volume/polygonize.hpp"

namespace cairn {
namespace {

// Corners of the six faces, counter-clockwise seen from outside; corner c is at (c & 1, c >> 1 & 1, c >> 2).
constexpr int kFaces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};

std::uint32_t edge_between(int a, int b) {
  const int difference = a ^ b;  // a single bit: the axis
  const int axis = difference == 1 ? 0 : difference == 2 ? 1 : 2;
  return static_cast<std::uint32_t>((a & b) | axis << 3);
}

}  // namespace

std::array<std::uint32_t, 256 * 16> marching_cubes_table() {
  std::array<std::uint32_t, 256 * 16> table{};
  for (int inside = 1; inside < 255; ++inside) {
    const auto is_inside = [&](int corner) { return (inside >> corner & 1) != 0; };
    // On each face, connects the edge at which its outline enters the solid to the edge at which the outline next
    // leaves. The exit edge of a face is the entry edge of its neighbor, so the segments close to loops.
    constexpr std::uint32_t kNone = 99;
    std::array<std::uint32_t, 24> next;
    next.fill(kNone);
    for (const auto& face : kFaces) {
      for (int i = 0; i < 4; ++i) {
        if (is_inside(face[i]) || !is_inside(face[(i + 1) % 4])) continue;
        int j = (i + 1) % 4;
        while (is_inside(face[(j + 1) % 4])) j = (j + 1) % 4;
        next[edge_between(face[i], face[(i + 1) % 4])] = edge_between(face[j], face[(j + 1) % 4]);
      }
    }
    std::uint32_t* row = &table[static_cast<std::size_t>(inside) * 16];
    for (std::uint32_t start = 0; start < next.size(); ++start) {
      if (next[start] == kNone) continue;
      std::vector<std::uint32_t> loop;
      for (std::uint32_t edge = start; next[edge] != kNone;) {
        loop.push_back(edge);
        edge = std::exchange(next[edge], kNone);
      }
      for (std::size_t i = 1; i + 1 < loop.size(); ++i) {
        assert(row[0] < 5);
        std::uint32_t* triangle = row + 1 + 3 * row[0]++;
        triangle[0] = loop[0], triangle[1] = loop[i], triangle[2] = loop[i + 1];
      }
    }
  }
  return table;
}

}  // namespace cairn
