// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <gtest/gtest.h>

#include "cairn/mapping/mapper.hpp"
#include "map/keyframe.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

const Camera kSmall{160, 120, 131.25, 131.25, 79.5, 59.5, {}};

TEST(Reintegrate, SkipsTheFramesAndColorImagesThatAddSkipped) {
  std::vector<Frame> frames;
  for (int i = 0; i < 4; ++i) {
    frames.push_back(scene_frame(synthetic_scene("room"), kSmall, i));
    frames.back().color.resize(4 * frames.back().depth.size(), 0xff808080u);  // as in an .oni file of 1280x1024
  }
  frames[2].depth.resize(100);
  Mapper mapper(kSmall, {.fuse = {.voxel_size = 0.02f, .truncation = 0.08f}});
  for (const Frame& frame : frames) (void)mapper.add(frame);
  EXPECT_EQ(mapper.trajectory().size(), 3u);
  const std::size_t before = mapper.map().mesh().triangles.size();
  GivenFrames source(kSmall, frames);
  mapper.reintegrate(source);
  EXPECT_NEAR(static_cast<double>(mapper.map().mesh().triangles.size()), static_cast<double>(before), 0.01 * before);
}

TEST(KeyframeStore, DropsDepthThatItsFilesCannotStore) {
  KeyframeStore store(kSmall, {});
  Frame frame = scene_frame(synthetic_scene("room"), kSmall, 0);
  frame.depth[0] = 13.0f, frame.depth[1] = 13.2f, frame.depth[2] = 19.0f;
  store.put(0, frame, Features{});
  const Frame kept = store.get(0);
  EXPECT_NEAR(kept.depth[0], 13.0f, 2e-4f);  // quantization of the files
  EXPECT_EQ(kept.depth[1], 0.0f);
  EXPECT_EQ(kept.depth[2], 0.0f);
}

}  // namespace
}  // namespace cairn
