// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Sessions written by earlier versions of cairn: format-N contains a session of each readable format, of the first 15
// frames of `cairn synth room --frames 300 --width 320`, with voxels of 8 cm; 18: with `--imu mems`. A new format keeps
// the earlier sessions and adds its own.
#include <gtest/gtest.h>

#include "cairn/mapping/mapper.hpp"
#include "cairn/mapping/session.hpp"
#include "cairn/synthetic/synthetic.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr int kFrames = 15;
constexpr double kPeriod = 1.0 / 30;  // seconds

class SessionFormats : public testing::TestWithParam<int> {};

TEST_P(SessionFormats, ResumeFromEveryReadableFormat) {
  const TemporaryFolder folder;
  const fs::path session = folder / "session";
  fs::copy(source_folder() / "tests/unit/session" / ("format-" + std::to_string(GetParam())), session,
           fs::copy_options::recursive);
  EXPECT_EQ(read_bytes(session / "state.cbor").rfind("cairn session " + std::to_string(GetParam()) + " ", 0), 0u);

  Session resumed = Session::resume(session);
  Mapper mapper = resumed.mapper();
  EXPECT_EQ(mapper.trajectory().size(), static_cast<std::size_t>(kFrames));
  const Mesh before = mapper.map().mesh();
  EXPECT_GT(before.triangles.size(), 2000u);
  EXPECT_EQ(mapper.upright().source, GravityAlignment::Source::accelerometer);

  const Scene room = synthetic_scene("room");
  SceneCamera eye(room, mapper.rig().depth);
  const SyntheticPath path(room, {}, 10);
  for (int i = kFrames; i < kFrames + 10; ++i) {
    const SceneImages seen = eye.render(*path.pose(i * kPeriod));
    const FrameReport report = mapper.add({.timestamp = i * kPeriod, .depth = seen.depth, .color = seen.color});
    EXPECT_EQ(report.state, FrameState::fused) << i;
  }
  resumed.checkpoint(mapper);
  EXPECT_EQ(resumed.problem(), std::nullopt);
  EXPECT_EQ(read_bytes(session / "state.cbor").rfind("cairn session " + std::to_string(Session::kFormat) + " ", 0), 0u);
}

INSTANTIATE_TEST_SUITE_P(Each, SessionFormats, testing::Range(Session::kOldestFormat, Session::kFormat + 1));

}  // namespace
}  // namespace cairn
