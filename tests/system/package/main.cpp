// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Reconstructs a plane with the installed library.
#include <cairn/mapping/mapper.hpp>
#include <cstdio>

int main() {
  cairn::Mapper mapper(cairn::Camera{});
  cairn::Frame frame;
  for (int i = 0; i < 640 * 480; ++i) frame.depth.push_back(1.5f + 0.0005f * static_cast<float>(i % 640));  // a wall
  if (mapper.add(frame).state != cairn::FrameState::fused) return 1;
  const cairn::Mesh mesh = mapper.map().mesh();
  std::printf("%zu triangles\n", mesh.triangles.size());
  return mesh.triangles.empty() ? 1 : 0;
}
