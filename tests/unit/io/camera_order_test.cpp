// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Order of camera sources for all layouts: option, file next to the images, recording, layout.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "cairn/io/inspect.hpp"
#include "cairn/io/known_cameras.hpp"
#include "io/recording.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
const Camera kMine{64, 48, 50, 51, 30, 24, {}};
constexpr const char* kMineText = "{width: 64, height: 48, fx: 50, fy: 51, cx: 30, cy: 24}";
constexpr int kFrames = 3;

void write_depth(const fs::path& file, int i, int width = 64, int height = 48) {
  fs::create_directories(file.parent_path());
  cv::imwrite(file.string(), cv::Mat(height, width, CV_16U, cv::Scalar(1000 + 10 * i)));
}
void write_color(const fs::path& file, int width = 64, int height = 48) {
  fs::create_directories(file.parent_path());
  cv::imwrite(file.string(), cv::Mat(height, width, CV_8UC3, cv::Scalar(10, 20, 30)));
}

std::unique_ptr<Source> open(const fs::path& folder, const fs::path& camera = {}) {
  return open_source(folder.string(), {.camera = camera, .find_color_camera = false});
}
std::string refusal(const fs::path& folder, const fs::path& camera = {}) {
  const std::string error = error_of([&] { (void)open(folder, camera); });
  EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  return error;
}
bool has(const std::string& text, const std::string& part) { return text.find(part) != text.npos; }

/// Writes associations.txt and images; `name` maps an index to a file stem.
template <class Name>
void write_associations(const fs::path& folder, Name&& name, int width = 64, int height = 48,
                        const char* line = "{0} rgb/{1}.png {0} depth/{1}.png\n") {
  std::string list;
  for (int i = 0; i < kFrames; ++i) {
    const std::string stem = name(i);
    write_depth(folder / ("depth/" + stem + ".png"), i, width, height);
    write_color(folder / ("rgb/" + stem + ".png"), width, height);
    list += fmt::format(fmt::runtime(line), stem, stem);
  }
  write_text(folder / "associations.txt", list);
}
std::string in_seconds(int i) { return fmt::format("{:.6f}", i / 30.0); }

TEST(CameraOrder, ReadsCameraFileOfAssociations) {
  const TemporaryFolder folder;
  write_associations(folder.path(), in_seconds);
  write_text(folder / "camera.yaml", "{width: 64, height: 48, fx: 50, fy: 51, cx: 30, cy: 24, depth_scale: 500}");
  const auto source = open(folder.path());
  EXPECT_EQ(source->rig(), Rig(kMine));
  EXPECT_EQ(source->layout(), "folder with associations.txt");
  const auto frame = source->next();
  EXPECT_FLOAT_EQ(frame->depth[0], 2.0f);
  EXPECT_EQ(frame->color.size(), 64u * 48);
  EXPECT_NEAR(source->next()->timestamp, 1 / 30.0, 1e-6);
}

TEST(CameraOrder, KeepsTheCalibrationOfAFileWithTheSameCamera) {
  const TemporaryFolder folder;
  write_associations(folder / "recording", in_seconds);
  write_text(folder / "recording" / "camera.yaml", kMineText);
  Rig found = kMine;
  found.depth.readout = 0.028;
  write_rig(folder / "map_camera.yaml", found);
  EXPECT_EQ(open(folder / "recording", folder / "map_camera.yaml")->rig(), found);
}

TEST(CameraOrder, AsksForTheCameraOfAnAssociationsList) {
  const TemporaryFolder folder;
  write_associations(folder.path(), in_seconds, 640, 480);
  EXPECT_TRUE(has(refusal(folder.path()), "the camera is unknown: write its intrinsics into"));
  EXPECT_EQ(open(folder.path(), "icl-nuim")->rig(), Rig(known_camera("icl-nuim")->camera));
}

TEST(CameraOrder, RecognizesIclNuimByNumbersAndSize) {
  const auto number = [](int i) { return std::to_string(i); };
  {
    const TemporaryFolder folder;
    write_associations(folder.path(), number, 640, 480);
    const auto source = open(folder.path());
    EXPECT_EQ(source->layout(), "ICL-NUIM folder");
    EXPECT_EQ(source->rig(), Rig(known_camera("icl-nuim")->camera));
    EXPECT_FLOAT_EQ(source->next()->depth[0], 0.2f);
    write_text(folder / "camera.yaml", "{width: 640, height: 480, fx: 525, fy: 525, cx: 319.5, cy: 239.5}");
    EXPECT_EQ(open(folder.path())->rig().depth.fx, 525);
  }
  {
    const TemporaryFolder folder;
    write_associations(folder.path(), number, 320, 240);
    EXPECT_TRUE(has(refusal(folder.path()), "the camera is unknown"));
  }
}

