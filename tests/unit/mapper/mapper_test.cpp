// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Mapping of invalid frames and failures of stages: reports the problem and continues.
#include "cairn/mapping/mapper.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <cstring>
#include <limits>

#include "cairn/building/merge.hpp"
#include "cairn/io/source.hpp"
#include "cairn/mapping/live_surface.hpp"
#include "cairn/mapping/session.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();

/// First frames along a path through the room, seen by a small camera.
const std::vector<Frame>& room_frames() {
  static const std::vector<Frame> frames = [] {
    std::vector<Frame> made;
    for (int i = 0; i < 12; ++i) made.push_back(scene_frame(synthetic_scene("room"), small_camera(), i, true));
    return made;
  }();
  return frames;
}

Options coarse() {
  Options options;
  options.fuse = {.voxel_size = 0.02f, .truncation = 0.08f, .device_memory = std::uint64_t{96} << 20};
  return options;
}

bool is_same(const Mesh& a, const Mesh& b) { return a.positions == b.positions && a.triangles == b.triangles; }

/// Writes a session without frames.
void save(const std::filesystem::path& folder, const Rig& rig, const Options& options) {
  Session session = Session::create(folder);
  const Mapper mapper = session.mapper(rig, options);
  session.checkpoint(mapper);
  EXPECT_FALSE(session.problem());
}

TEST(Mapper, AnswersAllQueriesBeforeTheFirstFrame) {
  const TemporaryFolder folder;
  Session session = Session::create(folder / "session");
  Mapper mapper = session.mapper(small_camera(), coarse());
  EXPECT_TRUE(mapper.trajectory().empty());
  EXPECT_EQ(mapper.recordings(), 1);
  EXPECT_EQ(mapper.refine().keyframes, 0);
  EXPECT_TRUE(mapper.keyframes().empty());
  EXPECT_TRUE(mapper.loops().empty());
  EXPECT_TRUE(mapper.map().mesh().triangles.empty());
  EXPECT_TRUE(LiveSurface(mapper).changes().parts.empty());
  EXPECT_TRUE(mapper.map().distances()->blocks().empty());
  EXPECT_EQ(mapper.live_distances(), nullptr);
  EXPECT_EQ(mapper.statistics().components, 0);
  mapper.map().write_graph(folder / "graph.g2o");
  mapper.map().write_graph(folder / "graph.svg");
  mapper.begin_recording();
  session.checkpoint(mapper);
  EXPECT_FALSE(session.problem());
  EXPECT_NE(error_of([&] { mapper.map().export_mesh(folder / "mesh.glb"); }).find("the map is empty"),
            std::string::npos);
  EXPECT_TRUE(mapper.warnings().empty());
}

TEST(MergeSessions, RejectsDifferentCamerasOrVoxelSizes) {
  const TemporaryFolder folder;
  const auto refuses = [&](const char* why, const char* other) {
    const std::string message = error_of([&] {
      (void)merge_sessions({folder / "session", folder / other}, folder / "merged");
    });
    EXPECT_NE(message.find(why), std::string::npos) << message;
    EXPECT_FALSE(std::filesystem::exists(folder / "merged/state.cbor"));
  };
  save(folder / "session", small_camera(), coarse());
  save(folder / "camera", synthetic_camera(), coarse());
  refuses("another camera", "camera");
  Options options = coarse();
  options.fuse.voxel_size = 0.04f;
  save(folder / "voxels", small_camera(), options);
  refuses("voxels of 0.04 m", "voxels");
}

TEST(SessionCalibration, ContinuesWithItsOwn) {
  const TemporaryFolder folder;
  Rig found = small_camera(), given = small_camera();
  found.depth.readout = 0.028, found.depth_correction = {2, 2, {0, 0.001f, 0, -0.001f}};
  save(folder / "session", found, coarse());
  const auto continue_with = [&](const Rig& rig) {
    const Mapper mapper = Session::resume(folder / "session").mapper(rig, coarse());
    EXPECT_EQ(mapper.rig().depth.readout, found.depth.readout);
    EXPECT_EQ(mapper.rig().depth_correction, found.depth_correction);
  };
  continue_with(given);
  continue_with(found);
  given.depth.readout = 0.02;
  EXPECT_NE(error_of([&] { continue_with(given); }).find("another camera"), std::string::npos);
}

