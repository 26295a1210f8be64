// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <gtest/gtest.h>

#include "cairn/mapping/viewer.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

TEST(LiveViewer, IgnoresImagesOfAnotherSize) {
  const Rig rig{synthetic_camera()};
  Mapper mapper(rig);
  LiveViewer viewer({.port = 0});
  viewer.begin(mapper, rig, Options{});
  Frame frame;  // without a pixel
  const FrameReport report = mapper.add(frame);
  EXPECT_EQ(report.state, FrameState::skipped);
  viewer.fused(frame, report, 1);
  viewer.update(false, 0);
  EXPECT_EQ(viewer.viewers(), 0);
}

}  // namespace
}  // namespace cairn
