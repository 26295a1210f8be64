// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <gtest/gtest.h>

#include "cairn/mapper.hpp"
#include "map/keyframe.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

const Camera kSmall{160, 120, 131.25, 131.25, 79.5, 59.5, {}};

class Given final : public Source {
 public:
  explicit Given(std::vector<Frame> frames) : frames_(std::move(frames)) {}
  [[nodiscard]] const Rig& rig() const override { return rig_; }
  [[nodiscard]] std::optional<int> size() const override { return static_cast<int>(frames_.size() - next_); }
  [[nodiscard]] std::optional<Frame> next() override {
    return next_ < frames_.size() ? std::optional(frames_[next_++]) : std::nullopt;
  }

 private:
  Rig rig_ = kSmall;
  std::vector<Frame> frames_;
  std::size_t next_ = 0;
};

TEST(Reintegrate, TakesDepthAloneWhereColourHasAnotherSizeAndLeavesOutWhatAddDid) {
  std::vector<Frame> frames;
  for (int i = 0; i < 4; ++i) {
    frames.push_back(scene_frame(synthetic_scene("room"), kSmall, i));
    frames.back().colour.resize(4 * frames.back().depth.size(), 0xff808080u);  // as an .oni file of 1280x1024 has it
  }
  frames[2].depth.resize(100);
  Mapper mapper(kSmall, {.fuse = {.voxel_size = 0.02f, .truncation = 0.08f}});
  for (const Frame& frame : frames) (void)mapper.add(frame);
  EXPECT_EQ(mapper.trajectory().size(), 3u);
  const std::size_t before = mapper.map().mesh().triangles.size();
  Given again(frames);
  mapper.reintegrate(again);
  EXPECT_NEAR(static_cast<double>(mapper.map().mesh().triangles.size()), static_cast<double>(before), 0.01 * before);
}

TEST(KeyframeStore, LeavesOutDepthThatItsFilesDoNotHold) {
  KeyframeStore store(kSmall, {});
  Frame frame = scene_frame(synthetic_scene("room"), kSmall, 0);
  frame.depth[0] = 13.0f, frame.depth[1] = 13.2f, frame.depth[2] = 19.0f;
  store.put(0, frame, {});
  const Frame kept = store.get(0);
  EXPECT_NEAR(kept.depth[0], 13.0f, 2e-4f);  // the files' steps
  EXPECT_EQ(kept.depth[1], 0.0f);
  EXPECT_EQ(kept.depth[2], 0.0f);
}

}  // namespace
}  // namespace cairn