TEST(MergeSessions, AcceptsDifferentReadouts) {
  const TemporaryFolder folder;
  Rig found = small_camera();
  found.depth.readout = 0.028;
  save(folder / "a", found, coarse());
  save(folder / "b", small_camera(), coarse());
  EXPECT_EQ(error_of([&] {
              (void)merge_sessions({folder / "a", folder / "b"}, folder / "merged");
            }).find("another camera"),
            std::string::npos);
}

TEST(Mapper, RejectsInvalidFrames) {
  const std::vector<Frame>& frames = room_frames();
  Mapper mapper(small_camera(), coarse());
  const auto refuses = [&](const Frame& good, FrameCause why, const auto& spoil) {
    Frame frame = good;
    spoil(frame);
    const FrameReport report = mapper.add(frame);
    EXPECT_EQ(report.state, FrameState::skipped) << to_string(why);
    EXPECT_EQ(report.cause, why) << report.reason;
  };
  const auto refuses_all = [&](const Frame& good) {
    for (const float bad : {kNan, -1.0f, kInf, -kInf})
      refuses(good, FrameCause::bad_depth, [&](Frame& f) { f.depth[100] = bad; });
    refuses(good, FrameCause::bad_depth, [](Frame& f) { std::fill(f.depth.begin(), f.depth.end(), kNan); });
    refuses(good, FrameCause::wrong_size, [](Frame& f) { f.depth.pop_back(); });
    refuses(good, FrameCause::wrong_size, [](Frame& f) { f.depth.clear(); });
    for (const float bad : {kNan, kInf, -kInf})
      refuses(good, FrameCause::bad_timestamp, [&](Frame& f) { f.timestamp = static_cast<double>(bad); });
  };
  refuses_all(frames[0]);
  EXPECT_TRUE(mapper.map().mesh().triangles.empty());
  ASSERT_EQ(mapper.add(frames[0]).state, FrameState::fused);
  const Mesh before = mapper.map().mesh();
  refuses_all(frames[1]);
  refuses(frames[1], FrameCause::timestamp_goes_back, [](Frame& f) { f.timestamp = 0; });
  EXPECT_TRUE(is_same(mapper.map().mesh(), before));
  EXPECT_EQ(mapper.trajectory().size(), 1u);
  // Only the invalid values beside the depth image are ignored.
  Frame frame = frames[1];
  frame.acceleration = Eigen::Vector3d(0, static_cast<double>(kInf), 0);
  frame.color_delay = static_cast<double>(kNan);
  const FrameReport report = mapper.add(frame);
  EXPECT_EQ(report.state, FrameState::fused);
  EXPECT_EQ(report.cause, FrameCause::partly_used);
  EXPECT_NE(report.reason.find("acceleration is not finite"), std::string::npos) << report.reason;
  EXPECT_NE(report.reason.find("only depth is used"), std::string::npos) << report.reason;
  EXPECT_FALSE(mapper.upright().off);
  for (std::size_t i = 2; i < 6; ++i) EXPECT_EQ(mapper.add(frames[i]).state, FrameState::fused);
  EXPECT_TRUE(mapper.warnings().empty());
}

