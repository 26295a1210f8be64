// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Round trip of a recording through each layout: the same frames and the same map.
#include "cairn/io/layouts.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "cairn/io/source.hpp"
#include "cairn/mapping/mapper.hpp"
#include "support/files.hpp"
#include "support/ros_files.hpp"
#include "support/scenes.hpp"
#ifdef CAIRN_VIDEO
#include "support/videos.hpp"
#endif

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr int kFrames = 12;

struct Layout {
  std::string name;
  std::string told;     // by Source::layout()
  double units = 1000;  // of depth, per meter
  bool png = false;     // lossless color
  [[nodiscard]] bool is_video() const { return name == "stray-scanner"; }
  [[nodiscard]] bool has_poses() const { return name != "bag" && name != "mcap" && name != "db3" && name != "mkv"; }
  [[nodiscard]] Camera camera() const {
    // Camera of Azure Kinect's smallest mode.
    if (name == "mkv") return {320, 288, 256, 256, 159.5, 143.5, {}};
    return camera_of_layout(name).value_or(small_camera());
  }
  [[nodiscard]] bool holds_millimeters() const { return units == 1000 || units == 5000; }
};
void PrintTo(const Layout& layout, std::ostream* out) { *out << layout.name; }

/// Room with depth in integer millimeters, which most layouts represent exactly.
std::vector<Frame> room(const Layout& layout) {
  std::vector<Frame> frames;
  for (int i = 0; i < kFrames; ++i) {
    frames.push_back(scene_frame(synthetic_scene("room"), layout.camera(), i));
    if (layout.name == "mkv") frames.back().timestamp = 0.033 * i;  // its times are integer milliseconds
    for (float& z : frames.back().depth) z = 0.001f * std::round(1000 * z);
  }
  return frames;
}

template <class T>
std::string raw(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}
std::vector<std::uint16_t> millimeters(const Frame& frame) {
  std::vector<std::uint16_t> units;
  for (const float z : frame.depth) units.push_back(static_cast<std::uint16_t>(std::lround(1000 * z)));
  return units;
}

/// ROS messages of a camera with registered color.
ros::Messages messages(ros::Wire wire, const Camera& camera, const std::vector<Frame>& frames) {
  ros::Messages all;
  for (const Frame& frame : frames) {
    const auto time = static_cast<std::int64_t>(std::llround(1e9 * frame.timestamp));
    for (const char* topic : {"/depth", "/color"})
      all.push_back({topic + std::string("/camera_info"), "sensor_msgs/CameraInfo", time,
                     camera_info(wire, "optical", camera, "plumb_bob", {0, 0, 0, 0, 0})});
    all.push_back({"/depth/image", "sensor_msgs/Image", time,
                   image(wire, {time, "optical", camera.width, camera.height, "16UC1", raw(millimeters(frame)), 2})});
    all.push_back({"/color/image", "sensor_msgs/Image", time,
                   image(wire, {time, "optical", camera.width, camera.height, "rgba8", raw(frame.color), 4})});
  }
  return all;
}

#ifdef CAIRN_VIDEO
/// Recording of an Azure Kinect with the color camera at the depth camera's pose.
MatroskaFile matroska(const std::vector<Frame>& frames) {
  constexpr const char* kCalibration =
      R"({{"CalibrationInformation": {{"Cameras": [{}, {}], "InertialSensors": []}}}})";
  constexpr const char* kCamera = R"({{"Intrinsics": {{"ModelParameters": [{}, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0],
      "ModelType": "CALIBRATION_LensDistortionModelBrownConrady"}}, "Location": "CALIBRATION_CameraLocation{}",
      "Rt": {{"Rotation": [1, 0, 0, 0, 1, 0, 0, 0, 1], "Translation": [0, 0, 0]}}, "SensorWidth": {},
      "SensorHeight": {}}})";
  MatroskaFile file;
  for (const char* name : {"COLOR", "DEPTH"})
    file.tracks.push_back({.tags = {{"title", name}},
                           .fourcc = file.tracks.empty() ? "BGRA" : "b16g",
                           .width = 320,
                           .height = 288,
                           .rate = 30});
  file.attachment_name = "calibration.json";
  // Fractions of the sensor's image, of which the mode crops 96 and 90 pixels of 512, and of the entire image.
  file.attachment = fmt::format(kCalibration, fmt::format(kCamera, "0.5, 0.45703125, 0.5, 0.5", "D0", 1024, 1024),
                                fmt::format(kCamera, "0.5, 0.5, 0.8, 0.88888888888888888", "PV0", 320, 288));
  for (const Frame& frame : frames) {
    std::string depth, color = raw(frame.color);
    for (const std::uint16_t z : millimeters(frame)) {
      depth += static_cast<char>(z >> 8);
      depth += static_cast<char>(z & 255);
    }
    for (std::size_t i = 0; i < color.size(); i += 4) std::swap(color[i], color[i + 2]);
    file.packets.push_back({0, frame.timestamp, color});
    file.packets.push_back({1, frame.timestamp, depth});
  }
  return file;
}
#endif

