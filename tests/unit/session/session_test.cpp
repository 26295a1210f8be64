// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/session.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <boost/crc.hpp>
#include <functional>
#include <limits>
#include <set>
#include <thread>

#include "session/session_files.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// Two keyframes with a loop between them.
SessionState small_session() {
  SessionState s;
  s.fuse.voxel_size = 0.01f, s.fuse.truncation = 0.04f;
  s.min_depth = 0.3f, s.max_depth = 5.0f;
  Atlas& atlas = s.back_end.atlas;
  for (int i = 0; i < 2; ++i) {
    atlas.keyframes.push_back({.frame = i, .timestamp = 0.1 * i, .follows = i > 0});
    atlas.world_from_camera.push_back(Eigen::Isometry3d::Identity());
    atlas.add_frame(0.1 * i, Eigen::Isometry3d::Identity());
    s.back_end.tracked_from_camera.emplace_back(Eigen::Isometry3d::Identity());
    s.tracker.state.last.push_back({0.1 * i, Eigen::Isometry3d::Identity()});
  }
  atlas.loops.push_back({.edge = {.i = 0, .j = 1, .is_loop_closure = true}});
  s.back_end.submaps = {false};
  s.residency.on_device = {{1, 2, 3}};
  s.residency.device_last_seen = {7};
  s.number = 1;
  s.note = "a note";
  return s;
}

BrickList one_brick() { return {.bricks = {{1, 2, 3}}, .voxels = {BrickVoxels{5}}, .free = {}}; }

std::set<std::string> names_in(const fs::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.insert(entry.path().filename().string());
  return names;
}

TEST(SessionFiles, RoundTrip) {
  const TemporaryFolder folder;
  SessionWriter(folder / "s").write(small_session(), one_brick());
  const ReadSession read = read_session(folder / "s");
  EXPECT_EQ(read.session.back_end.atlas.keyframes.size(), 2u);
  EXPECT_EQ(read.session.residency.device_last_seen, std::vector<std::uint32_t>{7});
  EXPECT_EQ(read.session.note, "a note");
  EXPECT_EQ(read.active.size(), 1u);
  EXPECT_EQ(names_in(folder / "s"), (std::set<std::string>{"run-0001", "state.cbor"}));
}