TEST(Mapper, RejectsInvalidPoses) {
  Mapper mapper(small_camera(), coarse(), Poses::given);
  const auto refuses = [&](FrameCause why, const auto& spoil) {
    Frame frame = room_frames()[0];
    spoil(*frame.world_from_camera);
    const FrameReport report = mapper.add(frame);
    EXPECT_EQ(report.state, FrameState::skipped) << to_string(why);
    EXPECT_EQ(report.cause, why) << report.reason;
  };
  const auto no_motion = FrameCause::bad_pose;
  refuses(no_motion, [](auto& pose) { pose.translation().x() = static_cast<double>(kNan); });
  refuses(no_motion, [](auto& pose) { pose.matrix()(0, 0) = static_cast<double>(kInf); });
  refuses(no_motion, [](auto& pose) { pose.linear() *= 2; });
  refuses(no_motion, [](auto& pose) { pose.linear().col(0) *= -1; });
  refuses(no_motion, [](auto& pose) { pose.linear().setZero(); });
  refuses(FrameCause::far_pose, [](auto& pose) { pose.translation().y() = 1e12; });
  EXPECT_TRUE(mapper.map().mesh().triangles.empty());
  EXPECT_EQ(mapper.add(room_frames()[0]).state, FrameState::fused);
}

TEST(Mapper, ContinuesWithoutAnOversizedDistanceField) {
  const TemporaryFolder folder;
  Options options = coarse();
  options.esdf = {.live = true, .voxel_size = 0.02f};
  Mapper mapper(small_camera(), options, Poses::given);
  ASSERT_EQ(mapper.add(room_frames()[0]).state, FrameState::fused);
  EXPECT_NE(mapper.live_distances(), nullptr);
  for (std::size_t i = 1; i < 4; ++i) {
    Frame frame = room_frames()[i];
    frame.world_from_camera->translation().x() += 200 * static_cast<double>(i);
    EXPECT_EQ(mapper.add(frame).state, FrameState::fused) << i;
    EXPECT_EQ(mapper.live_distances(), nullptr);
  }
  ASSERT_EQ(mapper.warnings().size(), 1u);
  EXPECT_NE(mapper.warnings()[0].find("raise EsdfOptions::voxel_size; the distance field is disabled"),
            std::string::npos)
      << mapper.warnings()[0];
  EXPECT_EQ(mapper.trajectory().size(), 4u);
  mapper.map().write_grids(folder / "map.vdb");
  EXPECT_TRUE(std::filesystem::exists(folder / "map.vdb"));
}

TEST(Mapper, KeepsTheMapIfAViewExceedsDeviceMemory) {
  Options options;
  options.fuse.voxel_size = 0.005f;
  options.fuse.truncation = 0.02f;
  options.fuse.device_memory = std::uint64_t{76} << 20;  // including 64 for the page table
  Mapper mapper(small_camera(), options, Poses::given);
  Frame narrow = room_frames()[0], wide = room_frames()[1];
  for (int y = 0; y < 240; ++y)
    for (int x = 0; x < 320; ++x)
      if (x < 140 || x > 180) narrow.depth[static_cast<std::size_t>(y * 320 + x)] = 0;
  ASSERT_EQ(mapper.add(narrow).state, FrameState::fused);
  const Mesh before = mapper.map().mesh();
  ASSERT_FALSE(before.triangles.empty());
  EXPECT_NE(error_of([&] { mapper.add(wide); }).find("does not hold one view"), std::string::npos);
  EXPECT_TRUE(is_same(mapper.map().mesh(), before));
  EXPECT_EQ(mapper.trajectory().size(), 1u);
  // The rejected region may be added later.
  Frame later = narrow;
  later.timestamp = wide.timestamp + 1;
  std::rotate(later.depth.begin(), later.depth.begin() + 60, later.depth.end());
  ASSERT_EQ(mapper.add(later).state, FrameState::fused);
  EXPECT_GT(mapper.map().mesh().triangles.size(), before.triangles.size() * 3 / 2);
}

