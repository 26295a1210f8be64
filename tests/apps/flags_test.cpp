// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "apps/flags.hpp"

#include <gtest/gtest.h>

namespace cairn::apps {
namespace {

TEST(Flags, StandInMessagesForTheLibrarysOptions) {
  EXPECT_EQ(in_flags("SimplifyOptions::ratio is 3: it must be between 0.0001 and 1"),
            "--simplify is 3: it must be between 0.0001 and 1");
  EXPECT_EQ(in_flags("lower FuseOptions::device_memory, or choose a larger FuseOptions::voxel_size"),
            "lower --device-memory, or choose a larger --voxel-size");
  EXPECT_EQ(in_flags("nothing of that"), "nothing of that");
}

}  // namespace
}  // namespace cairn::apps