TEST(SessionFiles, HaveIdenticalBytesAfterARoundTrip) {
  const TemporaryFolder folder;
  SessionState s = small_session();
  s.rig.depth.distortion = {0.1, 0.2, 0.3, 0.4, 0.5};
  s.rig.color = ColorCamera{.camera = {.width = 1280, .height = 720, .lens = Lens::fisheye}};
  s.rig.color->color_from_depth.translation().x() = 0.05;
  s.back_end.atlas.keyframes[1].acceleration = Eigen::Vector3d(1, 2, 3);
  s.back_end.atlas.recordings = {1};
  for (int i = 0; i < 100; ++i) s.back_end.atlas.surface_sigma.add({0.04 * i, 0.07 * (i % 7), -0.1}, 0.001 + 1e-5 * i);
  s.back_end.atlas.steps = {{}, {retract(Vector6d::Constant(0.1)), 3 * Matrix6d::Identity()}};
  Preintegration& step = s.back_end.atlas.keyframes[1].inertial.step.emplace();
  step.seconds = 0.5, step.covariance = 1e-4 * Matrix9d::Identity(), step.velocity = {1, 2, 3};
  s.back_end.atlas.keyframes[1].inertial.gravity = MeasuredGravity{Eigen::Vector3d::UnitZ(), 0.01};
  s.back_end.atlas.inertial_mount.emplace().lever = {0.1, 0.2, 0.3};
  s.back_end.inertial_keyframes = 2;
  s.back_end.submaps = {true, false};
  s.tracker.state.focal_costs[1] = 0.5;
  s.tracker.reference.levels = {{1, 2, 3}, {}};
  s.residency.on_host = {{4, 5, 6}, {-7, 8, 9}};
  s.residency.host_last_seen = {1, 2};
  s.last_fused = 0.1;
  SessionWriter(folder / "s").write(s, one_brick());
  const ReadSession read = read_session(folder / "s");
  SessionWriter(folder / "again").write(read.session, one_brick());
  EXPECT_EQ(read_bytes(folder / "again" / "state.cbor"), read_bytes(folder / "s" / "state.cbor"));
  EXPECT_EQ(read.session.rig, s.rig);
  EXPECT_EQ(read.session.back_end.atlas.keyframes[0].acceleration, std::nullopt);
  EXPECT_EQ(read.session.back_end.atlas.keyframes[1].acceleration, Eigen::Vector3d(1, 2, 3));
  const SurfaceSigma &sigma = s.back_end.atlas.surface_sigma, &again = read.session.back_end.atlas.surface_sigma;
  EXPECT_EQ(again.cells().size(), sigma.cells().size());
  for (const double x : {0.0, 1.03, 3.96}) EXPECT_EQ(again.at({x, 0.2, -0.1}), sigma.at({x, 0.2, -0.1})) << x;
  ASSERT_EQ(read.session.back_end.atlas.steps.size(), 2u);
  EXPECT_EQ(read.session.back_end.atlas.steps[1].before_from_camera.matrix(),
            s.back_end.atlas.steps[1].before_from_camera.matrix());
  EXPECT_EQ(read.session.back_end.atlas.steps[1].information, s.back_end.atlas.steps[1].information);
  const Atlas& atlas = read.session.back_end.atlas;
  EXPECT_FALSE(atlas.keyframes[0].inertial.step);
  ASSERT_TRUE(atlas.keyframes[1].inertial.step && atlas.keyframes[1].inertial.gravity && atlas.inertial_mount);
  EXPECT_EQ(atlas.keyframes[1].inertial.step->velocity, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(atlas.keyframes[1].inertial.gravity->down, Eigen::Vector3d::UnitZ());
  EXPECT_EQ(atlas.inertial_mount->lever, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(read.session.back_end.inertial_keyframes, 2u);
  EXPECT_EQ(read.session.back_end.submaps, s.back_end.submaps);
  EXPECT_EQ(read.session.tracker.reference.levels, s.tracker.reference.levels);
  EXPECT_EQ(read.session.residency.on_host, s.residency.on_host);
  EXPECT_EQ(read.session.last_fused, 0.1);
}

TEST(SessionFiles, WithInvalidValuesAreRejected) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto pose = [](auto change) {
    Eigen::Isometry3d changed = Eigen::Isometry3d::Identity();
    change(changed);
    return changed;
  };
  const Eigen::Isometry3d no_pose = pose([&](auto&p) { p.translation().x() = nan; }),
                          bent = pose([](auto&p) { p.linear()(0, 0) = 2; });
  const std::vector<std::function<void(SessionState&)>> damages{
      [](SessionState& s) { s.back_end.atlas.keyframes[1].submap = 2; },
      [](SessionState& s) { s.back_end.atlas.keyframes[1].searched = 2; },
      [](SessionState& s) { s.back_end.atlas.keyframes[0].follows = true; },
      [&](SessionState& s) { s.back_end.atlas.keyframes[0].timestamp = nan; },
      [&](SessionState& s) { s.back_end.atlas.keyframes[0].odometry_from_camera = no_pose; },
      [&](SessionState& s) { s.back_end.atlas.keyframes[0].submap_from_camera = bent; },
      [&](SessionState& s) { s.back_end.atlas.world_from_camera[1] = no_pose; },
      [](SessionState& s) {
        s.back_end.atlas.surface_sigma = SurfaceSigma({{.at = {1, 2, 3}, .variance = -1, .weight = 1}});
      },
      [&](SessionState& s) {
        s.back_end.atlas.surface_sigma = SurfaceSigma({{.at = {1, 2, 3}, .variance = 1, .weight = nan}});
      },
      [](SessionState& s) {
        s.back_end.atlas.surface_sigma = SurfaceSigma({{.at = {1 << 30, 2, 3}, .variance = 1, .weight = 1}});
      },
      [](SessionState& s) { s.back_end.atlas.steps.resize(3); },
      [&](SessionState& s) {
        s.back_end.atlas.steps = {{no_pose, Matrix6d::Identity()}};
      },
      [](SessionState& s) {
        s.back_end.atlas.steps = {{Eigen::Isometry3d::Identity(), -Matrix6d::Identity()}};
      },
      [](SessionState& s) { s.back_end.atlas.keyframes[1].inertial.step.emplace(); },
      [&](SessionState& s) {
        s.back_end.atlas.keyframes[1].inertial.gravity = MeasuredGravity{Eigen::Vector3d(0, 2, 0), 0.01};
      },
      [&](SessionState& s) { s.back_end.atlas.inertial_mount.emplace().lever.x() = nan; },
      [](SessionState& s) { s.back_end.atlas.loops[0].edge.j = 2; },
      [](SessionState& s) { s.back_end.atlas.loops[0].edge.i = 1; },
      [&](SessionState& s) { s.back_end.atlas.loops[0].edge.information(2, 2) = nan; },
      [](SessionState& s) { s.back_end.atlas.frames.push_back({.timestamp = 0.2, .keyframe = 2}); },
      [](SessionState& s) {
        FusedFrame frame{.timestamp = 0.2, .keyframe = 1};
        frame.twist[2] = std::numeric_limits<float>::infinity();
        s.back_end.atlas.frames.push_back(frame);
      },
      [](SessionState& s) { s.back_end.atlas.frames = {}; },
      [](SessionState& s) { s.back_end.atlas.recordings = {3}; },
      [](SessionState& s) {
        s.back_end.atlas.recordings = {1, 0};
      },
      [](SessionState& s) { s.back_end.searched = 3; },
      [](SessionState& s) { s.back_end.submap_begin = 3; },
      [](SessionState& s) { s.back_end.tracked_from_camera.pop_back(); },
      [&](SessionState& s) { s.back_end.tracked_from_camera[0] = no_pose; },
      [](SessionState& s) { s.tracker.state.last.clear(); },
      [](SessionState& s) { s.tracker.state.last.push_back(s.tracker.state.last[0]); },
      [](SessionState& s) { s.tracker.state.lost_frames = -1; },
      [&](SessionState& s) { s.tracker.state.typical.photometric_rmse = nan; },
      [&](SessionState& s) { s.tracker.state.focal_costs[0] = nan; },
      [&](SessionState& s) { s.tracker.state.device.window = {.timestamp = nan}; },
      [&](SessionState& s) { s.tracker.state.device.windows = {{.rotation = nan}}; },
      [](SessionState& s) { s.tracker.state.device.contradictions = -1; },
      [&](SessionState& s) { s.back_end.atlas.keyframes[0].device_pose = no_pose; },
      [&](SessionState& s) { s.back_end.atlas.keyframes[0].device_drift = {.translation = nan}; },
      [&](SessionState& s) { s.tracker.reference.submap_from_camera = no_pose; },
      [&](SessionState& s) { s.tracker.prediction.submap_from_camera = no_pose; },
      [](SessionState& s) { s.tracker.state.frames_of_prediction = -1; },
      [](SessionState& s) { s.residency.device_last_seen.clear(); },
      [](SessionState& s) {
        s.residency.on_host = {{1 << 30, 0, 0}}, s.residency.host_last_seen = {1};
      },
      [](SessionState& s) { s.residency.origin.x() = std::numeric_limits<int>::min(); },
      [](SessionState& s) { s.rig.depth.width = 0; },
      [](SessionState& s) { s.rig.depth.height = 1 << 30; },
      [](SessionState& s) { s.rig.depth.fx = -1; },
      [&](SessionState& s) { s.rig.depth.cx = nan; },
      [](SessionState& s) { s.fuse.voxel_size = 0; },
      [](SessionState& s) { s.fuse.truncation = 0; },
      [](SessionState& s) { s.max_depth = 1e9f; },
      [&](SessionState& s) { s.last_fused = nan; },
  };
  for (std::size_t i = 0; i < damages.size(); ++i) {
    const TemporaryFolder folder;
    SessionState s = small_session();
    damages[i](s);
    SessionWriter(folder / "s").write(s, one_brick());
    const std::string error = error_of([&] { (void)read_session(folder / "s"); });
    EXPECT_NE(error.find("state.cbor: is damaged ("), std::string::npos) << i << ": " << error;
    EXPECT_EQ(error.find("json.exception"), std::string::npos) << error;
  }
}

/// State file with a valid first line.
std::string state_of(const std::string& cbor) {
  boost::crc_32_type crc;
  crc.process_bytes(cbor.data(), cbor.size());
  std::string line(32, ' ');
  line.resize(
      static_cast<std::size_t>(std::snprintf(line.data(), line.size(), "cairn session 10 %08x\n", crc.checksum())));
  return line + cbor;
}

TEST(SessionFiles, WithInvalidCborAreRejected) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "s");
  // A number, an empty map, arrays a million deep, a truncated text.
  for (const std::string& cbor :
       {std::string("\x01"), std::string("\xa0"), std::string(1000000, '\x81'), std::string("\x79\xff")}) {
    write_text(folder / "s" / "state.cbor", state_of(cbor));
    const std::string error = error_of([&] { (void)read_session(folder / "s"); });
    EXPECT_NE(error.find("state.cbor: is damaged ("), std::string::npos) << error;
    EXPECT_EQ(error.find("json.exception"), std::string::npos) << error;
  }
}