TEST(Mapper, KeepsPosesIfRefinementFails) {
  const TemporaryFolder folder;
  Session session = Session::create(folder / "session");
  Mapper mapper = session.mapper(small_camera(), coarse());
  for (const Frame& frame : room_frames()) ASSERT_EQ(mapper.add(frame).state, FrameState::fused);
  ASSERT_GE(mapper.keyframes().size(), 2u);
  session.checkpoint(mapper);
  ASSERT_FALSE(session.problem());
  const Trajectory before = mapper.trajectory();
  for (const auto& entry : std::filesystem::directory_iterator(folder / "session" / "run-0001" / "keyframes"))
    std::filesystem::remove(entry);
  EXPECT_EQ(mapper.refine().pairs_aligned, 0);
  ASSERT_EQ(mapper.warnings().size(), 1u);
  EXPECT_NE(mapper.warnings()[0].find("is missing or broken"), std::string::npos) << mapper.warnings()[0];
  EXPECT_NE(mapper.warnings()[0].find("poses stay unchanged"), std::string::npos) << mapper.warnings()[0];
  const Trajectory after = mapper.trajectory();
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t i = 0; i < after.size(); ++i)
    EXPECT_EQ(after[i].world_from_camera.matrix(), before[i].world_from_camera.matrix());
}

/// Recording with an error in the middle.
class BrokenSource : public Source {
 public:
  [[nodiscard]] const Rig& rig() const override { return rig_; }
  [[nodiscard]] std::optional<int> size() const override { return std::nullopt; }
  [[nodiscard]] std::optional<Frame> next() override {
    if (next_ == 5) throw std::runtime_error("the disk went away");
    return room_frames()[next_++];
  }

 private:
  Rig rig_ = small_camera();
  std::size_t next_ = 0;
};

TEST(Mapper, KeepsTheMapIfReintegrationFails) {
  Mapper mapper(small_camera(), coarse());
  for (const Frame& frame : room_frames()) ASSERT_EQ(mapper.add(frame).state, FrameState::fused);
  const Mesh before = mapper.map().mesh();
  BrokenSource source;
  mapper.reintegrate(source);
  ASSERT_EQ(mapper.warnings().size(), 1u);
  EXPECT_EQ(mapper.warnings()[0], "the disk went away; frames are not re-integrated");
  EXPECT_TRUE(is_same(mapper.map().mesh(), before));
  EXPECT_EQ(mapper.trajectory().size(), room_frames().size());
}

TEST(Mapper, KeepsTheMapIfAStageIsInterrupted) {
  Mapper mapper(small_camera(), coarse());
  for (const Frame& frame : room_frames()) ASSERT_EQ(mapper.add(frame).state, FrameState::fused);
  const Mesh before = mapper.map().mesh();
  const Trajectory path = mapper.trajectory();
  EXPECT_EQ(mapper.refine([](double) { return false; }).pairs_aligned, 0);
  // Among the keyframes, and after some of the frames.
  for (const int last : {0, 3}) {
    GivenFrames second_pass(small_camera(), room_frames());
    int seen = 0;
    mapper.reintegrate(second_pass, {}, [&](int frames) {
      seen = frames;
      return frames < last;
    });
    EXPECT_EQ(seen, last);
  }
  EXPECT_EQ(mapper.warnings(), (std::vector<std::string>{"interrupted; poses stay unchanged",
                                                         "interrupted; frames are not re-integrated"}));
  EXPECT_TRUE(is_same(mapper.map().mesh(), before));
  ASSERT_EQ(mapper.trajectory().size(), path.size());
  for (std::size_t i = 0; i < path.size(); ++i)
    EXPECT_TRUE(mapper.trajectory()[i].world_from_camera.isApprox(path[i].world_from_camera)) << i;
}

/// Number of voxels known to two fields of the same size, and known to only one.
std::pair<int, int> known_to(const DistanceField& a, const DistanceField& b) {
  int both = 0, one = 0;
  for (const auto& [from, to] : {std::pair{&a, &b}, {&b, &a}})
    for (const auto& [block, samples] : from->blocks())
      for (int i = 0; i < 4096; ++i) {
        if (std::isnan((*samples)[static_cast<std::size_t>(i)])) continue;
        ++(to->query(from->point(DistanceField::voxel(block, i).cast<float>())).known ? both : one);
      }
  return {both / 2, one};
}

