// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "cairn/mapping/splats.hpp"

// One pair of functions per file format; for common behavior see write_splats and read_splats.
namespace cairn {

void write_splat_ply(const std::filesystem::path& file, const Splats& splats);
[[nodiscard]] Splats read_splat_ply(std::span<const std::uint8_t> bytes);
/// Bytes of a .spz file.
[[nodiscard]] std::string spz_of(const Splats& splats);
[[nodiscard]] Splats read_spz(std::span<const std::uint8_t> bytes);
/// Bytes of a .glb file with KHR_gaussian_splatting.
[[nodiscard]] std::string splat_glb_of(const Splats& splats);

/// Signs of the harmonics of degree 1 to 3 after the rotation from the world to y up, by 180 degrees about x.
inline constexpr std::array<float, 15> kYUpHarmonicSigns = {-1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1};
/// Unit quaternion x, y, z, w in y-up axes of a rotation w, x, y, z; the identity for zero.
[[nodiscard]] inline Eigen::Vector4f y_up_rotation(const Eigen::Vector4f& wxyz) {
  const Eigen::Vector4f q(wxyz[1], -wxyz[2], -wxyz[3], wxyz[0]);
  return q.norm() > 0 ? q.normalized() : Eigen::Vector4f::UnitW();
}

}  // namespace cairn