TEST(CameraOrder, RecognizesTumByMoreThanFolderName) {
  const auto write = [](const fs::path& folder, double begin, int width, const std::string& heading) {
    std::string depth = heading;
    for (int i = 0; i < kFrames; ++i) {
      write_depth(folder / fmt::format("depth/{}.png", i), i, width, width * 3 / 4);
      depth += fmt::format("{:.3f} depth/{}.png\n", begin + 0.1 * i, i);
    }
    write_text(folder / "depth.txt", depth);
  };
  struct Case {
    const char* folder;
    double begin;
    int width;
    const char* heading;
    bool is_known;
  };
  for (const Case& c : {Case{"rgbd_dataset_freiburg1_desk", 0, 640, "", true},
                        {"rgbd_dataset_freiburg1_desk", 0, 320, "", false},
                        {"my_fr1_scan", 0, 640, "", false},
                        {"my_fr10_scan", 1305031102, 640, "", false},
                        {"tum_fr1_desk", 1305031102, 640, "", true},
                        {"desk", 0, 640, "# depth maps\n# file: 'rgbd_dataset_freiburg1_desk.bag'\n", true}}) {
    SCOPED_TRACE(c.folder);
    const TemporaryFolder above;
    write(above / c.folder, c.begin, c.width, c.heading);
    if (c.is_known)
      EXPECT_EQ(open(above / c.folder)->rig(), Rig(known_camera("freiburg1")->camera));
    else
      EXPECT_TRUE(has(refusal(above / c.folder), "the camera is unknown"));
    write_text(above / c.folder / "camera.yaml",
               fmt::format("{{fx: {}, fy: {}, cx: {}, cy: {}}}", c.width, c.width, c.width / 2, c.width * 3 / 8));
    EXPECT_EQ(open(above / c.folder)->rig().depth.fx, c.width);
  }
}

TEST(CameraOrder, Recognizes7ScenesByMoreThanNames) {
  const TemporaryFolder folder;
  for (int i = 0; i < kFrames; ++i) write_depth(folder / fmt::format("frame-{:06}.depth.png", i), i, 320, 240);
  EXPECT_TRUE(has(refusal(folder.path()), "the camera is unknown"));
  for (int i = 0; i < kFrames; ++i) write_depth(folder / fmt::format("frame-{:06}.depth.png", i), i, 640, 480);
  EXPECT_EQ(open(folder.path())->rig(), Rig(known_camera("seven-scenes")->camera));
}

/// Writes a folder of a layout with its own camera or a known camera.
void write_layout_of(const std::string& name, const fs::path& folder) {
  for (int i = 0; i < kFrames; ++i) {
    const std::string depth = name == "replica"   ? fmt::format("results/depth{:06}.png", i)
                              : name == "rtabmap" ? fmt::format("depth/{}.5.png", i)
                              : name == "stray"   ? fmt::format("depth/{:06}.png", i)
                                                  : fmt::format("depth/{}.png", i);
    write_depth(folder / depth, i);
    if (name == "rtabmap") write_color(folder / fmt::format("rgb/{}.5.png", i));
    if (name == "nerfstudio") write_color(folder / fmt::format("images/{}.png", i));
  }
  const std::string pose = "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]";
  if (name == "replica")
    write_text(folder / "cam_params.json",
               R"({"camera": {"w": 64, "h": 48, "fx": 60, "fy": 60, "cx": 31.5, "cy": 23.5, "scale": 1000}})");
  if (name == "rtabmap")
    write_text(folder / "calibration.yaml",
               "image_width: 64\nimage_height: 48\ncamera_matrix: {rows: 3, cols: 3, data: "
               "[60, 0, 31.5, 0, 60, 23.5, 0, 0, 1]}\n");
  if (name == "eth3d" || name == "tum") {
    std::string list;
    for (int i = 0; i < kFrames; ++i) list += fmt::format("0.{0} depth/{0}.png\n", i);
    write_text(folder / "depth.txt", list);
  }
  if (name == "eth3d") write_text(folder / "calibration.txt", "60 60 31.5 23.5\n");
  if (name == "tum") write_text(folder / "intrinsics.txt", "60 60 31.5 23.5\n");
  if (name == "stray") {
    write_text(folder / "camera_matrix.csv", "60, 0, 31.5\n0, 60, 23.5\n0, 0, 1\n");
    std::string odometry = "timestamp, frame, x, y, z, qx, qy, qz, qw\n";
    for (int i = 0; i < kFrames; ++i) odometry += fmt::format("0.{0}, {0}, 0, 0, 0, 0, 0, 0, 1\n", i);
    write_text(folder / "odometry.csv", odometry);
  }
  if (name == "nerfstudio") {
    std::string frames;
    for (int i = 0; i < kFrames; ++i)
      frames += fmt::format(R"({}{{"file_path": "images/{}.png", "depth_file_path": "depth/{}.png", )"
                            R"("transform_matrix": {}}})",
                            i > 0 ? ", " : "", i, i, pose);
    write_text(folder / "transforms.json",
               R"({"w": 64, "h": 48, "fl_x": 60, "fl_y": 60, "cx": 32, "cy": 24, "frames": [)" + frames + "]}");
  }
}

