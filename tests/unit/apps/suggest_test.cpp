// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "apps/cli/suggest.hpp"

#include <gtest/gtest.h>

namespace cairn::apps {
namespace {

TEST(Suggest, CountsEdits) {
  EXPECT_EQ(edit_distance("", ""), 0);
  EXPECT_EQ(edit_distance("view", "view"), 0);
  EXPECT_EQ(edit_distance("View", "view"), 0);  // case is ignored
  EXPECT_EQ(edit_distance("veiw", "view"), 1);  // transposition of neighbors
  EXPECT_EQ(edit_distance("reconstrct", "reconstruct"), 1);
  EXPECT_EQ(edit_distance("kitten", "sitting"), 3);  // Levenshtein's own example
  EXPECT_EQ(edit_distance("", "abc"), 3);
}

TEST(Suggest, ReturnsAllWordsAtTheSmallestDistance) {
  const std::vector<std::string> commands{"reconstruct", "record", "export", "esdf", "view"};
  EXPECT_EQ(near_words("reconstrct", commands), std::vector<std::string>{"reconstruct"});
  EXPECT_EQ(near_words("exprot", commands), std::vector<std::string>{"export"});
  EXPECT_EQ(near_words("rec", commands), (std::vector<std::string>{"reconstruct", "record"}));  // common prefix
  EXPECT_EQ(near_words("--voxelsize", {"--voxel-size", "--esdf-voxel-size"}), std::vector<std::string>{"--voxel-size"});
  EXPECT_TRUE(near_words("dance", commands).empty());
  EXPECT_TRUE(near_words("x", commands).empty());  // every word is close to a single letter
  EXPECT_TRUE(near_words("", commands).empty());
}

TEST(Suggest, FormatsSuggestions) {
  EXPECT_EQ(did_you_mean("veiw", {"view", "live"}), "; did you mean view?");
  EXPECT_EQ(did_you_mean("dance", {"view"}), "");
  EXPECT_EQ(join_choices({"a", "b", "c"}), "a, b or c");
  EXPECT_EQ(join_choices({"a"}), "a");
}

}  // namespace
}  // namespace cairn::apps