TEST(SessionFiles, ReportTheEntryWithAWrongLength) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "s");
  const std::string begin = std::string("\xa1\x63") + "rig";  // of a map with one entry
  const auto read_error = [&](const std::string& camera) {
    write_text(folder / "s" / "state.cbor", state_of(begin + camera));
    return error_of([&] { (void)read_session(folder / "s"); });
  };
  EXPECT_NE(read_error("\x41x").find("is damaged ('rig' ends early)"), std::string::npos);
  EXPECT_NE(read_error("\x58\xff" + std::string(0xff, '\0')).find("is damaged ('rig' is too long)"), std::string::npos);
}

TEST(SessionFiles, ReportTheFirstWriterToTheSecond) {
  const TemporaryFolder folder;
  {
    SessionWriter writer(folder / "s");
    writer.write(small_session(), one_brick());
    for (const auto& second :
         {std::function<void()>([&] { const SessionWriter w(folder / "s"); }),
          std::function<void()>([&] { const SessionWriter w(folder / "s", read_session(folder / "s")); }),
          std::function<void()>([&] { const SessionLock lock(folder / "s"); })}) {
      const std::string error = error_of(second);
      EXPECT_NE(error.find("another run writes into it (process " + std::to_string(getpid()) + ": "), std::string::npos)
          << error;
      EXPECT_NE(error.find("_tests"), std::string::npos) << error;
    }
    EXPECT_EQ(read_session(folder / "s").session.note, "a note");
  }
  // A lock file left by a killed process holds no lock.
  write_text(folder / "s" / "lock", "process 1: somebody");
  const SessionWriter writer(folder / "s", read_session(folder / "s"));
}

