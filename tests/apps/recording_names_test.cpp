// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "apps/recording_names.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

namespace cairn::apps {
namespace {

using Names = std::vector<std::string>;

TEST(RecordingNames, AreTheWordsThatDiffer) {
  EXPECT_EQ(told_apart({"/data/monday", "/data/tuesday"}), (Names{"monday", "tuesday"}));
  EXPECT_EQ(told_apart({"/data/monday/rgbd", "/data/tuesday/rgbd"}), (Names{"monday", "tuesday"}));
  EXPECT_EQ(told_apart({"/data/monday"}), Names{"monday"});
  EXPECT_EQ(told_apart({"synthetic:building?recording=1&floors=2", "synthetic:building?recording=2&floors=2"}),
            (Names{"recording=1", "recording=2"}));
}

TEST(RecordingNames, AreAsShortAsTheyCanBe) {
  EXPECT_EQ(told_apart({"/home/me/scans/office", "/data/icl/kitchen"}), (Names{"office", "kitchen"}));
  EXPECT_EQ(told_apart({"/data/home/1", "/data/shop/1", "/data/shop/2"}), (Names{"home 1", "shop 1", "shop 2"}));
  EXPECT_EQ(told_apart({"1", "/data/shop/1"}), (Names{"1", "shop 1"}));
  EXPECT_EQ(told_apart({"/data/same", "/data/same"}), (Names{"same", "same"}));
}

TEST(RecordingNames, FindARecordingByNameOrNumber) {
  const Names names{"/home/me/office", "/data/kitchen"};
  EXPECT_EQ(recording_named("kitchen", names), 1U);
  EXPECT_EQ(recording_named("/home/me/office", names), 0U);
  EXPECT_EQ(recording_named("1", names), 1U);
  EXPECT_THROW((void)recording_named("hall", names), std::runtime_error);
  EXPECT_THROW((void)recording_named("2", names), std::runtime_error);
}

}  // namespace
}  // namespace cairn::apps
