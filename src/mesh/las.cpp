// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// LAS 1.4 (ASPRS, specification R15): points of record format 7, with colors.
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>

#include "base/atomic_file.hpp"
#include "geometry/axes.hpp"
#include "mesh/formats.hpp"

namespace cairn {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::uint16_t kHeaderBytes = 375, kPointBytes = 36;
constexpr double kStep = 1e-4;              // meters of a coordinate
constexpr std::uint16_t kHasWkt = 1 << 4;   // of the global encoding; required by this record format
constexpr std::uint8_t kOnlyReturn = 0x11;  // first return of one

class Bytes {
 public:
  template <class T>
  void put(const T& value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void text(std::string_view value, std::size_t length) {
    bytes_ += value;
    bytes_.resize(bytes_.size() + length - value.size(), '\0');
  }
  void zeros(std::size_t count) { bytes_.resize(bytes_.size() + count, '\0'); }
  [[nodiscard]] const std::string& all() const { return bytes_; }
  void reserve(std::size_t count) { bytes_.reserve(count); }

 private:
  std::string bytes_;
};

void put_header(Bytes& out, std::uint64_t count, const Eigen::AlignedBox3d& box) {
  out.text("LASF", 4);
  out.put(std::uint16_t{0});
  out.put(kHasWkt);
  out.zeros(16);             // project
  out.put(std::uint8_t{1});  // version 1.4
  out.put(std::uint8_t{4});
  out.text("OTHER", 32);  // system
  out.text("Cairn", 32);
  out.put(std::uint16_t{0});  // day and year: unknown
  out.put(std::uint16_t{0});
  out.put(kHeaderBytes);
  out.put(std::uint32_t{kHeaderBytes});  // the points follow
  out.put(std::uint32_t{0});             // variable length records
  out.put(std::uint8_t{7});
  out.put(kPointBytes);
  out.zeros(4 + 5 * 4);  // counts of older versions
  for (int axis = 0; axis < 3; ++axis) out.put(kStep);
  for (int axis = 0; axis < 3; ++axis) out.put(0.0);  // offsets
  for (int axis = 0; axis < 3; ++axis) {
    out.put(box.max()[axis]);
    out.put(box.min()[axis]);
  }
  out.zeros(8 + 8 + 4);  // waveforms, and extended records
  out.put(count);
  out.put(count);  // of first returns
  out.zeros(14 * 8);
}

}  // namespace

void write_las(const std::filesystem::path& file, const Mesh& points, Axes axes) {
  axes = resolved(axes, Axes::z_up);  // the convention of surveying
  std::vector<std::array<std::int32_t, 3>> steps(points.positions.size());
  Eigen::AlignedBox3d box;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const Eigen::Vector3d p = from_world(points.positions[i], axes).cast<double>();
    for (int axis = 0; axis < 3; ++axis) {
      const double step = std::round(p[axis] / kStep);
      if (!(std::abs(step) < std::numeric_limits<std::int32_t>::max()))
        throw std::runtime_error(file.string() + ": LAS is limited to 214 km around the origin");
      steps[i][static_cast<std::size_t>(axis)] = static_cast<std::int32_t>(step);
    }
    box.extend(kStep * Eigen::Vector3d(steps[i][0], steps[i][1], steps[i][2]));
  }
  if (steps.empty()) box.extend(Eigen::Vector3d::Zero());
  Bytes out;
  out.reserve(kHeaderBytes + steps.size() * kPointBytes);
  put_header(out, steps.size(), box);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    for (const std::int32_t step : steps[i]) out.put(step);
    out.put(std::uint16_t{0});  // intensity
    out.put(kOnlyReturn);
    out.zeros(1 + 1 + 1 + 2 + 2 + 8);  // flags, class, user data, angle, source, time
    for (std::size_t c = 0; c < 3; ++c)
      out.put(static_cast<std::uint16_t>(points.colors.empty() ? 0 : 257 * points.colors[i][c]));
  }
  write_whole(file, out.all());
}

}  // namespace cairn
