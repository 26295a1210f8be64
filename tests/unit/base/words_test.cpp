// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/words.hpp"

#include <gtest/gtest.h>

#include "cairn/mapping/trajectory.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

TEST(TextFiles, ErrorsHaveNoControlCharacters) {
  const TemporaryFolder folder;
  write_text(folder / "t.txt", "0 0 0 0 0 0 0 \x1b[2J\n");
  EXPECT_NE(error_of([&] { (void)read_trajectory(folder / "t.txt"); }).find("'?[2J' is not a number"),
            std::string::npos);
  EXPECT_EQ(shown(std::string(1000, 'a')).size(), 123u);
}

}  // namespace
}  // namespace cairn
