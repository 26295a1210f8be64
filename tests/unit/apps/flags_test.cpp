// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "apps/cli/flags.hpp"

#include <gtest/gtest.h>

namespace cairn::apps {
namespace {

TEST(Flags, ReplaceFieldNamesInMessages) {
  EXPECT_EQ(with_flag_names("SimplifyOptions::ratio is 3: it must be between 0.0001 and 1"),
            "--simplify is 3: it must be between 0.0001 and 1");
  EXPECT_EQ(with_flag_names("lower FuseOptions::device_memory, or choose a larger FuseOptions::voxel_size"),
            "lower --device-memory, or choose a larger --voxel-size");
  EXPECT_EQ(with_flag_names("nothing of that"), "nothing of that");
}

}  // namespace
}  // namespace cairn::apps
