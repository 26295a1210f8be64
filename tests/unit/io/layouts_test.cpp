// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Folder layouts, each written here from the same four frames of a room.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "io/recording.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr int kFrames = 4;
const Camera kCamera{64, 48, 52.5, 52.25, 31.5, 23.75, {}};
const Camera kTwice{128, 96, 105, 104.5, 63.5, 48, {}};  // same view: (31.5 + 0.5) * 2 - 0.5

cv::Mat bgr_of(std::vector<std::uint32_t> color, const Camera& camera) {
  cv::Mat bgr;
  cv::cvtColor(cv::Mat(camera.height, camera.width, CV_8UC4, color.data()), bgr, cv::COLOR_RGBA2BGR);
  return bgr;
}

const std::vector<Frame>& room(const Camera& camera) {
  const auto render = [](const Camera& c) {
    std::vector<Frame> frames;
    for (int i = 0; i < kFrames; ++i) frames.push_back(scene_frame(synthetic_scene("room"), c, i));
    return frames;
  };
  static const auto small = render(kCamera), large = render(kTwice);
  return camera == kCamera ? small : large;
}

/// Writes depth of frame i, and its color from a camera of another size; an empty name skips the image.
void write_images(int i, const fs::path& depth, const fs::path& color, double scale,
                  const Camera& color_camera = kCamera) {
  const auto& frame = room(kCamera)[static_cast<std::size_t>(i)];
  cv::Mat units(kCamera.height, kCamera.width, CV_16U);
  for (std::size_t p = 0; p < frame.depth.size(); ++p)
    units.at<std::uint16_t>(static_cast<int>(p)) = static_cast<std::uint16_t>(std::lround(frame.depth[p] * scale));
  for (const auto& file : {depth, color}) fs::create_directories(file.parent_path());
  cv::imwrite(depth.string(), units);
  cv::imwrite(color.string(), bgr_of(room(color_camera)[static_cast<std::size_t>(i)].color, color_camera));
}

/// Expects these frames from the folder: depth within one unit, color exact unless JPEG.
void expect_room(const fs::path& folder, double scale, double rate, const Camera& color_camera = kCamera,
                 double begin = 0) {
  const auto source = open_source(folder.string());
  EXPECT_EQ(source->size(), kFrames);
  for (int i = 0; i < kFrames; ++i) {
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    ASSERT_FALSE(frame->problem) << *frame->problem;
    EXPECT_NEAR(frame->timestamp, begin + i / rate, 1e-9);
    const auto& truth = room(kCamera)[static_cast<std::size_t>(i)];
    ASSERT_EQ(frame->depth.size(), truth.depth.size());
    for (std::size_t p = 0; p < truth.depth.size(); ++p)
      ASSERT_NEAR(frame->depth[p], truth.depth[p], 0.5 / scale + 1e-6);
    const auto& color = room(color_camera)[static_cast<std::size_t>(i)].color;
    ASSERT_EQ(frame->color.size(), color.size());
    double difference = 0;
    for (std::size_t p = 0; p < color.size(); ++p)
      difference += std::abs(static_cast<int>(color[p] & 255u) - static_cast<int>(frame->color[p] & 255u));
    constexpr double kOfJpeg = 8;  // mean error out of 255; chroma has half the resolution, and the images are small
    EXPECT_LT(difference / static_cast<double>(color.size()), kOfJpeg);
  }
  EXPECT_FALSE(source->next());
}

void expect_truth(const fs::path& folder) {
  const auto truth = recorded_truth(folder);
  ASSERT_EQ(truth.size(), std::size_t{kFrames});
  for (std::size_t i = 0; i < kFrames; ++i)
    EXPECT_TRUE(truth[i].world_from_camera.isApprox(*room(kCamera)[i].world_from_camera, 1e-6)) << i;
}

std::string numbers(const Eigen::Matrix4d& m, const char* between) {
  std::string text;
  for (int r = 0; r < 4; ++r)
    for (int c = 0; c < 4; ++c) text += (text.empty() ? "" : between) + fmt::format("{:.12g}", m(r, c));
  return text;
}

void expect_error(const fs::path& folder, const std::string& expected) {
  const auto error = error_of([&] { (void)open_source(folder.string()); });
  EXPECT_NE(error.find(expected), std::string::npos) << error;
  EXPECT_EQ(error.find('\n'), std::string::npos) << error;
}

