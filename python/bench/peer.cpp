// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// C++ side of compare.py: the same work, by the library alone.
// Usage: cairn_python_peer frames RECORDING FRAMES | distances FIELD.vdb POINTS REPEATS
#include <chrono>
#include <cstdio>
#include <exception>
#include <fstream>
#include <string>
#include <vector>

#include "cairn/io/source.hpp"
#include "cairn/mapping/mapper.hpp"

namespace {

constexpr std::size_t kWarm = 10;  // uncounted frames

double seconds() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

double frames_per_second(const std::string& recording, int count) {
  const auto source = cairn::open_source(recording, {.range = {.end = count}});
  std::vector<cairn::Frame> frames;
  while (auto frame = source->next()) frames.push_back(std::move(*frame));
  cairn::Mapper mapper(source->rig(), cairn::options_for(source->rig().sensor));
  double begin = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (i == kWarm) begin = seconds();
    mapper.add(frames[i]);
  }
  return static_cast<double>(frames.size() - kWarm) / (seconds() - begin);
}

double points_per_second(const std::string& vdb, const std::string& file, int repeats) {
  const auto field = cairn::DistanceField::read(vdb);
  std::ifstream in(file, std::ios::binary | std::ios::ate);
  std::vector<Eigen::Vector3f> points(static_cast<std::size_t>(in.tellg()) / sizeof(Eigen::Vector3f));
  in.seekg(0);
  in.read(reinterpret_cast<char*>(points.data()),
          static_cast<std::streamsize>(points.size() * sizeof(Eigen::Vector3f)));
  std::vector<cairn::DistanceField::Answer> answers(points.size());
  field.query(points, answers);
  const double begin = seconds();
  for (int i = 0; i < repeats; ++i) field.query(points, answers);
  return static_cast<double>(points.size()) * repeats / (seconds() - begin);
}

}  // namespace

int main(int argc, char** argv) try {
  const std::string what = argc > 1 ? argv[1] : "";
  if (what == "frames" && argc == 4)
    std::printf("%.6g\n", frames_per_second(argv[2], std::stoi(argv[3])));
  else if (what == "distances" && argc == 5)
    std::printf("%.6g\n", points_per_second(argv[2], argv[3], std::stoi(argv[4])));
  else
    return 2;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
