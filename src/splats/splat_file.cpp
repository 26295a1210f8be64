// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <cmath>
#include <fstream>
#include <stdexcept>
#include <string>

#include "base/atomic_file.hpp"
#include "base/file_name.hpp"
#include "base/read_whole.hpp"
#include "cairn/mapping/splats.hpp"
#include "splats/formats.hpp"

namespace cairn {
namespace {

[[noreturn]] void unknown(const std::filesystem::path& file, const std::string& known) {
  throw std::runtime_error(file.string() + ": '" + file.extension().string() +
                           "' is not a supported format of splats; use " + known);
}

/// Throws std::runtime_error for a splat that cannot be rendered.
void check_finite(const Splats& splats) {
  for (std::size_t i = 0; i < splats.size(); ++i)
    if (!splats.positions[i].allFinite() || !splats.log_scales[i].allFinite() || !splats.rotations[i].allFinite() ||
        !std::isfinite(splats.opacities[i]) || !splats.colors[i].allFinite())
      throw std::runtime_error("splat " + std::to_string(i) + " has a value that is not finite");
  for (const Eigen::Vector3f& harmonic : splats.harmonics)
    if (!harmonic.allFinite()) throw std::runtime_error("a spherical harmonic is not finite");
}

}  // namespace

void write_splats(const std::filesystem::path& file, const Splats& splats) {
  const std::string extension = extension_of(file);
  if (extension == ".ply")
    write_splat_ply(file, splats);
  else if (extension == ".spz")
    write_whole(file, spz_of(splats));
  else if (extension == ".glb")
    write_whole(file, splat_glb_of(splats));
  else
    unknown(file, ".ply, .spz or .glb");
}

Splats read_splats(const std::filesystem::path& file) {
  const std::string extension = extension_of(file);
  if (extension != ".ply" && extension != ".spz") unknown(file, ".ply or .spz");
  try {
    const std::vector<std::uint8_t> bytes = read_whole(file, kAnySize);
    Splats splats = extension == ".spz" ? read_spz(bytes) : read_splat_ply(bytes);
    check_finite(splats);
    return splats;
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
}

bool has_splats(const std::filesystem::path& file) {
  constexpr std::size_t kMaxHeader = 4096;  // bytes; the largest of the common format has 1,500
  if (extension_of(file) == ".spz") return true;
  if (extension_of(file) != ".ply") return false;
  std::string header(kMaxHeader, '\0');
  std::ifstream in(file, std::ios::binary);
  in.read(header.data(), static_cast<std::streamsize>(header.size()));
  header.resize(static_cast<std::size_t>(in.gcount()));
  return header.substr(0, header.find("end_header")).find(" f_dc_0\n") != std::string::npos;
}

}  // namespace cairn