TEST(Mapper, HasTheSameFreeSpaceLiveInFilesAndAfterResume) {
  const TemporaryFolder folder;
  Options options = coarse();
  options.esdf.live = true;
  options.up = Up::camera;  // to give the live and the written field the same voxel grid
  Mapper full_map(small_camera(), options);
  for (const Frame& frame : room_frames()) ASSERT_EQ(full_map.add(frame).state, FrameState::fused);
  const auto written = full_map.map().distances();
  const auto [same, different] = known_to(*written, *full_map.live_distances());
  EXPECT_GT(same, 50000);
  EXPECT_EQ(different, 0);
  for (const StampedPose& pose : full_map.trajectory()) {
    const auto answer = full_map.live_distances()->query(pose.world_from_camera.translation().cast<float>());
    EXPECT_TRUE(answer.known);
    EXPECT_GT(answer.distance, 0.0f);
  }
  full_map.map().write_grids(folder / "map.vdb");
  EXPECT_EQ(known_to(*written, *Map::open(folder / "map.vdb").distances(options.esdf)).second, 0);

  // A run interrupted after half of the frames and resumed.
  {
    Session session = Session::create(folder / "session");
    Mapper half = session.mapper(small_camera(), options);
    for (std::size_t i = 0; i < 6; ++i) ASSERT_EQ(half.add(room_frames()[i]).state, FrameState::fused);
    session.checkpoint(half);
    ASSERT_FALSE(session.problem());
  }
  Session session = Session::resume(folder / "session");
  Mapper rest = session.mapper(small_camera(), options);
  for (std::size_t i = 6; i < 12; ++i) ASSERT_EQ(rest.add(room_frames()[i]).state, FrameState::fused);
  EXPECT_EQ(known_to(*written, *rest.live_distances()).second, 0);
  session.checkpoint(rest);
  ASSERT_FALSE(session.problem());
  EXPECT_EQ(known_to(*written, *Map::open(folder / "session").distances(options.esdf)).second, 0);
}

TEST(Mapper, OmitsAMissingSubmap) {
  const TemporaryFolder folder;
  Options options = coarse();
  options.map.submap_keyframes = 2;
  options.map.host_memory = 1;  // all but the last wait on disk
  Session session = Session::create(folder / "session");
  Mapper mapper = session.mapper(small_camera(), options);
  const Scene scene = synthetic_scene("room");
  for (int i = 0; i < 16; ++i) {
    Frame frame = scene_frame(scene, small_camera(), 4 * i, true);
    frame.index = i;
    ASSERT_EQ(mapper.add(frame).state, FrameState::fused) << i;
  }
  ASSERT_GE(mapper.statistics().submaps, 2);
  session.checkpoint(mapper);
  ASSERT_FALSE(session.problem());
  std::filesystem::remove(folder / "session" / "run-0001" / "submap-0000.vdb");
  mapper.begin_recording();  // requires the entire world
  EXPECT_FALSE(mapper.map().mesh().triangles.empty());
  ASSERT_EQ(mapper.warnings().size(), 1u);
  EXPECT_NE(mapper.warnings()[0].find("submap-0000.vdb"), std::string::npos) << mapper.warnings()[0];
}

TEST(Mapper, MapsWithoutColorOnSomeFramesOrOnAll) {
  for (const std::size_t step : {1u, 3u}) {
    Mapper mapper(small_camera(), coarse());
    for (std::size_t i = 0; i < room_frames().size(); ++i) {
      Frame frame = room_frames()[i];
      if (i % step == 0) frame.color.clear();
      EXPECT_EQ(mapper.add(frame).state, FrameState::fused) << step << " " << i;
    }
    EXPECT_GT(mapper.map().mesh().triangles.size(), 1000u);
  }
}

