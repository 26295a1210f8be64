// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Shared code of the mesh file targets, which differ only in the extension.
#pragma once
#include "cairn/mapping/mesh.hpp"
#include "fuzz.hpp"

namespace cairn::fuzz {

/// Reads the bytes as a mesh file with this name, and checks that all its parts are consistent.
inline void read_parts(const char* name, const std::uint8_t* data, std::size_t size) {
  const auto file = file_of(name, text_of(data, size));
  expect_value_or_plain_error([&] {
    for (const Mesh& part : read_mesh_parts(file)) {
      const std::size_t count = part.positions.size();
      for (const auto& position : part.positions) touch(position);
      for (const auto& triangle : part.triangles)
        for (const std::uint32_t index : triangle)
          if (index >= count) std::abort();
      if (!part.normals.empty() && part.normals.size() != count) std::abort();
      if (!part.colors.empty() && part.colors.size() != count) std::abort();
      if (!part.sigmas.empty() && part.sigmas.size() != count) std::abort();
      if (!part.texture_coordinates.empty() && part.texture_coordinates.size() != count) std::abort();
    }
  });
}

}  // namespace cairn::fuzz
