// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <gtest/gtest.h>

#include <fstream>
#include <random>
#include <sstream>

#include "cairn/mapping/splats.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

Splats random_splats(int degree) {
  std::minstd_rand random(9);
  const auto value = [&] { return std::uniform_real_distribution<float>(-2, 2)(random); };
  Splats splats;
  splats.degree = degree;
  for (int i = 0; i < 7; ++i) {
    splats.positions.emplace_back(value(), value(), value());
    splats.log_scales.emplace_back(value() - 4, value() - 4, value() - 4);
    splats.rotations.emplace_back(value(), value(), value(), value());
    splats.opacities.push_back(value());
    splats.colors.emplace_back(value(), value(), value());
    for (std::size_t k = 0; k < harmonics_per_splat(degree); ++k)
      splats.harmonics.emplace_back(value(), value(), value());
  }
  return splats;
}

std::string error_of(const std::filesystem::path& file) {
  try {
    (void)read_splats(file);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return {};
}

std::string bytes_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void write(const std::filesystem::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
}

class SplatFileOfDegree : public testing::TestWithParam<int> {};

TEST_P(SplatFileOfDegree, PlyReadsBackToTheSameBits) {
  const TemporaryFolder folder;
  const Splats splats = random_splats(GetParam());
  write_splats(folder / "x.ply", splats);
  const Splats read = read_splats(folder / "x.ply");
  EXPECT_TRUE(has_splats(folder / "x.ply"));
  EXPECT_EQ(read.degree, splats.degree);
  EXPECT_EQ(read.positions, splats.positions);
  EXPECT_EQ(read.log_scales, splats.log_scales);
  EXPECT_EQ(read.rotations, splats.rotations);
  EXPECT_EQ(read.opacities, splats.opacities);
  EXPECT_EQ(read.colors, splats.colors);
  EXPECT_EQ(read.harmonics, splats.harmonics);
}

INSTANTIATE_TEST_SUITE_P(Degrees, SplatFileOfDegree, testing::Values(0, 1, 2, 3));

TEST(SplatFile, RejectsDamagedFilesWithTheReason) {
  const TemporaryFolder folder;
  const std::filesystem::path file = folder / "x.ply";
  write_splats(file, random_splats(1));
  const std::string bytes = bytes_of(file);
  write(file, bytes.substr(0, bytes.size() - 1));
  EXPECT_EQ(error_of(file), file.string() + ": the file is cut off");
  write(file, bytes.substr(0, 40));
  EXPECT_FALSE(has_splats(file));
  EXPECT_NE(error_of(file).find("no end_header"), std::string::npos);
  std::string changed = bytes;
  changed.replace(changed.find("opacity"), 7, "nothing");
  write(file, changed);
  EXPECT_NE(error_of(file).find("no property opacity"), std::string::npos);
  changed = bytes;
  changed.replace(changed.find("f_rest_8"), 8, "unknown_");
  write(file, changed);
  EXPECT_NE(error_of(file).find("8 properties f_rest_"), std::string::npos);
  changed = bytes;
  changed.replace(changed.size() - 4, 4, std::string("\0\0\xc0\x7f", 4));  // not a number
  write(file, changed);
  EXPECT_NE(error_of(file).find("splat 6 has a value that is not finite"), std::string::npos);
  changed = bytes;
  changed.replace(changed.find("vertex 7"), 8, "vertex 9999999999999");
  write(file, changed);
  EXPECT_NE(error_of(file).find("cut off"), std::string::npos);
  EXPECT_NE(error_of(folder / "x.glb").find("'.glb' is not a supported format of splats"), std::string::npos);
}

}  // namespace
}  // namespace cairn
