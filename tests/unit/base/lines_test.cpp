// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/lines.hpp"

#include <gtest/gtest.h>

#include <clocale>

#include "cairn/mapping/trajectory.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

TEST(TextFiles, ParseIndependentOfLocaleAndEditor) {
  const TemporaryFolder folder;
  const auto file = folder / "t.txt";
  // A byte order mark, Windows line ends, commas, no newline at the end.
  write_text(file,
             "\xef\xbb\xbf"
             "1.5 0.25 0 0 0 0 0 1\r\n2.5, 1e-3, +2, 0, 0, 0, 0, 1");
  const char* german = std::setlocale(LC_ALL, "de_DE.UTF-8");  // if installed: has a comma as its decimal point
  const auto read = read_trajectory(file);
  if (german != nullptr) std::setlocale(LC_ALL, "C");
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].timestamp, 1.5);
  EXPECT_EQ(read[0].world_from_camera.translation().x(), 0.25);
  EXPECT_EQ(read[1].world_from_camera.translation(), Eigen::Vector3d(1e-3, 2, 0));
}

}  // namespace
}  // namespace cairn
