// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Reconstructs a mesh and a trajectory from a recording.
// Usage: 01_reconstruct_a_folder [RECORDING [OUT]]; without RECORDING a synthetic room.
#include <cairn/io/source.hpp>
#include <cairn/mapping/mapper.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>

int main(int argc, char** argv) try {
  const std::string recording = argc > 1 ? argv[1] : "synthetic:room";
  const std::filesystem::path out = argc > 2 ? argv[2] : "out/01";
  std::filesystem::create_directories(out);

  const auto source = cairn::open_source(recording, {.range = {.end = 40}});
  cairn::Mapper mapper(source->rig());
  while (const auto frame = source->next()) {
    const cairn::FrameReport report = mapper.add(*frame);
    if (report.state != cairn::FrameState::fused) std::printf("frame %d: %s\n", report.index, report.reason.c_str());
  }
  mapper.finish();  // apply all loop closures
  cairn::write_trajectory(out / "trajectory.txt", mapper.trajectory());
  const cairn::ExportReport mesh = mapper.map().export_mesh(out / "mesh.glb");
  std::printf("%zu poses, %zu triangles in %s\n", mapper.trajectory().size(), mesh.triangles, out.c_str());
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