/// Writes a recording in a layout without a writer in the library.
void write_others(const std::string& layout, const fs::path& file, const Camera& camera,
                  const std::vector<Frame>& frames) {
  if (layout == "bag") write_text(file, bag(messages(ros::Wire::ros1, camera, frames)));
  if (layout == "mcap") write_text(file, mcap(messages(ros::Wire::little, camera, frames), "cdr"));
#ifdef CAIRN_VIDEO
  if (layout == "mkv") matroska(frames).write(file);
#endif
  if (layout == "db3") write_db3(file, messages(ros::Wire::little, camera, frames));
}

/// Writes a recording, and returns the name for open_source.
std::string write(const std::string& layout, const fs::path& folder, const Rig& rig, const std::vector<Frame>& frames) {
  fs::create_directories(folder);
  if (std::find(std::begin(kLayouts), std::end(kLayouts), layout) == std::end(kLayouts)) {
    const fs::path file = folder / ("recording." + layout);
    write_others(layout, file, rig.depth, frames);
    return file;
  }
  const auto writer = write_layout(layout, folder, rig);
  for (const Frame& frame : frames) writer->add(frame);
  writer->finish();
  return layout == "scannet" ? folder / "recording.sens" : folder;
}

std::vector<Frame> read(const std::string& name) {
  std::vector<Frame> frames;
  const auto source = open_source(name);
  while (auto frame = source->next()) frames.push_back(*std::move(frame));
  return frames;
}

std::vector<Eigen::Isometry3d> tracked(const std::string& name) {
  const auto source = open_source(name, {.sensor = SensorModel{}});
  Options options;
  options.fuse.voxel_size = 0.02f, options.fuse.truncation = 0.08f;
  options.track.device_poses = DevicePoses::off;  // some layouts have none
  Mapper mapper(source->rig(), options);
  while (const auto frame = source->next()) EXPECT_EQ(mapper.add(*frame).state, FrameState::fused);
  std::vector<Eigen::Isometry3d> poses;
  for (const auto& pose : mapper.trajectory()) poses.push_back(pose.world_from_camera);
  return poses;
}

void expect_camera(const Camera& read, const Camera& written) {
  constexpr double kSingle = 1e-4;  // .sens files have floats
  EXPECT_EQ(read.width, written.width);
  EXPECT_EQ(read.height, written.height);
  EXPECT_NEAR(read.fx, written.fx, kSingle);
  EXPECT_NEAR(read.fy, written.fy, kSingle);
  EXPECT_NEAR(read.cx, written.cx, kSingle);
  EXPECT_NEAR(read.cy, written.cy, kSingle);
  EXPECT_EQ(read.distortion, written.distortion);
  EXPECT_EQ(read.readout, written.readout);
}

/// Equal up to the loss of a video codec.
void expect_near(const std::vector<std::uint32_t>& read, const std::vector<std::uint32_t>& written) {
  ASSERT_EQ(read.size(), written.size());
  double difference = 0;
  for (std::size_t p = 0; p < read.size(); ++p)
    difference += std::abs(static_cast<int>(read[p] >> 8 & 255u) - static_cast<int>(written[p] >> 8 & 255u));
  EXPECT_LT(difference / static_cast<double>(read.size()), 4);  // of 255
}

class WrittenLayout : public testing::TestWithParam<Layout> {};

TEST_P(WrittenLayout, IsReadBackAsItWas) {
  const Layout& layout = GetParam();
  const TemporaryFolder folder;
  const auto frames = room(layout);
  const std::string name = write(layout.name, folder / "rgbd_bonn_room", layout.camera(), frames);
  expect_camera(open_source(name)->rig().depth, layout.camera());
  EXPECT_EQ(open_source(name)->layout(), layout.told);
  EXPECT_EQ(open_source(name)->rig().color_view(), open_source(name)->rig().depth);
  const auto back = read(name), tum = read(write("tum", folder / "tum", layout.camera(), frames));
  ASSERT_EQ(back.size(), frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    ASSERT_FALSE(back[i].problem) << *back[i].problem;
    ASSERT_EQ(back[i].depth.size(), frames[i].depth.size());
    for (std::size_t p = 0; p < frames[i].depth.size(); ++p)
      ASSERT_NEAR(back[i].depth[p], frames[i].depth[p], layout.holds_millimeters() ? 1e-6 : 0.5 / layout.units + 1e-6);
    if (layout.is_video())
      expect_near(back[i].color, frames[i].color);
    else
      EXPECT_TRUE(back[i].color == (layout.png ? frames[i].color : tum[i].color)) << i;
  }
  if (!layout.has_poses()) return;
  // Open3D's recorders store no poses.
  const auto truth = recorded_truth(layout.name == "open3d" ? fs::path(name) / "groundtruth.txt" : fs::path(name));
  ASSERT_EQ(truth.size(), frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i)
    EXPECT_TRUE(truth[i].world_from_camera.isApprox(*frames[i].world_from_camera, 1e-5)) << i;
}

