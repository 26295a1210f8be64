// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "apps/cli/reasons.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace cairn::apps {
namespace {

TEST(Reasons, MergeIfOnlyPlaceAndNumbersDiffer) {
  Reasons reasons;
  EXPECT_TRUE(reasons.empty());
  reasons.add(3, "scan/depth/3.png: is 320x240, the camera 640x480");
  for (int i = 12; i < 29; ++i) reasons.add(i, "scan/depth/" + std::to_string(i) + ".png: holds no measurement");
  reasons.add(40, "scan/depth/40.png: is 160x120, the camera 640x480");
  reasons.add(41, "every depth is the same");
  EXPECT_EQ(reasons.lines(400, "skipped"),
            (std::vector<std::string>{
                "17 of 400 frames skipped: holds no measurement (first: frame 12, scan/depth/12.png)",
                "2 of 400 frames skipped: is 320x240, the camera 640x480 (first: frame 3, scan/depth/3.png)",
                "1 of 400 frames skipped: every depth is the same (frame 41)"}));
}

TEST(Reasons, AreKeptAfterAResume) {
  Reasons reasons;
  reasons.add(1, "a/1.png: the file is cut off");
  Reasons later = Reasons::from(nlohmann::json::parse(reasons.save().dump()));
  later.add(2, "a/2.png: the file is cut off");
  EXPECT_EQ(later.lines(3, "skipped"),
            std::vector<std::string>{"2 of 3 frames skipped: the file is cut off (first: frame 1, a/1.png)"});
  EXPECT_THROW((void)Reasons::from(nlohmann::json::parse(R"([{"why": 1}])")), nlohmann::json::exception);
}

TEST(Reasons, SummarizeRareReasonsInOneLine) {
  Reasons reasons;
  for (char c = 'a'; c <= 'z'; ++c) reasons.add(c - 'a', std::string("x.png: because of ") + c);
  const auto lines = reasons.lines(26, "skipped");
  ASSERT_EQ(lines.size(), 9u);
  EXPECT_EQ(lines[0], "18 of 26 frames skipped: other reasons, see report.json (first: frame 8, x.png)");
}

}  // namespace
}  // namespace cairn::apps
