// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "place/matches.hpp"

#include <gtest/gtest.h>

#include <opencv2/features2d.hpp>
#include <random>

namespace cairn {
namespace {

/// Features with rays that encode their index; every fifth has no depth.
Features with_descriptors(std::size_t count, std::mt19937& random) {
  Features f;
  for (std::size_t i = 0; i < count; ++i) {
    f.rays.emplace_back(i, 0);
    f.points.emplace_back(i, 0, i % 5 != 0);
    for (std::uint8_t& byte : f.descriptors.emplace_back()) byte = static_cast<std::uint8_t>(random());
  }
  return f;
}

TEST(Matches, EqualOpenCV) {
  std::mt19937 random(1);
  const Features known = with_descriptors(300, random);
  Features seen = with_descriptors(200, random);
  for (std::size_t i = 0; i < 150; ++i) {  // seen again, some with too many different bits for a match
    seen.descriptors[i] = known.descriptors[299 - i];
    for (std::size_t bit = 0; bit < i / 2; ++bit) seen.descriptors[i][bit / 8] ^= 1u << (bit % 8);
  }
  for (std::size_t i = 0; i < 20; ++i) seen.descriptors[180 + i] = seen.descriptors[i];  // equal distances
  const auto mat = [](const Features& f) {
    return cv::Mat(static_cast<int>(f.descriptors.size()), 32, CV_8U,
                   const_cast<std::uint8_t*>(f.descriptors.front().data()));
  };
  std::vector<cv::DMatch> pairs;
  cv::BFMatcher(cv::NORM_HAMMING, true).match(mat(seen), mat(known), pairs);
  std::erase_if(pairs, [](const cv::DMatch& pair) { return pair.distance > 64 || pair.trainIdx % 5 == 0; });
  ASSERT_GT(pairs.size(), 80u);
  const Matches matches = match(known, seen);
  ASSERT_EQ(matches.rays.size(), pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    EXPECT_EQ(matches.rays[i].x, pairs[i].queryIdx);
    EXPECT_EQ(matches.points[i].x, pairs[i].trainIdx);
  }
}

TEST(Matches, AreEmptyWithoutFeatures) {
  std::mt19937 random(1);
  const Features some = with_descriptors(30, random);
  EXPECT_TRUE(match(some, {}).points.empty());
  EXPECT_TRUE(match({}, some).points.empty());
}

}  // namespace
}  // namespace cairn
