// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Resumed run that returns to the state of the session at its start: a viewer's Reset.
#include <gtest/gtest.h>

#include <algorithm>

#include "cairn/mapping/mapper.hpp"
#include "cairn/mapping/session.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// Session of some frames of the room, and the frames after them.
class ReturnToStart : public testing::Test {
 protected:
  static constexpr int kBefore = 6, kEach = 6;  // frames
  ReturnToStart() {
    options_.fuse = {.voxel_size = 0.04f, .truncation = 0.16f, .device_memory = std::uint64_t{96} << 20};
    options_.map.submap_keyframes = 2;
    Session session = Session::create(at());
    Mapper mapper = session.mapper(small_camera(), options_);
    add(mapper, 0, kBefore);
    session.checkpoint(mapper, "found");
    EXPECT_FALSE(session.problem());
  }
  [[nodiscard]] fs::path at() const { return folder_ / "session"; }
  /// Adds frames far enough from each other to be keyframes.
  static void add(Mapper& mapper, int begin, int end) {
    const Scene scene = synthetic_scene("room");
    for (int i = begin; i < end; ++i) {
      Frame frame = scene_frame(scene, small_camera(), 4 * i, true);
      frame.index = i;
      EXPECT_EQ(mapper.add(frame).state, FrameState::fused) << i;
    }
  }
  static void checkpoint(Session& session, const Mapper& mapper) {
    session.checkpoint(mapper, "newer");
    EXPECT_EQ(session.problem(), std::nullopt);
  }
  [[nodiscard]] std::size_t runs() const {
    return static_cast<std::size_t>(std::count_if(fs::directory_iterator(at()), {}, [](const auto& entry) {
      return entry.path().filename().string().starts_with("run-");
    }));
  }
  TemporaryFolder folder_;
  Options options_;
};

TEST_F(ReturnToStart, RestoresTheStartByteForByte) {
  const std::string state = read_bytes(at() / "state.cbor");
  const auto files = bytes_below(at() / "run-0001");
  std::optional<Session> session(Session::resume(at(), true));
  std::optional<Mapper> mapper(session->mapper(small_camera(), options_));
  const Mesh found = mapper->map().mesh();
  for (int reset = 0; reset < 2; ++reset) {
    add(*mapper, kBefore, kBefore + kEach);
    for (int i = 0; i < 2; ++i) checkpoint(*session, *mapper);  // the second removes the first's leftovers
    EXPECT_EQ(Session::info(at()).note, "newer");
    EXPECT_TRUE(bytes_below(at() / "run-0001") == files);
    mapper.reset();
    session->return_to_start();
    EXPECT_TRUE(read_bytes(at() / "state.cbor") == state);
    EXPECT_TRUE(bytes_below(at() / "run-0001") == files);
    EXPECT_EQ(runs(), 2u);  // the current run, and the run found at the start
    mapper.emplace(session->mapper(small_camera(), options_));
    EXPECT_EQ(mapper->trajectory().size(), static_cast<std::size_t>(kBefore));
    EXPECT_EQ(mapper->map().mesh().positions, found.positions);
  }
  // From there on the result equals a run without a reset.
  add(*mapper, kBefore, kBefore + kEach);
  session->release_start();
  checkpoint(*session, *mapper);
  EXPECT_EQ(runs(), 1u);
  mapper.reset(), session.reset();
  EXPECT_EQ(Session::resume(at()).mapper(small_camera(), options_).trajectory().size(),
            static_cast<std::size_t>(kBefore + kEach));
}

TEST_F(ReturnToStart, ChangesNothingWithoutACheckpoint) {
  const auto before = bytes_below(at());
  {
    Session session = Session::resume(at(), true);
    (void)session.mapper(small_camera(), options_);
  }
  EXPECT_TRUE(bytes_below(at()) == before);
}

TEST_F(ReturnToStart, KeepsTheNewerSessionAfterAKill) {
  {
    Session session = Session::resume(at(), true);
    Mapper mapper = session.mapper(small_camera(), options_);
    add(mapper, kBefore, kBefore + kEach);
    checkpoint(session, mapper);
  }
  EXPECT_EQ(runs(), 2u);
  Session session = Session::resume(at());
  EXPECT_EQ(runs(), 1u);
  EXPECT_EQ(session.mapper(small_camera(), options_).trajectory().size(), static_cast<std::size_t>(kBefore + kEach));
}

TEST_F(ReturnToStart, ThrowsIfTheStartIsNotKept) {
  Session session = Session::resume(at());
  EXPECT_NE(error_of([&] { session.return_to_start(); }).find("is not kept"), std::string::npos);
}

}  // namespace
}  // namespace cairn