TEST(CameraOrder, IsTheSameForEveryLayout) {
  for (const char* name : {"replica", "rtabmap", "eth3d", "tum", "stray", "nerfstudio"}) {
    SCOPED_TRACE(name);
    const TemporaryFolder folder, elsewhere;
    write_layout_of(name, folder.path());
    EXPECT_EQ(open(folder.path())->rig().depth.fx, 60);
    const float meters = open(folder.path())->next()->depth[0];
    // A file in the folder overrides the recording, including its unit,
    write_text(folder / "camera.yaml", kMineText);
    const auto beside = open(folder.path());
    EXPECT_EQ(beside->rig().depth, kMine);
    EXPECT_FLOAT_EQ(beside->next()->depth[0], meters);
    write_text(folder / "camera.yaml", "{fx: 50, fy: 51, cx: 30, cy: 24, depth_scale: 250}");
    EXPECT_EQ(open(folder.path())->rig().depth, kMine);
    EXPECT_FLOAT_EQ(open(folder.path())->next()->depth[0], 4.0f);
    // and an option overrides both.
    write_text(elsewhere / "my.yaml", "{fx: 40, fy: 41, cx: 30, cy: 24, depth_scale: 125}");
    const auto option = open(folder.path(), elsewhere / "my.yaml");
    EXPECT_EQ(option->rig().depth, (Camera{64, 48, 40, 41, 30, 24, {}}));
    EXPECT_FLOAT_EQ(option->next()->depth[0], 8.0f);
    // Values missing from the option come from the file; an unreadable file does not invalidate the option.
    write_text(elsewhere / "my.yaml", "{fx: 40, fy: 41, cx: 30, cy: 24}");
    EXPECT_FLOAT_EQ(open(folder.path(), elsewhere / "my.yaml")->next()->depth[0], 4.0f);
    write_text(folder / "camera.yaml", "fx: 40\n");
    EXPECT_TRUE(has(refusal(folder.path()), "camera.yaml: `fy` is missing"));
    EXPECT_EQ(open(folder.path(), elsewhere / "my.yaml")->rig().depth.fx, 40);
  }
}

TEST(CameraOrder, KeepsValuesMissingInFile) {
  const TemporaryFolder folder;
  write_layout_of("stray", folder.path());
  write_text(folder / "camera.yaml", kMineText);
  EXPECT_EQ(open(folder.path())->rig().sensor, sensor_model("phone_lidar"));
}