TEST(SessionFiles, OfThePreviousRunStayUntilTheFirstCheckpoint) {
  const TemporaryFolder folder;
  SessionState s = small_session();
  SessionWriter(folder / "s").write(s, one_brick());
  {
    const SessionWriter second(folder / "s");
    EXPECT_EQ(second.files().filename(), "run-0002");
    EXPECT_EQ(read_session(folder / "s").session.note, "a note");
  }
  EXPECT_EQ(names_in(folder / "s"), (std::set<std::string>{"run-0001", "state.cbor"}));
  {
    SessionWriter second(folder / "s");
    s.note = "another";
    second.write(s, one_brick());
    EXPECT_EQ(names_in(folder / "s"), (std::set<std::string>{"lock", "run-0002", "state.cbor"}));
  }
  EXPECT_EQ(read_session(folder / "s").session.note, "another");
  remove_session(folder / "s", SessionLock(folder / "s"));
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(SessionFiles, OfAFailedRunAreRemoved) {
  const TemporaryFolder folder;
  { const SessionWriter writer(folder / "s"); }
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(SessionFiles, OfKilledRunsAreRemovedAtTheNextStart) {
  const TemporaryFolder folder;
  SessionWriter(folder / "s").write(small_session(), one_brick());
  const fs::path run = folder / "s" / "run-0001";
  for (const fs::path& left :
       {folder / "s" / ".cairn-4711.state.cbor", run / ".cairn-4711.submap-0000.vdb",
        run / "keyframes" / ".cairn-4711.000001.corners", run / "active-000002.vdb", run / "frames-000002-000000.cbor"})
    write_text(left, "half");
  fs::create_directories(folder / "s" / "run-0002" / "keyframes");
  const SessionWriter writer(folder / "s", read_session(folder / "s"));
  EXPECT_EQ(names_in(folder / "s"), (std::set<std::string>{"lock", "run-0001", "state.cbor"}));
  EXPECT_EQ(names_in(run), (std::set<std::string>{"active-000001.vdb", "keyframes"}));
  EXPECT_TRUE(fs::is_empty(run / "keyframes"));
}

TEST(SessionFiles, OfOtherProgramsAreKept) {
  const TemporaryFolder folder;
  for (const char* name : {"run-0007", "run-0008/keyframes", "keyframes"}) fs::create_directories(folder / "s" / name);
  write_text(folder / "s" / "run-0007" / "thesis.txt", "mine");
  write_text(folder / "s" / "run-0008" / "keyframes" / "000001.png", "mine");
  for (const char* name : {"keyframes/000001.depth.png", "submap-0001.vdb", "active-000001.vdb"})
    write_text(folder / "s" / name, "mine");
  const auto before = bytes_below(folder / "s");
  for (int run = 0; run < 2; ++run) {
    SessionWriter writer(folder / "s");
    EXPECT_EQ(writer.files().filename(), "run-00" + std::string(run == 0 ? "09" : "10"));
    for (int i = 0; i < 2; ++i) writer.write(small_session(), one_brick());
  }
  remove_session(folder / "s", SessionLock(folder / "s"));
  EXPECT_TRUE(bytes_below(folder / "s") == before);
}

TEST(SessionFiles, RejectAForeignLockFile) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "s");
  write_text(folder / "s" / "lock", "mine");
  EXPECT_NE(error_of([&] { const SessionLock lock(folder / "s"); }).find("is not the lock file of a session"),
            std::string::npos);
  EXPECT_EQ(read_bytes(folder / "s" / "lock"), "mine");
}

