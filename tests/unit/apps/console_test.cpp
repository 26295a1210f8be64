// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "apps/cli/console.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "apps/cli/progress.hpp"

namespace cairn::apps {
namespace {

TEST(Console, FormatsSizesAndCounts) {
  EXPECT_EQ(format_size(0), "0 bytes");
  EXPECT_EQ(format_size(999), "999 bytes");
  EXPECT_EQ(format_size(1000), "1.0 kB");
  EXPECT_EQ(format_size(12'345'678), "12.3 MB");
  EXPECT_EQ(format_size(99'960'000), "100 MB");
  EXPECT_EQ(format_size(999'600'000), "1.0 GB");
  EXPECT_EQ(format_size(11'000'000'000'000), "11.0 TB");
  EXPECT_EQ(format_count(0), "0");
  EXPECT_EQ(format_count(999), "999");
  EXPECT_EQ(format_count(84210), "84,210");
  EXPECT_EQ(format_count(1234567), "1,234,567");
}

TEST(Console, WrapsBetweenWords) {
  EXPECT_EQ(wrapped("one two three", 0, 2, 8), "one two\n  three");
  EXPECT_EQ(wrapped("one two", 6, 2, 8), "one\n  two");
  EXPECT_EQ(wrapped("unbreakable it", 0, 0, 5), "unbreakable\nit");
}

TEST(Console, CutsLinesByCharactersNotBytes) {
  EXPECT_EQ(cut_to("für", 3, true), "für");
  EXPECT_EQ(cut_to("überall", 4, true), "übe…");
  EXPECT_EQ(cut_to("everywhere", 6, false), "eve...");
}

TEST(ProgressLine, FitsEveryTerminal) {
  const ProgressState done{.done = 812, .total = 1000, .what = "frames", .seconds = 60};
  const std::string state = "LOST: the view is too far from what was seen before, turn back";
  for (const bool has_blocks : {false, true})
    for (int columns = 20; columns <= 200; ++columns) {
      const std::string line =
          progress_line(done, state, {.is_live = true, .has_blocks = has_blocks, .columns = columns});
      EXPECT_LT(width_of(line), columns) << line;
      EXPECT_NE(line.find("812/1000"), std::string::npos) << line;
      EXPECT_EQ(line.find('\n'), std::string::npos);
    }
}

TEST(ProgressLine, BarWidthIsIndependentOfTheText) {
  const ProgressState done{.done = 30, .total = 60, .what = "frames", .seconds = 2};
  const Terminal terminal{.is_live = true, .columns = 80};
  const auto bar = [&](const char* state) {
    const std::string line = progress_line(done, state, terminal);
    return line.substr(0, line.find(']'));
  };
  EXPECT_EQ(bar(""), bar("91 % inliers within 1.3 sigma, guess: keyframe, color constrains 2 of 6 directions"));
  const std::string half = bar("");
  EXPECT_EQ(std::count(half.begin(), half.end(), '#'), std::count(half.begin(), half.end(), '.'));
}

TEST(ProgressLine, TimeLeftIncludesTheWorkThatFollows) {
  ProgressState done{.done = 50, .total = 100, .what = "frames", .seconds = 50, .following = 0.6};
  EXPECT_EQ(progress_line(done, "", Terminal{}), "50/100 frames  1.0/s  1:50 left");
  done.done = 100, done.seconds = 100;
  EXPECT_EQ(progress_line(done, "", Terminal{}), "100/100 frames  1.0/s  1:00 left");
}

TEST(ProgressLine, IsNotCutWithoutATerminal) {
  const std::string line =
      progress_line({.done = 3, .total = 4, .what = "", .seconds = 3}, std::string(300, 'x'), Terminal{});
  EXPECT_EQ(line, "75 %  0:01 left  " + std::string(300, 'x'));
}

}  // namespace
}  // namespace cairn::apps