struct Replica {
  TemporaryFolder above;
  fs::path folder = above / "room0";
  Replica() {
    std::string poses;
    for (int i = 0; i < kFrames; ++i) {
      write_images(i, folder / fmt::format("results/depth{:06}.png", i),
                   folder / fmt::format("results/frame{:06}.jpg", i), 6553.5);
      poses += numbers(room(kCamera)[static_cast<std::size_t>(i)].world_from_camera->matrix(), " ") + "\n";
    }
    write_text(folder / "traj.txt", poses);
    write_text(above / "cam_params.json",
               R"({"camera": {"w": 64, "h": 48, "fx": 52.5, "fy": 52.25, "cx": 31.5, "cy": 23.75, "scale": 6553.5}})");
  }
};

TEST(Replica, ReadsFramesPosesAndCamera) {
  const Replica replica;
  expect_room(replica.folder, 6553.5, 30);
  expect_truth(replica.folder);
  EXPECT_EQ(open_source(replica.folder.string())->rig(), Rig(kCamera));
}

TEST(Replica, ReportsMissingAndInvalidFiles) {
  const Replica replica;
  write_text(replica.folder / "traj.txt", "1 0 0\n");
  expect_error(replica.folder, "traj.txt:1: expected the 16 numbers");
  write_text(replica.folder / "cam_params.json", "");
  expect_error(replica.folder, "cam_params.json: is not JSON");
  write_text(replica.folder / "cam_params.json", R"({"camera": {"w": 64}})");
  expect_error(replica.folder, "`h` is missing");
  fs::remove(replica.folder / "cam_params.json");
  fs::remove(replica.above / "cam_params.json");
  fs::remove(replica.folder / "traj.txt");
  expect_error(replica.folder, "cam_params.json is missing");
}

TEST(Open3d, ReadsBothRecorders) {
  for (const char* name : {"intrinsic.json", "camera_intrinsic.json"}) {
    const TemporaryFolder folder;
    for (int i = 0; i < kFrames; ++i)
      write_images(i, folder / fmt::format("depth/{:05}.png", i), folder / fmt::format("color/{:05}.jpg", i), 1000);
    write_text(folder / name,
               R"({"width": 64, "height": 48, "intrinsic_matrix": [52.5, 0, 0, 0, 52.25, 0, 31.5, 23.75, 1]})");
    expect_room(folder.path(), 1000, 30);
    EXPECT_EQ(open_source(folder.path().string())->rig(), Rig(kCamera));
    write_text(folder / name, R"({"width": 64, "height": 48, "intrinsic_matrix": [52.5]})");
    expect_error(folder.path(), "`intrinsic_matrix` takes 9 numbers");
    write_text(folder / name, "");
    expect_error(folder.path(), "is not JSON");
  }
}

std::string opencv_yaml(const Camera& c) {
  return fmt::format(
      "%YAML:1.0\n---\ncamera_name: calibration\nimage_width: {}\nimage_height: {}\ncamera_matrix:\n   rows: 3\n   "
      "cols: "
      "3\n   data: [ {}, 0., {}, 0., {}, {}, 0., 0., 1. ]\ndistortion_coefficients:\n   rows: 1\n   cols: 5\n   data: "
      "[ "
      "0.1, -0.2, 0.01, 0.02, 0.3 ]\ndistortion_model: plumb_bob\nlocal_transform:\n   rows: 3\n   cols: 4\n   data: [ "
      "0., 0., 1., 0.5, -1., 0., 0., 0., 0., -1., 0., 0.25 ]\n",
      c.width, c.height, c.fx, c.cx, c.fy, c.cy);
}

TEST(RtabMap, ReadsSmallerRegisteredDepth) {
  for (const char* calibration : {"calib/1.yaml", "calibration.yaml"}) {
    const TemporaryFolder folder;
    std::string poses = "#timestamp x y z qx qy qz qw id\n";
    Eigen::Isometry3d base_from_camera = Eigen::Isometry3d::Identity();
    base_from_camera.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    base_from_camera.translation() = Eigen::Vector3d(0.5, 0, 0.25);
    for (int i = 0; i < kFrames; ++i) {
      const auto stamp = fmt::format("{:.6f}", 9.75 + 0.25 * i);  // 9.75 must come before 10
      write_images(i, folder / ("depth/" + stamp + ".png"), folder / ("rgb/" + stamp + ".jpg"), 1000, kTwice);
      const Eigen::Isometry3d pose =
          *room(kCamera)[static_cast<std::size_t>(i)].world_from_camera * base_from_camera.inverse();
      const Eigen::Quaterniond q(pose.linear());
      poses += fmt::format("{} {} {} {} {} {} {} {} {}\n", stamp, pose.translation().x(), pose.translation().y(),
                           pose.translation().z(), q.x(), q.y(), q.z(), q.w(), i + 1);
    }
    fs::create_directories(folder / "calib");
    write_text(folder / calibration, opencv_yaml(kTwice));
    write_text(folder / "poses.txt", poses);
    expect_room(folder.path(), 1000, 4, kTwice, 9.75);
    expect_truth(folder.path());
    const Rig rig = open_source(folder.path().string())->rig();
    Camera depth = kCamera, color = kTwice;
    depth.distortion = color.distortion = {0.1, -0.2, 0.01, 0.02, 0.3};
    EXPECT_EQ(rig, Rig(depth, ColorCamera{.camera = color}));
    write_text(folder / calibration, "%YAML:1.0\n---\nimage_width: 64\n");
    expect_error(folder.path(), "`image_height` is missing");
    write_text(folder / calibration, "");
    expect_error(folder.path(), ".yaml: expected lines");
    write_text(folder / calibration, opencv_yaml(kTwice));
    fs::rename(folder / "depth/9.750000.png", folder / "depth/first.png");
    expect_error(folder.path(), "not a timestamp");
  }
}

