// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "apps/cli/frame_log.hpp"

#include <gtest/gtest.h>

namespace cairn::apps {
namespace {

nlohmann::json report(int index) {
  return {{"index", index},
          {"state", index % 10 == 3 ? "lost" : "fused"},
          {"ms", {{"track", 1.5}}},
          {"reason", "because of " + std::to_string(index)}};
}

TEST(FrameLog, StoresAllFramesOfAShortRun) {
  FrameLog log;
  nlohmann::json all = nlohmann::json::array();
  for (int i = 0; i < 4000; ++i) {
    all.push_back(report(i));
    log.add(all.back());
  }
  EXPECT_EQ(log.kept(), all);
  EXPECT_EQ(FrameLog().first_reason(), std::nullopt);
}

TEST(FrameLog, StoresAnEvenSubsetOfALongRunAndCountsAll) {
  FrameLog log;
  for (int i = 0; i < 100'000; ++i) {
    log.add(report(i));
    if (i == 50'000) log = FrameLog::from(nlohmann::json::parse(log.save().dump()));  // killed and resumed
  }
  EXPECT_EQ(log.size(), 100'000);
  EXPECT_EQ(log.count("lost"), 10'000);
  EXPECT_EQ(log.count("skipped"), 0);
  EXPECT_EQ(log.first_reason(), "because of 3");
  const nlohmann::json kept = log.kept();
  EXPECT_GT(kept.size(), FrameLog::kMaxReports / 2);
  EXPECT_LE(kept.size(), FrameLog::kMaxReports);
  const int step = kept[1]["index"];
  for (std::size_t i = 0; i < kept.size(); ++i) ASSERT_EQ(kept[i], report(static_cast<int>(i) * step));
}

TEST(FrameLog, KeepsReasonsForSkippedFramesAfterAResume) {
  FrameLog log;
  log.add({{"index", 7}, {"state", "skipped"}, {"reason", "depth/7.png: holds no measurement"}});
  log = FrameLog::from(nlohmann::json::parse(log.save().dump()));
  log.add({{"index", 9}, {"state", "skipped"}, {"reason", "depth/9.png: holds no measurement"}});
  EXPECT_EQ(log.skipped().lines(log.size(), "skipped"),
            std::vector<std::string>{"2 of 2 frames skipped: holds no measurement (first: frame 7, depth/7.png)"});
}

TEST(FrameLog, RefusesInvalidState) {
  EXPECT_THROW((void)FrameLog::from(nullptr), nlohmann::json::exception);
  EXPECT_THROW((void)FrameLog::from(nlohmann::json::object()), nlohmann::json::exception);
  nlohmann::json saved = FrameLog().save();
  saved["lines"] = "{\"index\": \n";
  EXPECT_THROW((void)FrameLog::from(saved), nlohmann::json::exception);
}

}  // namespace
}  // namespace cairn::apps