/// Names of files of one kind in a run's folder.
std::set<std::string> named(const fs::path& run, const std::string& begin) {
  std::set<std::string> names = names_in(run);
  std::erase_if(names, [&](const std::string& name) { return !name.starts_with(begin); });
  return names;
}

/// Adds frames up to `count`.
void fill(Atlas& atlas, std::size_t count) {
  while (atlas.frames.size() < count)
    atlas.add_frame(0.1 * static_cast<double>(atlas.frames.size()),
                    Eigen::Isometry3d(Eigen::Translation3d(0.001 * static_cast<double>(atlas.frames.size()), 0, 0)));
}

TEST(SessionFiles, OfFramesAreWrittenOnce) {
  const TemporaryFolder folder;
  const fs::path run = folder / "s" / "run-0001";
  constexpr std::size_t kChunk = FusedFrames::kChunk;
  SessionState s = small_session();
  SessionWriter writer(folder / "s");
  fill(s.back_end.atlas, 2 * kChunk + 5);
  writer.write(s, one_brick());
  const std::set<std::string> two{"frames-000001-000000.cbor", "frames-000001-000001.cbor"};
  const auto frame_files = [&] { return named(run, "frames-"); };
  EXPECT_EQ(frame_files(), two);
  const auto first = fs::last_write_time(run / *two.begin());
  const auto state_size = fs::file_size(folder / "s" / "state.cbor");

  fill(s.back_end.atlas, 3 * kChunk + 5);
  s.number = 2;
  writer.write(s, one_brick());
  std::set<std::string> three = two;
  three.insert("frames-000002-000002.cbor");
  EXPECT_EQ(frame_files(), three);
  EXPECT_EQ(fs::last_write_time(run / *two.begin()), first);
  EXPECT_LT(fs::file_size(folder / "s" / "state.cbor"), state_size + 100);

  const FusedFrames read = read_session(folder / "s").session.back_end.atlas.frames;
  ASSERT_EQ(read.size(), s.back_end.atlas.frames.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    ASSERT_EQ(read[i].timestamp, s.back_end.atlas.frames[i].timestamp);
    ASSERT_EQ(read[i].keyframe, s.back_end.atlas.frames[i].keyframe);
    ASSERT_EQ(read[i].twist, s.back_end.atlas.frames[i].twist);
  }

  // Frames moved since then are not stored in the files.
  FusedFrames moved;
  moved.push_back(s.back_end.atlas.frames.full()[0]);
  for (std::size_t i = kChunk; i < read.size(); ++i) {
    FusedFrame frame = read[i];
    frame.twist[0] += 1;
    moved.push_back(frame);
  }
  s.back_end.atlas.frames = moved;
  s.number = 3;
  writer.write(s, one_brick());
  EXPECT_EQ(frame_files(), (std::set<std::string>{"frames-000001-000000.cbor", "frames-000003-000001.cbor",
                                                  "frames-000003-000002.cbor"}));
  EXPECT_EQ(read_session(folder / "s").session.back_end.atlas.frames[kChunk].twist[0], read[kChunk].twist[0] + 1);
}

