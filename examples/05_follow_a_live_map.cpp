// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Maps a live stream: always takes the newest frame, so a slow computer drops frames. Reports changes of the surface,
// as a viewer needs them. Usage: 05_follow_a_live_map [SOURCE]: openni: for a sensor, or a recording, played in real
// time
#include <cairn/io/live_source.hpp>
#include <cairn/mapping/live_surface.hpp>
#include <cairn/mapping/mapper.hpp>
#include <cstdio>
#include <exception>
#include <memory>

int main(int argc, char** argv) try {
  const std::string name = argc > 1 ? argv[1] : "synthetic:room";
  cairn::LiveSource source(cairn::open_source(name, {.range = {.end = 60}}),
                           cairn::is_sensor(name) ? cairn::Pace::as_it_comes : cairn::Pace::as_recorded);
  cairn::Mapper mapper(source.rig());
  cairn::LiveSurface surface(mapper);
  std::size_t parts = 0, triangles = 0;
  while (const auto frame = source.next()) {
    const cairn::FrameReport report = mapper.add(*frame);
    for (const cairn::SurfaceBlock& part : surface.changes(200).parts) {
      ++parts;  // a viewer replaces its mesh of part.submap and part.cell
      triangles += part.mesh.triangles.size();
    }
    std::printf("frame %d %s: %zu parts so far, %zu triangles, %d frames dropped\n", report.index,
                report.state == cairn::FrameState::fused ? "fused" : report.reason.c_str(), parts, triangles,
                source.dropped());
  }
  return parts > 0 ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
