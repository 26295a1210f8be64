// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

namespace cairn {

/// Gaussian splats: 3D Gaussians with opacity and view-dependent color (Kerbl, Kopanas, Leimkühler & Drettakis 2023,
/// "3D Gaussian Splatting for Real-Time Radiance Field Rendering"). All vectors have the size of `positions`, except
/// `harmonics`.
struct Splats {
  std::vector<Eigen::Vector3f> positions;   ///< meters, world frame
  std::vector<Eigen::Vector3f> log_scales;  ///< natural logarithm of the standard deviations along the axes, meters
  std::vector<Eigen::Vector4f> rotations;   ///< world_from_splat as quaternion w, x, y, z; not normalized
  std::vector<float> opacities;             ///< logit of the opacity
  std::vector<Eigen::Vector3f> colors;      ///< harmonic of degree 0: R, G, B in 0..1 are 0.5 + 0.28209479 * color
  int degree = 0;                           ///< of the spherical harmonics, 0 to 3
  std::vector<Eigen::Vector3f> harmonics;   ///< harmonics_per_splat(degree) per splat, R, G, B, in the paper's order

  [[nodiscard]] std::size_t size() const { return positions.size(); }
};

/// Number of harmonics of degree 1 and above.
[[nodiscard]] constexpr std::size_t harmonics_per_splat(int degree) {
  return static_cast<std::size_t>((degree + 1) * (degree + 1) - 1);
}

/// Writes splats. The extension selects the format: .ply (that of the paper's program, in the world frame: x right, y
/// down, z forward), .spz (Niantic's, version 3, quantized: positions to 1/4096 m within 2 km, scales to 3 %) or .glb
/// (glTF with KHR_gaussian_splatting, floats), both with x right, y up, z back. Atomic. Throws std::runtime_error for
/// an unknown extension or an unwritable path.
void write_splats(const std::filesystem::path& file, const Splats& splats);

/// Reads a .ply or .spz file of write_splats or of another program. Throws std::runtime_error with the reason for a
/// file that is missing, damaged, or without splats.
[[nodiscard]] Splats read_splats(const std::filesystem::path& file);

/// True if a file is one of splats, by its extension and the properties in its header; false if it cannot be read.
[[nodiscard]] bool has_splats(const std::filesystem::path& file);

}  // namespace cairn
