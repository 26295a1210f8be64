// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

#include "base/gzip.hpp"
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

std::string read_error(const std::filesystem::path& file) {
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

// Largest errors of SPZ's quantization.
constexpr float kPositionStep = 0.5f / 4096;  // meters
constexpr float kScaleStep = 0.5f / 16;       // of the logarithm
constexpr float kColorStep = 0.5f / 255 / 0.15f;
constexpr float kOpacityStep = 0.5f / 255;
constexpr float kRotationStep = 0.004f;  // of a component: 0.0007 each, and the largest from the others
constexpr float kFirstBandStep = 4.5f / 128, kOtherBandsStep = 8.5f / 128;  // of 128: half a step, and rounding

float opacity_of(float logit) { return 1 / (1 + std::exp(-logit)); }

/// Splats in the range of SPZ: harmonics within -1 and 1.
Splats quantizable(int degree) {
  Splats splats = random_splats(degree);
  for (Eigen::Vector3f& harmonic : splats.harmonics) harmonic *= 0.45f;
  return splats;
}

void expect_within_quantization(const Splats& read, const Splats& splats) {
  ASSERT_EQ(read.size(), splats.size());
  ASSERT_EQ(read.degree, splats.degree);
  ASSERT_EQ(read.harmonics.size(), splats.harmonics.size());
  const std::size_t harmonics = harmonics_per_splat(splats.degree);
  for (std::size_t i = 0; i < splats.size(); ++i) {
    EXPECT_LE((read.positions[i] - splats.positions[i]).cwiseAbs().maxCoeff(), 1.01f * kPositionStep);
    EXPECT_LE((read.log_scales[i] - splats.log_scales[i]).cwiseAbs().maxCoeff(), 1.01f * kScaleStep);
    EXPECT_LE((read.colors[i] - splats.colors[i]).cwiseAbs().maxCoeff(), 1.01f * kColorStep);
    EXPECT_LE(std::abs(opacity_of(read.opacities[i]) - opacity_of(splats.opacities[i])), 1.01f * kOpacityStep);
    const Eigen::Vector4f a = read.rotations[i].normalized(), b = splats.rotations[i].normalized();
    EXPECT_LE((a * (a.dot(b) < 0 ? -1.0f : 1.0f) - b).cwiseAbs().maxCoeff(), kRotationStep);
    for (std::size_t k = 0; k < harmonics; ++k)
      EXPECT_LE((read.harmonics[i * harmonics + k] - splats.harmonics[i * harmonics + k]).cwiseAbs().maxCoeff(),
                k < 3 ? kFirstBandStep : kOtherBandsStep);
  }
}

/// Splats as read by other programs' libraries, in the world frame.
Splats read_by_others(const std::filesystem::path& file) {
  const std::string support = (source_folder() / "tests/support").string();
  EXPECT_TRUE(std::filesystem::exists(support + "/node_modules/@adobe/spz")) << "run npm ci --prefix tests/support";
  const TemporaryFolder folder;
  const std::string out = (folder / "out").string();
  EXPECT_EQ(std::system(("node '" + support + "/read_splats.mjs' '" + file.string() + "' >'" + out + "' 2>&1").c_str()),
            0)
      << read_bytes(out);
  Splats splats;
  for (const auto& splat : nlohmann::json::parse(read_bytes(out))) {
    const auto vector = [](const nlohmann::json& values, std::size_t first = 0) {
      return Eigen::Vector3f(values.at(first), values.at(first + 1), values.at(first + 2));
    };
    splats.positions.push_back(vector(splat.at("position")));
    splats.log_scales.push_back(vector(splat.at("log_scale")));
    const auto& q = splat.at("rotation");
    splats.rotations.emplace_back(q.at(0), q.at(1), q.at(2), q.at(3));
    splats.opacities.push_back(splat.at("opacity"));
    splats.colors.push_back(vector(splat.at("color")));
    for (std::size_t k = 0; k < splat.at("harmonics").size(); k += 3)
      splats.harmonics.push_back(vector(splat.at("harmonics"), k));
  }
  while (splats.harmonics.size() > splats.size() * harmonics_per_splat(splats.degree) && splats.degree < 3)
    ++splats.degree;
  return splats;
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

TEST_P(SplatFileOfDegree, SpzReadsBackWithinItsQuantization) {
  const TemporaryFolder folder;
  const Splats splats = quantizable(GetParam());
  write_splats(folder / "x.spz", splats);
  EXPECT_TRUE(has_splats(folder / "x.spz"));
  expect_within_quantization(read_splats(folder / "x.spz"), splats);
}

TEST_P(SplatFileOfDegree, OtherProgramsReadTheSameSplats) {
  const TemporaryFolder folder;
  const Splats splats = quantizable(GetParam());
  for (const char* name : {"x.ply", "x.spz", "x.glb"}) {
    SCOPED_TRACE(name);
    write_splats(folder / name, splats);
    expect_within_quantization(read_by_others(folder / name), splats);
  }
}

INSTANTIATE_TEST_SUITE_P(Degrees, SplatFileOfDegree, testing::Values(0, 1, 2, 3));

TEST(SplatFile, RejectsDamagedFilesWithTheReason) {
  const TemporaryFolder folder;
  const std::filesystem::path file = folder / "x.ply";
  write_splats(file, random_splats(1));
  const std::string bytes = bytes_of(file);
  write(file, bytes.substr(0, bytes.size() - 1));
  EXPECT_EQ(read_error(file), file.string() + ": the file is cut off");
  write(file, bytes.substr(0, 40));
  EXPECT_FALSE(has_splats(file));
  EXPECT_NE(read_error(file).find("no end_header"), std::string::npos);
  std::string changed = bytes;
  changed.replace(changed.find("opacity"), 7, "nothing");
  write(file, changed);
  EXPECT_NE(read_error(file).find("no property opacity"), std::string::npos);
  changed = bytes;
  changed.replace(changed.find("f_rest_8"), 8, "unknown_");
  write(file, changed);
  EXPECT_NE(read_error(file).find("8 properties f_rest_"), std::string::npos);
  changed = bytes;
  changed.replace(changed.size() - 4, 4, std::string("\0\0\xc0\x7f", 4));  // not a number
  write(file, changed);
  EXPECT_NE(read_error(file).find("splat 6 has a value that is not finite"), std::string::npos);
  changed = bytes;
  changed.replace(changed.find("vertex 7"), 8, "vertex 9999999999999");
  write(file, changed);
  EXPECT_NE(read_error(file).find("cut off"), std::string::npos);
  EXPECT_NE(read_error(folder / "x.glb").find("'.glb' is not a supported format of splats"), std::string::npos);
}

TEST(SplatFile, WritesGltfWithColorsForViewersWithoutTheExtension) {
  const TemporaryFolder folder;
  Splats splats = random_splats(1);
  splats.colors[0] = Eigen::Vector3f(0.5f, 0, -5) / 0.28209479f;  // sRGB 1, 0.5, 0
  splats.opacities[0] = 0;
  write_splats(folder / "x.glb", splats);
  const std::string bytes = bytes_of(folder / "x.glb");
  const auto word = [&](std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, 4);
    return value;
  };
  ASSERT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(word(8), bytes.size());
  EXPECT_EQ(word(12) % 4, 0);
  const auto json = nlohmann::json::parse(bytes.substr(20, word(12)));
  EXPECT_EQ(json["extensionsUsed"], nlohmann::json::array({"KHR_gaussian_splatting"}));
  const std::size_t attribute = json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"];
  const std::size_t view = json["accessors"].at(attribute)["bufferView"];
  const std::size_t at = 28 + word(12) + json["bufferViews"].at(view)["byteOffset"].get<std::size_t>();
  std::array<std::uint16_t, 4> color{};
  std::memcpy(color.data(), bytes.data() + at, sizeof(color));
  EXPECT_EQ(color[0], 65535);
  EXPECT_NEAR(color[1], 0.2140 * 65535, 5);  // linear
  EXPECT_EQ(color[2], 0);
  EXPECT_NEAR(color[3], 32768, 1);
  EXPECT_FALSE(has_splats(folder / "x.glb"));  // not read
}

TEST(SplatFile, SpzHoldsMapsOfKilometers) {
  const TemporaryFolder folder;
  Splats splats = quantizable(0);
  splats.positions[3] = {0, -100000, 1};
  write_splats(folder / "x.spz", splats);
  EXPECT_LT((read_splats(folder / "x.spz").positions[3] - splats.positions[3]).norm(), 0.02f);
  splats.positions[3].x() = 1e8f;
  EXPECT_NE(error_of([&] { write_splats(folder / "x.spz", splats); }).find("too far for SPZ: use .ply"),
            std::string::npos);
}

TEST(SplatFile, ReadsTheQuaternionsOfSpzVersion2) {
  const TemporaryFolder folder;
  std::string bytes("NGSP\2\0\0\0\1\0\0\0\0\14\0\0", 16);
  bytes += std::string("\0\20\0\0\360\377\0\0\0", 9) + "\177\177\177\177\240\240\240";  // position 1, -1, 0
  bytes += "\332\177\177";                                                              // a turn about x
  write(folder / "x.spz", gzip(bytes));
  const Splats splats = read_splats(folder / "x.spz");
  ASSERT_EQ(splats.size(), 1);
  EXPECT_EQ(splats.positions[0], Eigen::Vector3f(1, 1, 0));
  EXPECT_EQ(splats.log_scales[0], Eigen::Vector3f(0, 0, 0));
  EXPECT_LT((splats.rotations[0] - Eigen::Vector4f(0.7042f, 0.7098f, 0.0039f, 0.0039f)).norm(), 1e-3f);
}

TEST(SplatFile, RejectsDamagedSpzWithTheReason) {
  const TemporaryFolder folder;
  const std::filesystem::path file = folder / "x.spz";
  write_splats(file, random_splats(1));
  const std::string whole = bytes_of(file);
  const std::vector<std::uint8_t> plain =
      gunzip({reinterpret_cast<const std::uint8_t*>(whole.data()), whole.size()}, 1 << 20);
  const auto expect = [&](const std::string& bytes, const std::string& reason) {
    write(file, bytes);
    EXPECT_EQ(read_error(file), file.string() + ": " + reason);
  };
  const auto with = [&](std::size_t at, const std::string& bytes) {
    return gzip(std::string(plain.begin(), plain.end()).replace(at, bytes.size(), bytes));
  };
  expect("", "is not an SPZ file");
  expect(bytes_of(folder / "x.spz") + "text", "is not an SPZ file");
  expect(whole.substr(0, 12), "the file is cut off");
  write(file, whole.substr(0, whole.size() / 2));
  EXPECT_NE(read_error(file).find("the file is cut off"), std::string::npos);
  expect(with(0, "XGSP"), "is not an SPZ file");
  expect(with(4, "\4"), "SPZ of version 4 is not supported: use 2 or 3");
  expect("NGSP\4", "SPZ of version 4 is not supported: save it as version 3, or as .ply");
  expect(with(8, "\377\377\377\377"), "the file is cut off: its 4294967295 splats are 124554051571 bytes, and " +
                                          std::to_string(plain.size()) + " are here");
  expect(with(8, std::string(4, '\0')), "has no splats");
  expect(with(12, "\11"), "its spherical harmonics of degree 9 are not supported: up to 3");
  expect(with(13, "\100"), "64 fractional bits do not fit into 24");
  std::string changed = whole;
  changed[changed.size() / 2] = static_cast<char>(changed[changed.size() / 2] ^ 0x55);
  write(file, changed);
  EXPECT_FALSE(read_error(file).empty());
}

}  // namespace
}  // namespace cairn
