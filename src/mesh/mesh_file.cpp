// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <stdexcept>

#include "mesh/formats.hpp"

namespace cairn {
namespace {

[[noreturn]] void unknown(const std::filesystem::path& file) {
  throw std::runtime_error(file.string() + ": '" + file.extension().string() +
                           "' is no mesh format that is known; use .glb, .gltf or .ply");
}

}  // namespace

void write_mesh(const std::filesystem::path& file, const Mesh& mesh) {
  const auto extension = file.extension();
  if (extension == ".glb" || extension == ".gltf") return write_gltf(file, mesh);
  if (extension == ".ply") return write_ply(file, mesh);
  unknown(file);
}

Mesh read_mesh(const std::filesystem::path& file) {
  const auto extension = file.extension();
  if (extension == ".glb" || extension == ".gltf") return read_gltf(file);
  if (extension == ".ply") return read_ply(file);
  unknown(file);
}

}  // namespace cairn