/// Writes a TUM recording: images and their lists.
void write_lists(const fs::path& folder) {
  std::string depth, rgb;
  for (int i = 0; i < kFrames; ++i) {
    write_images(i, folder / fmt::format("depth/{}.png", i), folder / fmt::format("rgb/{}.png", i), 5000);
    depth += fmt::format("{} depth/{}.png\n", 0.1 * i, i);
    rgb += fmt::format("{} rgb/{}.png\n", 0.1 * i, i);
  }
  write_text(folder / "depth.txt", depth);
  write_text(folder / "rgb.txt", rgb);
}

TEST(Eth3d, ReadsCalibration) {
  const TemporaryFolder folder;
  write_lists(folder.path());
  write_text(folder / "calibration.txt", "52.5 52.25 31.5 23.75\n");
  expect_room(folder.path(), 5000, 10);
  EXPECT_EQ(open_source(folder.path().string())->rig(), Rig(kCamera));
  write_text(folder / "calibration.txt", "52.5 52.25 31.5\n");
  expect_error(folder.path(), "calibration.txt:1: expected one line");
  write_text(folder / "calibration.txt", "");
  expect_error(folder.path(), "calibration.txt: is empty");
  write_text(folder / "calibration.txt", "-5 52.25 31.5 23.75\n");
  expect_error(folder.path(), "calibration.txt: ");
}

TEST(Bonn, HasItsOwnCamera) {
  const TemporaryFolder above;
  const fs::path folder = above / "rgbd_bonn_balloon";
  write_lists(folder);
  expect_error(folder, "the camera is unknown");  // image size differs from Bonn's
  for (int i = 0; i < kFrames; ++i)
    cv::imwrite((folder / fmt::format("depth/{}.png", i)).string(), cv::Mat(480, 640, CV_16U, cv::Scalar(5000 + i)));
  EXPECT_EQ(
      open_source(folder.string())->rig().depth,
      (Camera{
          640, 480, 542.822841, 542.576870, 315.593520, 237.756098, {0.039903, -0.099343, -0.000730, -0.000144, 0.0}}));
}

struct Nerfstudio {
  TemporaryFolder folder;
  std::string camera =
      R"("w": 128, "h": 96, "fl_x": 105, "fl_y": 104.5, "cx": 64, "cy": 48.5, "k1": 0.125, "p2": 0.25)";
  Nerfstudio() {
    for (int i = 0; i < kFrames; ++i)
      write_images(i, folder / fmt::format("depth/{}.png", 8 + i), folder / fmt::format("images/{}.jpg", 8 + i), 1000,
                   kTwice);
  }
  void write(const std::string& more = "", const std::string& of_the_last = "") const {
    std::string frames;
    for (const int i : {2, 0, 1, 3}) {
      // OpenGL's camera looks along -z with y up.
      Eigen::Matrix4d pose = room(kCamera)[static_cast<std::size_t>(i)].world_from_camera->matrix();
      pose.col(1) *= -1;
      pose.col(2) *= -1;
      std::string rows = "[";
      for (int r = 0; r < 4; ++r)
        rows += fmt::format("{}[{:.12g}, {:.12g}, {:.12g}, {:.12g}]", r ? ", " : "", pose(r, 0), pose(r, 1), pose(r, 2),
                            pose(r, 3));
      frames += fmt::format(
          R"({}{{"file_path": "images/{}.jpg", "depth_file_path": "depth/{}.png", "transform_matrix": {}]{}}})",
          frames.empty() ? "" : ",\n", 8 + i, 8 + i, rows, i == 3 ? of_the_last : "");
    }
    write_text(folder / "transforms.json", "{" + camera + more + ", \"frames\": [" + frames + "]}");
  }
};

