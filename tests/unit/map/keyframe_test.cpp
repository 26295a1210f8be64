// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/keyframe.hpp"

#include <gtest/gtest.h>

#include <thread>

#include "support/files.hpp"

namespace cairn {
namespace {

const Camera kTiny{16, 12, 16, 16, 7.5, 5.5, {}};
constexpr std::size_t kMany = 300;  // more than stay in memory

Features corners_of(std::size_t keyframe) {
  Features features;
  for (std::size_t i = 0; i < 3; ++i) {
    const double x = 1.0 / static_cast<double>(keyframe + i + 3);
    features.rays.emplace_back(x, -x);
    features.points.emplace_back(2 * x, -2 * x, 2);
    features.descriptors.emplace_back().fill(static_cast<std::uint8_t>(keyframe + i));
  }
  return features;
}

void expect_corners(const KeyframeStore& store, std::size_t keyframe) {
  const auto found = store.features(keyframe);
  const Features expected = corners_of(keyframe);
  EXPECT_EQ(found->rays, expected.rays) << keyframe;
  EXPECT_EQ(found->points, expected.points) << keyframe;
  EXPECT_EQ(found->descriptors, expected.descriptors) << keyframe;
}

TEST(KeyframeStore, ReturnsFeaturesOfMoreKeyframesThanItCaches) {
  const TemporaryFolder folder;
  const Frame frame{.depth = std::vector<float>(16 * 12, 1.5f)};
  for (const std::filesystem::path& files : {std::filesystem::path(), folder.path()}) {
    KeyframeStore store(kTiny, files);
    for (std::size_t k = 0; k < kMany; ++k) {
      store.put(k, frame, corners_of(k));
      expect_corners(store, k);  // possibly still being written
    }
    for (std::size_t k = 0; k < kMany; ++k) expect_corners(store, k);
  }
  const KeyframeStore reloaded(kTiny, folder.path(), Access::read);
  for (std::size_t k = 0; k < kMany; ++k) expect_corners(reloaded, k);
}

TEST(KeyframeStore, KeepsFeaturesAliveWhileTheyAreUsed) {
  const TemporaryFolder folder;
  KeyframeStore store(kTiny, folder.path());
  store.put(0, {.depth = std::vector<float>(16 * 12, 1.5f)}, corners_of(0));
  const auto first = store.features(0);
  for (std::size_t k = 1; k < kMany; ++k) store.put(k, {.depth = std::vector<float>(16 * 12, 1.5f)}, corners_of(k));
  EXPECT_NE(store.features(0), first) << "all stay in memory";
  EXPECT_EQ(first->rays, corners_of(0).rays);
  store.wait();
  std::filesystem::remove(folder / "000001.corners");
  EXPECT_THROW((void)store.features(1), std::runtime_error);
}

TEST(KeyframeStore, KeepsMaskedPixelsWithoutDepthAndAlpha) {
  const TemporaryFolder folder;
  KeyframeStore store(kTiny, folder.path());
  Frame frame{.depth = std::vector<float>(16 * 12, 1.5f), .color = std::vector<std::uint32_t>(16 * 12, ~0u)};
  frame.depth[3] = 0;                               // a hole
  frame.depth[5] = 0, frame.color[5] = 0x00ffffff;  // masked
  frame.color[7] = 0x00ffffff;                      // occluded in the color image
  store.put(0, frame, corners_of(0));
  store.correct(0, {});
  const Frame read = store.get(0);
  for (const std::size_t i : {0, 3, 5, 7}) {
    EXPECT_FLOAT_EQ(read.depth[i], frame.depth[i]) << i;
    EXPECT_EQ(read.color[i] >> 24, i == 5 ? 0u : 255u) << i;
  }
  EXPECT_EQ(store.depth(0), read.depth);
}

TEST(KeyframeStore, SupportsConcurrentReadsDuringPut) {
  for (const bool in_files : {false, true}) {
    const TemporaryFolder folder;
    KeyframeStore store(kTiny, in_files ? folder.path() : std::filesystem::path());
    const Frame frame{.depth = std::vector<float>(16 * 12, 1.5f)};
    for (std::size_t k = 0; k < kMany; ++k) store.put(k, frame, corners_of(k));
    const auto read = [&store](std::size_t step) {
      for (std::size_t i = 0; i < 2 * kMany; ++i) expect_corners(store, i * step % kMany);
    };
    std::thread forward_reader(read, 7), back(read, kMany - 7);
    for (std::size_t k = kMany; k < 2 * kMany; ++k) store.put(k, frame, corners_of(k));
    forward_reader.join(), back.join();
    for (std::size_t k = 0; k < 2 * kMany; ++k) expect_corners(store, k);
  }
}

}  // namespace
}  // namespace cairn
