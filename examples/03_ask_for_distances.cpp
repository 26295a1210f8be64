// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Distances to the nearest surface, for a robot: from a finished map, or during mapping (EsdfOptions::live).
// Usage: 03_ask_for_distances [MAP]: a folder made by reconstruct; without MAP a synthetic room.
#include <cairn/io/source.hpp>
#include <cairn/mapping/mapper.hpp>
#include <cstdio>
#include <exception>
#include <memory>

namespace {

std::shared_ptr<const cairn::DistanceField> distances_of_a_room() {
  const auto source = cairn::open_source("synthetic:room", {.range = {.end = 10}});
  cairn::Options options;
  options.esdf.live = true;
  cairn::Mapper mapper(source->rig(), options);
  while (const auto frame = source->next()) mapper.add(*frame);
  return mapper.live_distances();  // state after the last frame; callable from any thread
}

}  // namespace

int main(int argc, char** argv) try {
  const auto distances = argc > 1 ? cairn::Map::open(argv[1]).distances() : distances_of_a_room();
  int known = 0;
  for (float z = 0; z <= 3; z += 0.5f) {
    const auto answer = distances->query({0, 0, z});
    known += answer.known;
    if (answer.known)
      std::printf("%.1f m ahead: %5.2f m to the nearest surface, gradient %5.2f %5.2f %5.2f\n", z, answer.distance,
                  answer.gradient.x(), answer.gradient.y(), answer.gradient.z());
    else
      std::printf("%.1f m ahead: unobserved\n", z);
  }
  return known > 0 ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
