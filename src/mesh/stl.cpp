// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Binary STL (3D Systems 1988): triangles for printing, without colors.
#include <bit>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "base/atomic_file.hpp"
#include "geometry/axes.hpp"
#include "mesh/formats.hpp"

namespace cairn {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::size_t kHeader = 80, kTriangle = 50;  // bytes

}  // namespace

void write_stl(const std::filesystem::path& file, const std::vector<Mesh>& parts, Axes axes) {
  axes = resolved(axes, Axes::z_up);  // the convention of printers
  std::size_t count = 0;
  for (const Mesh& mesh : parts) count += mesh.triangles.size();
  if (count > std::numeric_limits<std::uint32_t>::max())
    throw std::runtime_error(file.string() + ": STL is limited to 4,294,967,295 triangles; simplify the mesh");
  std::string bytes = "cairn, metres, " + described(axes);  // must not start with "solid", which marks text files
  bytes.resize(kHeader, ' ');
  bytes.reserve(kHeader + 4 + kTriangle * count);
  const auto put = [&](const auto& value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); };
  const auto put_vector = [&](const Eigen::Vector3f& v) {
    for (const float x : v) put(x);
  };
  put(static_cast<std::uint32_t>(count));
  for (const Mesh& mesh : parts)
    for (const auto& t : mesh.triangles) {
      const auto corner = [&](std::size_t k) { return from_world(mesh.positions[t[k]], axes); };
      const Eigen::Vector3f a = corner(0), b = corner(1), c = corner(2);
      put_vector((b - a).cross(c - a).normalized());
      for (const Eigen::Vector3f& p : {a, b, c}) put_vector(p);
      put(std::uint16_t{0});
    }
  write_whole(file, bytes);
}

}  // namespace cairn