TEST(CameraOrder, AppliesToFrameRate) {
  const TemporaryFolder folder;
  write_layout_of("replica", folder.path());
  write_text(folder / "traj.txt", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1\n");
  write_text(folder / "camera.yaml", "{fx: 50, fy: 51, cx: 30, cy: 24, frame_rate: 10}");
  const auto source = open(folder.path());
  (void)source->next();
  EXPECT_DOUBLE_EQ(source->next()->timestamp, 0.1);
  EXPECT_DOUBLE_EQ(recorded_truth(folder.path())[1].timestamp, 0.1);
  write_text(folder / "my.yaml", "{fx: 50, fy: 51, cx: 30, cy: 24, frame_rate: 5}");
  const auto option = open(folder.path(), folder / "my.yaml");
  (void)option->next();
  EXPECT_DOUBLE_EQ(option->next()->timestamp, 0.2);
}

TEST(CameraOrder, ReplacesMissingLayoutFile) {
  for (const auto& [name, file] : {std::pair{"replica", "cam_params.json"}, {"stray", "camera_matrix.csv"}}) {
    const TemporaryFolder folder;
    write_layout_of(name, folder.path());
    fs::remove(folder / file);
    fs::create_directories(folder / "confidence");
    EXPECT_TRUE(has(refusal(folder.path()), std::string(file) + " is missing"));
    write_text(folder / "camera.yaml", kMineText);
    EXPECT_EQ(open(folder.path())->rig().depth, kMine);
  }
}

TEST(CameraOrder, AssignsMatrixByPrincipalPoint) {
  const TemporaryFolder folder;
  write_depth(folder / "depth/0.png", 0);
  write_color(folder / "rgb/0.png", 640, 480);
  write_text(folder / "K.txt", "500 0 321\n0 510 238\n0 0 1\n");
  const Rig rig = open(folder.path())->rig();
  EXPECT_NEAR(rig.depth.fx, 50, 1e-9);
  ASSERT_TRUE(rig.color);
  EXPECT_NEAR(rig.color->camera.fx, 500, 1e-9);
}

TEST(Associations, AreReadInAllFormats) {
  for (const char* line : {"{0} rgb/{1}.png {0} depth/{1}.png\n", "{0} depth/{1}.png {0} rgb/{1}.png\n",
                           "{0}\trgb/{1}.png\t{0}\tdepth/{1}.png\r\n", "{0},rgb/{1}.png,{0},depth/{1}.png\n",
                           "{0}, rgb/{1}.png, {0}, depth/{1}.png\r\n", "{0} rgb\\{1}.png {0} depth\\{1}.png\r\n"}) {
    SCOPED_TRACE(line);
    const TemporaryFolder folder;
    write_associations(folder.path(), in_seconds, 64, 48, line);
    write_text(folder / "associations.txt", "\xef\xbb\xbf# time\n" + read_bytes(folder / "associations.txt"));
    write_text(folder / "camera.yaml", kMineText);
    const auto source = open(folder.path());
    EXPECT_EQ(source->size(), kFrames);
    const auto frame = source->next();
    ASSERT_FALSE(frame->problem) << *frame->problem;
    EXPECT_FALSE(frame->color.empty());
  }
}

TEST(Associations, KeepTheDelayOfColor) {
  const TemporaryFolder folder;
  write_depth(folder / "depth/a b.png", 0);
  write_color(folder / "rgb/a b.png");
  write_text(folder / "associations.txt", "1.5 rgb/a b.png 1.25 depth/a b.png\n");
  write_text(folder / "camera.yaml", kMineText);
  const auto frame = open(folder.path())->next();
  EXPECT_DOUBLE_EQ(frame->timestamp, 1.25);
  EXPECT_DOUBLE_EQ(frame->color_delay, 0.25);
  EXPECT_FALSE(frame->color.empty());
  write_text(folder / "associations.txt", "1.5 rgb/a.png depth/b.png\n");
  EXPECT_TRUE(has(refusal(folder.path()), "associations.txt:1: expected `timestamp path timestamp path`"));
}

TEST(TumRecording, ReadsTimesOfEachUnit) {
  for (const double units : {1.0, 1e3, 1e6, 1e9}) {
    SCOPED_TRACE(units);
    const TemporaryFolder folder;
    std::string depth, rgb, gyro;
    for (int i = 0; i < kFrames; ++i) {
      write_depth(folder / fmt::format("depth/{}.png", i), i);
      write_color(folder / fmt::format("rgb/{}.png", i));
      const double time = (100 + 0.25 * i) * units;
      const int decimals = units == 1 ? 6 : 0;
      depth += fmt::format("{:.{}f} depth/{}.png\n", time, decimals, i);
      rgb += fmt::format("{:.{}f} rgb/{}.png\n", time + 0.005 * units, decimals, i);
      gyro += fmt::format("{:.{}f} 0 0 1\n", time, decimals);
    }
    write_text(folder / "depth.txt", "timestamp,filename\n" + depth);
    write_text(folder / "rgb.txt", rgb);
    write_text(folder / "gyroscope.txt", gyro);
    write_text(folder / "camera.yaml", kMineText);
    const auto source = open(folder.path());
    for (int i = 0; i < kFrames; ++i) {
      const auto frame = source->next();
      EXPECT_NEAR(frame->timestamp, 100 + 0.25 * i, 1e-6);
      EXPECT_NEAR(frame->color_delay, 0.005, 1e-6);
      EXPECT_FALSE(frame->gyro.empty());
    }
  }
}

}  // namespace
}  // namespace cairn