TEST(Mapper, WritesAPreviewOfALargeMesh) {
  const TemporaryFolder folder;
  Mapper mapper(small_camera(), coarse());
  for (const Frame& frame : room_frames()) mapper.add(frame);
  ExportOptions options{.cell_size = 1.0f};
  const ExportReport alone = mapper.map().export_mesh(folder / "alone.glb", options);
  options.preview = {.file = folder / "preview.glb", .triangles = alone.triangles};
  mapper.map().export_mesh(folder / "mesh.glb", options);
  // Compression rounds positions: a few triangles lose their area.
  EXPECT_NEAR(static_cast<double>(read_mesh(options.preview.file).triangles.size()),
              static_cast<double>(alone.triangles), 5e-3 * static_cast<double>(alone.triangles));
  EXPECT_LT(2 * std::filesystem::file_size(options.preview.file), std::filesystem::file_size(folder / "mesh.glb"));
  options.preview.triangles = alone.triangles / 8;
  const ExportReport both = mapper.map().export_mesh(folder / "mesh.glb", options);
  EXPECT_GT(both.parts, 3);
  EXPECT_EQ(both.error, 0.0f);  // of the mesh, not of the preview
  EXPECT_EQ(read_bytes(folder / "mesh.glb"), read_bytes(folder / "alone.glb"));
  const std::size_t left = read_mesh(options.preview.file).triangles.size();
  EXPECT_GT(left, 100u);
  EXPECT_LT(left, alone.triangles / 2);
}

TEST(Mapper, StartsNoComponentWithoutDepth) {
  Options options = coarse();
  options.map.lost_frames = 3;
  Mapper mapper(small_camera(), options);
  ASSERT_EQ(mapper.add(room_frames()[0]).state, FrameState::fused);
  for (int i = 1; i < 10; ++i) {
    Frame dark = room_frames()[1];
    dark.timestamp = i;
    std::fill(dark.depth.begin(), dark.depth.end(), 0.0f);
    dark.depth[static_cast<std::size_t>(i)] = 1;  // an identical image would be a stuck sensor
    EXPECT_EQ(mapper.add(dark).state, FrameState::lost);
  }
  EXPECT_EQ(mapper.statistics().components, 1);
}

TEST(Mapper, FindsAKnownViewAgainWithinFiveFrames) {
  constexpr int kMapped = 60, kEvery = 3, kDark = 20, kMaxFrames = 5;
  const Scene room = synthetic_scene("room");
  Mapper mapper(small_camera(), coarse());
  int added = 0;
  const auto add = [&](Frame frame) {
    frame.index = added;
    frame.timestamp = added++ / 30.0;
    return mapper.add(frame);
  };
  const auto seen = [&](int i) { return scene_frame(room, small_camera(), kEvery * i, true); };
  for (int i = 0; i < kMapped; ++i) ASSERT_EQ(add(seen(i)).state, FrameState::fused) << i;
  const Eigen::Isometry3d first = room.world_from_camera(0);
  for (const int place : {5, 25, 45}) {
    for (int i = 0; i < kDark; ++i) {
      Frame dark = seen(kMapped - 1);
      std::fill(dark.depth.begin(), dark.depth.end(), 0.0f);
      std::fill(dark.color.begin(), dark.color.end(), 0xff000000u);
      dark.depth[static_cast<std::size_t>(added)] = 1;  // an identical image would be a stuck sensor
      EXPECT_EQ(add(std::move(dark)).state, FrameState::lost);
    }
    FrameReport report;
    int frames = 0;
    do report = add(seen(place + frames));
    while (++frames < kMaxFrames && report.state != FrameState::fused);
    ASSERT_EQ(report.state, FrameState::fused) << place;
    const Eigen::Isometry3d truth = first.inverse() * room.world_from_camera(kEvery * (place + frames - 1) / 30.0);
    EXPECT_LT((report.tracked_from_camera->translation() - truth.translation()).norm(), 0.02) << place;
  }
  EXPECT_EQ(mapper.statistics().components, 1);
}

