// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Views of a room in its saved map: other noise, other places, other cameras, moved things.
#include "cairn/mapping/localizer.hpp"

#include <gtest/gtest.h>

#include "cairn/mapping/mapper.hpp"
#include "cairn/mapping/session.hpp"
#include "cairn/synthetic/synthetic.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr int kMapped = 28, kStep = 5;                // frames of the map, and of the path between two of them
constexpr double kMaxTranslation = 0.04;              // m: a voxel, of poses and of the map
constexpr double kMaxRotation = 0.02;                 // rad
constexpr std::uint64_t kMapSeed = 1, kViewSeed = 9;  // of the noise

const Scene& room() {
  static const Scene scene = synthetic_scene("room");
  return scene;
}

Frame view(const Scene& scene, const Camera& camera, double frame, int index, std::uint64_t seed, bool color = true) {
  const Eigen::Isometry3d pose = scene.world_from_camera(frame / 30.0);
  SceneRenderer renderer(test_device(), scene, camera);
  auto images = renderer.render(pose);
  add_noise(images, camera, "kinect", seed, index);
  if (!color) images.color.clear();
  return {.index = index,
          .timestamp = index / 30.0,
          .depth = std::move(images.depth),
          .color = std::move(images.color),
          .world_from_camera = pose};
}

/// Session of the room in a folder.
void write_map(const fs::path& folder, bool color) {
  Options options;
  options.fuse = {.voxel_size = 0.03f, .truncation = 0.12f, .device_memory = std::uint64_t{96} << 20};
  options.map.submap_keyframes = 8;
  Session session = Session::create(folder / "session");
  Mapper mapper = session.mapper(small_camera(), options);
  for (int i = 0; i < kMapped; ++i) {
    Frame frame = view(room(), small_camera(), kStep * i, i, kMapSeed, color);
    frame.timestamp = kStep * i / 30.0;
    EXPECT_EQ(mapper.add(frame).state, FrameState::fused) << i;
  }
  (void)mapper.finish();
  session.checkpoint(mapper);
  EXPECT_EQ(session.problem(), std::nullopt);
}

/// Map of the room, made once.
class Localizing : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder = new TemporaryFolder;
    write_map(folder->path(), true);
  }
  static void TearDownTestSuite() {
    delete folder;
    folder = nullptr;
  }
  /// True if the pose is the view's; the map's first camera is the origin before its gravity alignment.
  static bool is_right(const Localizer& localizer, const LocalizedFrame& found, const Frame& frame) {
    const Eigen::Isometry3d tracked =
        Eigen::Isometry3d(localizer.upright().world_from_tracked).inverse() * *found.world_from_camera;
    const Eigen::Isometry3d truth = room().world_from_camera(0).inverse() * *frame.world_from_camera,
                            error = truth.inverse() * tracked;
    return error.translation().norm() < kMaxTranslation && Eigen::AngleAxisd(error.linear()).angle() < kMaxRotation;
  }
  static inline TemporaryFolder* folder = nullptr;
};

TEST_F(Localizing, FindsSingleViewsAndLeavesTheMapUnchanged) {
  const auto before = bytes_below(folder->path());
  std::map<fs::path, fs::file_time_type> times;
  for (const auto& entry : fs::recursive_directory_iterator(folder->path()))
    times[entry.path()] = fs::last_write_time(entry.path());
  Localizer localizer(folder->path(), small_camera());
  int found = 0;
  constexpr int kViews = 12;
  for (int i = 0; i < kViews; ++i) {
    localizer.begin_recording();
    const Frame frame = view(room(), small_camera(), 2.5 + 11 * i, i, kViewSeed);
    const LocalizedFrame localized = localizer.add(frame);
    EXPECT_EQ(localized.index, i);
    if (!localized.world_from_camera) continue;
    ++found;
    EXPECT_TRUE(is_right(localizer, localized, frame)) << i;
    EXPECT_EQ(localized.guess, InitialGuess::relocalized);
    ASSERT_TRUE(localized.covariance.has_value());
    EXPECT_GT(localized.covariance->trace(), 0);
  }
  EXPECT_GE(found, kViews - 1);
  EXPECT_EQ(bytes_below(folder->path()), before);
  for (const auto& [file, time] : times) EXPECT_EQ(fs::last_write_time(file), time) << file;
}

