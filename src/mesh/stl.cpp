// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Binary STL (3D Systems 1988): triangles for printing, without colours.
#include <bit>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "cairn/atomic_file.hpp"
#include "mesh/formats.hpp"

namespace cairn {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::size_t kHeader = 80, kTriangle = 50;  // bytes

/// The world is y down and z forward; printers have z up, and forward becomes y.
Eigen::Vector3f upright(const Eigen::Vector3f& p) { return {p.x(), p.z(), -p.y()}; }

}  // namespace

void write_stl(const std::filesystem::path& file, const std::vector<Mesh>& parts) {
  std::size_t count = 0;
  for (const Mesh& mesh : parts) count += mesh.triangles.size();
  if (count > std::numeric_limits<std::uint32_t>::max())
    throw std::runtime_error(file.string() + ": STL holds no more than 4,294,967,295 triangles; simplify it");
  std::string bytes = "cairn, metres, z up";  // not "solid", by which readers tell text
  bytes.resize(kHeader, ' ');
  bytes.reserve(kHeader + 4 + kTriangle * count);
  const auto put = [&](const auto& value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); };
  const auto put_vector = [&](const Eigen::Vector3f& v) {
    for (const float x : v) put(x);
  };
  put(static_cast<std::uint32_t>(count));
  for (const Mesh& mesh : parts)
    for (const auto& t : mesh.triangles) {
      const Eigen::Vector3f a = upright(mesh.positions[t[0]]), b = upright(mesh.positions[t[1]]),
                            c = upright(mesh.positions[t[2]]);
      put_vector((b - a).cross(c - a).normalized());
      for (const Eigen::Vector3f& p : {a, b, c}) put_vector(p);
      put(std::uint16_t{0});
    }
  write_whole(file, bytes);
}

}  // namespace cairn