TEST(SessionFiles, ReportMissingOrDamagedFrames) {
  const TemporaryFolder folder;
  SessionState s = small_session();
  fill(s.back_end.atlas, FusedFrames::kChunk + 5);
  SessionWriter(folder / "s").write(s, one_brick());
  const fs::path file = folder / "s" / "run-0001" / "frames-000001-000000.cbor";
  std::string bytes = read_bytes(file);
  const auto read_error = [&] { return error_of([&] { (void)read_session(folder / "s"); }); };
  const auto expect_read_error = [&](const std::string& what) {
    const std::string error = read_error(), end = "; the session is damaged: begin a new session";
    EXPECT_EQ(error, file.string() + ": " + what + end);
  };
  ++bytes.back();
  write_text(file, bytes);
  expect_read_error("is damaged");
  write_text(file, bytes.substr(0, 5));
  expect_read_error("does not begin with 'cairn frames'");
  write_text(file, "cairn frames 1 00000000\n");
  expect_read_error(fmt::format("was written by another version of cairn (format 1, this one reads {} to {})",
                                Session::kOldestFormat, Session::kFormat));
  fs::remove(file);
  expect_read_error("cannot be opened");
}

/// Adds keyframes up to `count`, each with a loop to the first.
void add_keyframes(SessionState& s, std::size_t count) {
  Atlas& atlas = s.back_end.atlas;
  while (atlas.keyframes.size() < count) {
    const std::size_t k = atlas.keyframes.size();
    atlas.keyframes.push_back(
        {.frame = static_cast<int>(k), .timestamp = 0.1 * static_cast<double>(k), .follows = true});
    atlas.keyframes.back().structure.facings = {{.normal = Eigen::Vector3f::UnitX(), .area = 1}};
    atlas.world_from_camera.push_back(Eigen::Isometry3d::Identity());
    atlas.loops.push_back({.edge = {.i = 0, .j = k, .is_loop_closure = true}, .feature_inliers = static_cast<int>(k)});
    s.back_end.tracked_from_camera.emplace_back(Eigen::Isometry3d::Identity());
  }
}