TEST_F(Localizing, TracksAfterTheFirstPoseAndFindsALostCameraElsewhere) {
  Localizer localizer(folder->path(), small_camera());
  const Frame dark{.depth = std::vector<float>(320 * 240, 0.0f)};
  int index = 0;
  for (const double begin : {20.0, 90.0}) {
    for (int i = 0; i < 5; ++i) {
      const Frame frame = view(room(), small_camera(), begin + i, index, kViewSeed);
      const LocalizedFrame localized = localizer.add(frame);
      ASSERT_TRUE(localized.world_from_camera.has_value()) << index << ": " << localized.reason;
      EXPECT_TRUE(is_right(localizer, localized, frame)) << index;
      EXPECT_EQ(localized.guess == InitialGuess::relocalized, i == 0) << index;
      ++index;
    }
    Frame nothing = dark;
    nothing.index = index, nothing.timestamp = index / 30.0;
    const LocalizedFrame lost = localizer.add(nothing);
    EXPECT_FALSE(lost.world_from_camera.has_value());
    EXPECT_FALSE(lost.covariance.has_value());
    EXPECT_NE(lost.reason, "");
    ++index;
  }
}

TEST_F(Localizing, FindsNoViewOfAnotherPlace) {
  const Scene flat = synthetic_scene("flat");
  Localizer localizer(folder->path(), small_camera());
  for (int i = 0; i < 12; ++i) {
    const LocalizedFrame localized = localizer.add(view(flat, small_camera(), 40 * i, i, kViewSeed));
    EXPECT_FALSE(localized.world_from_camera.has_value()) << i;
    EXPECT_NE(localized.cause, FrameCause::none);
  }
}

TEST_F(Localizing, AcceptsAnotherCamera) {
  const Camera other{400, 300, 380, 380, 199.5, 149.5, {}};
  Localizer localizer(folder->path(), other);
  const Frame frame = view(room(), other, 33, 0, kViewSeed);
  const LocalizedFrame localized = localizer.add(frame);
  ASSERT_TRUE(localized.world_from_camera.has_value()) << localized.reason;
  EXPECT_TRUE(is_right(localizer, localized, frame));
}

TEST_F(Localizing, ReportsAnAddedBoxAsNew) {
  Scene changed = room();
  // In front of the camera, in free space of the map.
  const Eigen::Vector3d at = room().world_from_camera(1.0) * Eigen::Vector3d(0.0, 0.0, 1.2);
  changed.solids.push_back({.shape = Scene::Shape::box,
                            .center = at.cast<float>(),
                            .half_size = Eigen::Vector3f::Constant(0.15f),
                            .pattern = Scene::Pattern::checker});
  Localizer localizer(folder->path(), small_camera(), {.changes = true});
  const TemporaryFolder out;
  EXPECT_NE(error_of([&] { (void)localizer.export_changes(out / "none.glb"); }).find("no frame"), std::string::npos);
  int found = 0;
  for (int i = 0; i < 12; ++i)
    found += localizer.add(view(changed, small_camera(), 25 + i, i, kViewSeed)).world_from_camera.has_value();
  EXPECT_GE(found, 10);
  const ExportedChange changes = localizer.export_changes(out / "change.glb");
  ASSERT_GE(changes.regions.size(), 1u) << found << " " << changes.new_area << " " << changes.common_area;
  EXPECT_TRUE(changes.regions[0].is_new);
  const Eigen::Vector3d expected =
      localizer.upright().world_from_tracked * (room().world_from_camera(0).inverse() * at);
  EXPECT_LT((changes.regions[0].middle - expected).norm(), 0.25);
  EXPECT_TRUE(fs::exists(out / "change.glb"));
}

TEST_F(Localizing, NamesTheRemedyForAFolderWithoutSession) {
  const auto message = [&](const fs::path& map) { return error_of([&] { (void)Localizer(map, small_camera()); }); };
  const TemporaryFolder empty;
  EXPECT_NE(message(empty.path()).find("is an empty folder, not a map with a session"), std::string::npos);
  EXPECT_NE(message(empty / "missing").find("does not exist"), std::string::npos);
  write_text(empty / "map.vdb", "");
  EXPECT_NE(message(empty.path()).find("has no session"), std::string::npos);
  EXPECT_NE(error_of([&] {
              (void)Localizer(folder->path(), small_camera()).export_changes(empty / "x.glb");
            }).find("LocalizerOptions::changes"),
            std::string::npos);
}

TEST(LocalizingByDepth, FindsViewsWithoutColor) {
  const TemporaryFolder folder;
  write_map(folder.path(), false);
  Localizer localizer(folder.path(), small_camera());
  int found = 0;
  for (int i = 0; i < 8; ++i) {
    localizer.begin_recording();
    found +=
        localizer.add(view(room(), small_camera(), 2.5 + 16 * i, i, kViewSeed, false)).world_from_camera.has_value();
  }
  EXPECT_GE(found, 4);
}

}  // namespace
}  // namespace cairn