TEST_P(WrittenLayout, GivesTheMapThatItGivesInTumsLayout) {
  const Layout& layout = GetParam();
  const TemporaryFolder folder;
  const auto frames = room(layout);
  const auto here = tracked(write(layout.name, folder / "rgbd_bonn_room", layout.camera(), frames));
  // ETH3D has the same files with color as PNG.
  const bool as_png = layout.png && !layout.camera().distorted();
  const auto there = tracked(write(as_png ? "eth3d" : "tum", folder / "tum", layout.camera(), frames));
  ASSERT_EQ(here.size(), there.size());
  // With identical pixels, and with changes by JPEG or another unit.
  const bool same = layout.holds_millimeters() && as_png == layout.png && !layout.is_video();
  const double most = same ? 1e-4 : 3e-3;
  for (std::size_t i = 0; i < here.size(); ++i)
    EXPECT_LT((here[i].translation() - there[i].translation()).norm(), most) << i;
}

INSTANTIATE_TEST_SUITE_P(
    Each, WrittenLayout,
    testing::Values(Layout{"bonn", "TUM RGB-D folder", 5000, true}, Layout{"eth3d", "ETH3D folder", 5000, true},
                    Layout{"seven-scenes", "7-Scenes folder", 1000, true},
                    Layout{"icl-nuim", "ICL-NUIM folder", 5000, true}, Layout{"replica", "Replica folder", 6553.5},
                    Layout{"open3d", "Open3D folder"}, Layout{"rtabmap", "RTAB-Map folder"},
                    Layout{"nerfstudio", "nerfstudio folder"}, Layout{"scannet", "ScanNet .sens file"},
                    Layout{"stray-scanner", "Stray Scanner folder"}, Layout{"bag", "ROS 1 bag", 1000, true},
                    Layout{"mcap", "MCAP file of ROS", 1000, true}, Layout{"db3", "rosbag2 .db3 file", 1000, true},
                    Layout{"mkv", "Azure Kinect .mkv file", 1000, true}),
    [](const auto& each) {
      std::string name = each.param.name;
      std::erase(name, '-');
      return name;
    });

TEST(Layouts, AreWrittenByTheProgram) {
  for (const auto layout : kLayouts) {
    SCOPED_TRACE(layout);
    const TemporaryFolder folder;
    const fs::path out = folder / "rgbd_bonn_room";
    const Ran ran = run_cairn({"synth", "room", "-o", out.string(), "--layout", std::string(layout), "--frames", "2",
                               "--width", "160", "--noise", "none"});
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_TRUE(fs::exists(out / "groundtruth_mesh.ply"));
    EXPECT_EQ(read(layout == "scannet" ? out / "recording.sens" : out).size(), 2u);
  }
}

TEST(Layouts, KeepTheColorCameraAndTheLensWhereTheyCan) {
  const TemporaryFolder folder;
  Rig rig(small_camera(),
          ColorCamera{.camera = {.width = 64, .height = 48, .fx = 52, .fy = 52, .cx = 31.5, .cy = 23.5}});
  rig.color->color_from_depth =
      Eigen::Translation3d(-0.05, 0.01, 0) * Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitY());
  Frame frame = scene_frame(synthetic_scene("room"), small_camera(), 0);
  frame.color.assign(64 * 48, 0xff806040u);
  const auto read_rig = open_source(write("scannet", folder / "sens", rig, {frame}))->rig();
  ASSERT_TRUE(read_rig.color);
  EXPECT_TRUE(read_rig.color->color_from_depth.isApprox(rig.color->color_from_depth, 1e-6));
  expect_camera(read_rig.color->camera, rig.color->camera);
  Camera bent = small_camera();
  bent.distortion = {0.1, -0.05, 0.001, -0.001, 0.02};
  frame = scene_frame(synthetic_scene("room"), bent, 0);
  for (const char* layout : {"rtabmap", "nerfstudio"})
    expect_camera(open_source(write(layout, folder / layout, bent, {frame}))->rig().depth, bent);
  const auto refused = [&](const char* layout, const Rig& cameras, const char* told) {
    const auto error = error_of([&] { (void)write_layout(layout, folder.path(), cameras); });
    EXPECT_NE(error.find(told), std::string::npos) << error;
  };
  refused("open3d", bent, "open3d cannot store lens distortion");
  refused("open3d", rig, "open3d cannot store a separate color camera");
  refused("seven-scenes", small_camera(), "its programs assume a fixed camera");
  refused("bonn", *camera_of_layout("bonn"), "which must contain `rgbd_bonn`");
  refused("nothing", rig, "unknown layout 'nothing'; known layouts: tum, bonn");
}

}  // namespace
}  // namespace cairn
