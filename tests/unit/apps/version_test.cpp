// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/version.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

namespace cairn {
namespace {

static_assert(kVersion == CAIRN_VERSION, "include/cairn/version.hpp differs from project(cairn VERSION ...)");

TEST(Version, TextHasTheNumbers) {
  EXPECT_EQ(kVersion, fmt::format("{}.{}.{}", kVersionMajor, kVersionMinor, kVersionPatch));
}

}  // namespace
}  // namespace cairn
