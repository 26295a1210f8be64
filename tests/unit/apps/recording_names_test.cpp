// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "apps/cli/recording_names.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

namespace cairn::apps {
namespace {

using Names = std::vector<std::string>;

TEST(RecordingNames, KeepTheDifferingWords) {
  EXPECT_EQ(short_names({"/data/monday", "/data/tuesday"}), (Names{"monday", "tuesday"}));
  EXPECT_EQ(short_names({"/data/monday/rgbd", "/data/tuesday/rgbd"}), (Names{"monday", "tuesday"}));
  EXPECT_EQ(short_names({"/data/monday"}), Names{"monday"});
  EXPECT_EQ(short_names({"synthetic:building?recording=1&floors=2", "synthetic:building?recording=2&floors=2"}),
            (Names{"recording=1", "recording=2"}));
}

TEST(RecordingNames, AreAsShortAsPossible) {
  EXPECT_EQ(short_names({"/home/me/scans/office", "/data/icl/kitchen"}), (Names{"office", "kitchen"}));
  EXPECT_EQ(short_names({"/data/home/1", "/data/shop/1", "/data/shop/2"}), (Names{"home 1", "shop 1", "shop 2"}));
  EXPECT_EQ(short_names({"1", "/data/shop/1"}), (Names{"1", "shop 1"}));
  EXPECT_EQ(short_names({"/data/same", "/data/same"}), (Names{"same", "same"}));
}

TEST(RecordingNames, FindARecordingByNameOrNumber) {
  const Names names{"/home/me/office", "/data/kitchen"};
  EXPECT_EQ(find_recording("kitchen", names), 1U);
  EXPECT_EQ(find_recording("/home/me/office", names), 0U);
  EXPECT_EQ(find_recording("1", names), 1U);
  EXPECT_THROW((void)find_recording("hall", names), std::runtime_error);
  EXPECT_THROW((void)find_recording("2", names), std::runtime_error);
}

}  // namespace
}  // namespace cairn::apps