TEST(Mapper, ReportsPoseCovariance) {
  constexpr double kChance = 22.46;  // 99.9 % of the chi-squared distribution with 6 degrees of freedom
  Mapper mapper(small_camera(), coarse());
  const Eigen::Isometry3d first = *room_frames()[0].world_from_camera;
  const FrameReport begin = mapper.add(room_frames()[0]);
  ASSERT_TRUE(begin.tracked_from_camera);
  EXPECT_TRUE(begin.tracked_from_camera->matrix().isIdentity());
  EXPECT_FALSE(begin.covariance);  // no map to align with
  int within = 0;
  for (std::size_t i = 1; i < room_frames().size(); ++i) {
    const FrameReport report = mapper.add(room_frames()[i]);
    ASSERT_TRUE(report.tracked_from_camera && report.covariance) << i;
    const Eigen::Isometry3d truth = first.inverse() * *room_frames()[i].world_from_camera;
    const Vector6d error = local_coordinates(truth.inverse() * *report.tracked_from_camera);
    within += error.dot(report.covariance->ldlt().solve(error)) < kChance;
    EXPECT_LT(std::sqrt(report.covariance->diagonal().maxCoeff()), 0.02) << i;  // a furnished room constrains a camera
  }
  EXPECT_GE(within, static_cast<int>(room_frames().size()) - 2);
}

TEST(Mapper, ReportsALargeCovarianceAlongAWall) {
  Options options = coarse();
  options.track.photometric = false;
  Mapper mapper(small_camera(), options);
  const Scene scene = synthetic_scene("plane");
  const Eigen::Isometry3d facing = scene.world_from_camera(0);
  FrameReport report;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Isometry3d pose = facing * Eigen::Translation3d(0, 0, 0.01 * i);
    report = mapper.add(scene_frame_at(scene, small_camera(), pose, i));
  }
  ASSERT_TRUE(report.covariance);
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(*report.covariance);
  const Vector6d deviations = solver.eigenvalues().cwiseSqrt();  // ascending
  EXPECT_LT(deviations[2], 0.02);                                // the distance, and two tilts
  EXPECT_GT(deviations[3], 0.5);                                 // two translations along the wall, and the rotation in
                                                                 // its plane
  EXPECT_LT(deviations[5], 1.5);
}

TEST(Map, ReturnsVoxelsAsArrays) {
  Options options = coarse();
  Mapper mapper(small_camera(), options, Poses::given);
  const Scene scene = synthetic_scene("room");
  for (int i = 0; i < 3; ++i) mapper.add(scene_frame(scene, small_camera(), i));
  const Voxels voxels = mapper.map().voxels();
  EXPECT_FLOAT_EQ(voxels.voxel_size, options.fuse.voxel_size);
  ASSERT_GT(voxels.blocks.size(), 100u);
  ASSERT_EQ(voxels.distances.size(), 512 * voxels.blocks.size());
  std::size_t near = 0, right = 0;
  for (std::size_t i = 0; i < voxels.distances.size(); ++i) {
    if (!(voxels.weights[i] > 0) || std::abs(voxels.distances[i]) > 0.5f * voxels.truncation) continue;
    const int in_block = static_cast<int>(i % 512);
    const Eigen::Vector3i voxel =
        8 * voxels.blocks[i / 512] + Eigen::Vector3i(in_block / 64, in_block / 8 % 8, in_block % 8);
    const Eigen::Vector3f point = voxels.world_from_voxels * (voxels.voxel_size * voxel.cast<float>());
    ++near;
    right += std::abs(scene.distance(point.cast<double>()) - static_cast<double>(voxels.distances[i])) < 0.02;
  }
  EXPECT_GT(near, 1000u);
  EXPECT_GT(static_cast<double>(right), 0.8 * static_cast<double>(near));  // distances along rays are longer at a slant
}

}  // namespace
}  // namespace cairn