TEST(Nerfstudio, ReadsFramesPosesAndCamera) {
  const Nerfstudio scan;
  scan.write();
  expect_room(scan.folder.path(), 1000, 30, kTwice);
  expect_truth(scan.folder.path());
  Camera depth = kCamera, color = kTwice;
  depth.distortion = color.distortion = {0.125, 0, 0, 0.25};
  EXPECT_EQ(open_source(scan.folder.path().string())->rig(), Rig(depth, ColorCamera{.camera = color}));
}

TEST(Nerfstudio, ReadsFisheyesAndUnits) {
  const Nerfstudio scan;
  scan.write(R"(, "camera_model": "OPENCV_FISHEYE", "k4": 0.0625, "depth_unit_scale_factor": 0.002)");
  const auto source = open_source(scan.folder.path().string());
  EXPECT_EQ(source->rig().depth.lens, Lens::fisheye);
  EXPECT_EQ(source->rig().depth.distortion[3], 0.0625);
  EXPECT_NEAR(source->next()->depth[100], 2 * room(kCamera)[0].depth[100], 2e-3);
}

TEST(Nerfstudio, RejectsInvalidFilesInOneLine) {
  const Nerfstudio scan;
  const fs::path folder = scan.folder.path();
  scan.write(R"(, "camera_model": "EQUIRECTANGULAR")");
  expect_error(folder, "`camera_model` is 'EQUIRECTANGULAR'");
  scan.write("", R"(, "transform_matrix": [])");
  expect_error(folder, "`transform_matrix` is not a pose");
  scan.write(R"(, "depth_unit_scale_factor": 0)");
  expect_error(folder, "depth_unit_scale_factor");
  for (const char* text : {"", "{", "[]", "{\"frames\": []}"}) {
    write_text(folder / "transforms.json", text);
    expect_error(folder, "transforms.json: ");
  }
  write_text(folder / "transforms.json", R"({"frames": [{"file_path": "images/1.jpg"}]})");
  expect_error(folder, "none of its 1 frames has depth");
  write_text(folder / "transforms.json", R"({"frames": [{"depth_file_path": "a.png"}]})");
  expect_error(folder, "frame 0: `w` is missing");
}

TEST(ColorOfAnotherSize, KeepsItsResolution) {
  const TemporaryFolder folder;
  for (int i = 0; i < kFrames; ++i)
    write_images(i, folder / fmt::format("depth/{}.png", i), folder / fmt::format("rgb/{}.png", i), 1000, kTwice);
  write_text(folder / "intrinsics.json",
             R"({"width": 64, "height": 48, "fx": 52.5, "fy": 52.25, "cx": 31.5, "cy": 23.75, "depth_scale": 1000})");
  write_text(folder / "rgb/0.png", "not an image");  // the size comes from the next image
  const auto source = open_source(folder.path().string());
  EXPECT_EQ(source->rig(), Rig(kCamera, ColorCamera{.camera = kTwice}));
  EXPECT_TRUE(source->next()->color.empty());
  EXPECT_EQ(source->next()->color, room(kTwice)[1].color);
}

TEST(ColorOfAnotherSize, IsIgnoredWithWarningForAnotherAspectRatio) {
  const TemporaryFolder folder;
  write_images(0, folder / "depth/0.png", folder / "rgb/0.png", 1000);
  cv::imwrite((folder / "rgb/0.png").string(), cv::Mat(64, 64, CV_8UC3, cv::Scalar(1, 2, 3)));
  write_text(folder / "intrinsics.json",
             R"({"width": 64, "height": 48, "fx": 52.5, "fy": 52.25, "cx": 31.5, "cy": 23.75, "depth_scale": 1000})");
  testing::internal::CaptureStdout();
  const auto source = open_source(folder.path().string());
  const auto frame = source->next();
  const std::string output = testing::internal::GetCapturedStdout();
  EXPECT_NE(output.find("0.png: is 64x64"), std::string::npos) << output;
  EXPECT_EQ(std::count(output.begin(), output.end(), '\n'), 1);
  EXPECT_FALSE(frame->problem);
  EXPECT_TRUE(frame->color.empty());
  EXPECT_FALSE(source->rig().color);
}

TEST(OpenRecording, ListsKnownLayouts) {
  const TemporaryFolder folder;
  for (const char* name :
       {"TUM", "7-Scenes", "ICL-NUIM", "intrinsics.json", "nerfstudio", "Open3D", "RTAB-Map", "Replica"})
    expect_error(folder.path(), name);
}

}  // namespace
}  // namespace cairn