TEST(SessionFiles, OfKeyframesAndLoopsAreWrittenOnlyIfChanged) {
  const TemporaryFolder folder;
  const fs::path run = folder / "s" / "run-0001";
  constexpr std::size_t kChunk = NamedFiles::kChunk;
  SessionState s = small_session();
  add_keyframes(s, 2 * kChunk + 5);
  {
    SessionWriter writer(folder / "s");
    writer.write(s, one_brick());
    EXPECT_EQ(named(run, "keyframes-"),
              (std::set<std::string>{"keyframes-000001-000000.cbor", "keyframes-000001-000001.cbor"}));
    EXPECT_EQ(named(run, "loops-"), (std::set<std::string>{"loops-000001-000000.cbor", "loops-000001-000001.cbor"}));
    const auto first = fs::last_write_time(run / "keyframes-000001-000000.cbor");
    const auto state_size = fs::file_size(folder / "s" / "state.cbor");

    add_keyframes(s, 3 * kChunk + 5);
    s.back_end.atlas.keyframes[kChunk].timestamp += 0.01;
    s.back_end.atlas.loops[0].inlier = false;
    s.number = 2;
    writer.write(s, one_brick());
    EXPECT_EQ(named(run, "keyframes-"),
              (std::set<std::string>{"keyframes-000001-000000.cbor", "keyframes-000002-000001.cbor",
                                     "keyframes-000002-000002.cbor"}));
    EXPECT_EQ(named(run, "loops-"), (std::set<std::string>{"loops-000001-000001.cbor", "loops-000002-000000.cbor",
                                                           "loops-000002-000002.cbor"}));
    EXPECT_EQ(fs::last_write_time(run / "keyframes-000001-000000.cbor"), first);
    constexpr std::size_t kPoses = 2 * 16 * sizeof(double) + 1;  // of a keyframe, in the world and as tracked
    EXPECT_LT(fs::file_size(folder / "s" / "state.cbor"), state_size + kChunk * kPoses + 200);
  }

  // A resumed run writes none of them again.
  const ReadSession read = read_session(folder / "s");
  const Atlas &atlas = s.back_end.atlas, &again = read.session.back_end.atlas;
  ASSERT_EQ(again.keyframes.size(), atlas.keyframes.size());
  ASSERT_EQ(again.loops.size(), atlas.loops.size());
  for (std::size_t k = 0; k < atlas.keyframes.size(); ++k) {
    ASSERT_EQ(again.keyframes[k].frame, atlas.keyframes[k].frame);
    ASSERT_EQ(again.keyframes[k].timestamp, atlas.keyframes[k].timestamp);
    ASSERT_EQ(again.keyframes[k].structure.facings.size(), atlas.keyframes[k].structure.facings.size());
  }
  for (std::size_t l = 0; l < atlas.loops.size(); ++l) {
    ASSERT_EQ(again.loops[l].edge.j, atlas.loops[l].edge.j);
    ASSERT_EQ(again.loops[l].inlier, atlas.loops[l].inlier);
  }
  const auto keyframes = named(run, "keyframes-"), loops = named(run, "loops-");
  SessionWriter writer(folder / "s", read);
  EXPECT_EQ(named(run, "keyframes-"), keyframes);
  s.number = 3;
  writer.write(s, one_brick());
  EXPECT_EQ(named(run, "keyframes-"), keyframes);
  EXPECT_EQ(named(run, "loops-"), loops);
  EXPECT_EQ(read_pictures(folder / "s").timestamps.size(), atlas.keyframes.size());
}

TEST(SessionFiles, ReportMissingOrDamagedKeyframes) {
  const TemporaryFolder folder;
  SessionState s = small_session();
  add_keyframes(s, NamedFiles::kChunk + 1);  // a full chunk of loops as well
  SessionWriter(folder / "s").write(s, one_brick());
  const fs::path file = folder / "s" / "run-0001" / "keyframes-000001-000000.cbor";
  const auto expect_read_error = [&](const std::string& what) {
    const std::string end = "; the session is damaged: begin a new session";
    EXPECT_EQ(error_of([&] { (void)read_session(folder / "s"); }), file.string() + ": " + what + end);
  };
  std::string bytes = read_bytes(file);
  ++bytes.back();
  write_text(file, bytes);
  expect_read_error("is damaged");
  fs::copy_file(folder / "s" / "run-0001" / "loops-000001-000000.cbor", file, fs::copy_options::overwrite_existing);
  expect_read_error("does not begin with 'cairn keyframes'");
  fs::remove(file);
  expect_read_error("cannot be opened");
}

TEST(SessionFiles, StayWhileTheyAreRead) {
  const TemporaryFolder folder;
  SessionWriter(folder / "s").write(small_session(), one_brick());
  std::optional<ReadSession> reader(read_session(folder / "s"));
  SessionWriter second(folder / "s");
  second.write(small_session(), one_brick());
  EXPECT_TRUE(fs::exists(reader->files / "active-000001.vdb"));
  reader.reset();
  second.write(small_session(), one_brick());
  EXPECT_EQ(names_in(folder / "s"), (std::set<std::string>{"lock", "run-0002", "state.cbor"}));
}

TEST(SessionFiles, AreConsistentForConcurrentReaders) {
  const TemporaryFolder folder;
  SessionWriter(folder / "s").write(small_session(), one_brick());
  std::atomic<bool> ended = false;
  std::thread writing([&] {
    SessionState s = small_session();
    for (int run = 0; run < 10; ++run) {
      SessionWriter writer(folder / "s");
      for (int i = 0; i < 5; ++i) {
        ++s.number;
        writer.write(s, one_brick());
      }
    }
    ended = true;
  });
  int read = 0;
  for (; !ended; ++read) EXPECT_EQ(read_session(folder / "s").active.size(), 1u);
  writing.join();
  EXPECT_GT(read, 5);
}

}  // namespace
}  // namespace cairn
