// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Exports of phone apps, written here from exact views of a room.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "cairn/io/layouts.hpp"
#include "cairn/io/source.hpp"
#include "io/resample.hpp"
#include "support/depth_files.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr int kFrames = 3;
const Camera kCamera{64, 48, 52.5, 52.25, 31.5, 23.75, {}};

Frame view(const Camera& camera, int i) { return scene_frame(synthetic_scene("room"), camera, i); }

cv::Mat1f depth_of(const Frame& frame, const Camera& camera) {
  return cv::Mat1f(camera.height, camera.width, const_cast<float*>(frame.depth.data())).clone();
}

void write_png(const fs::path& file, const Frame& frame, const Camera& camera) {
  fs::create_directories(file.parent_path());
  cv::Mat millimeters;
  depth_of(frame, camera).convertTo(millimeters, CV_16U, 1000);
  cv::imwrite(file.string(), millimeters);
}

void write_color(const fs::path& file, const Frame& frame, const Camera& camera) {
  fs::create_directories(file.parent_path());
  cv::Mat bgr;
  cv::cvtColor(cv::Mat(camera.height, camera.width, CV_8UC4, const_cast<std::uint32_t*>(frame.color.data())), bgr,
               cv::COLOR_RGBA2BGR);
  cv::imwrite(file.string(), bgr);
}

/// world_from_camera with OpenGL's camera axes.
Eigen::Matrix4d opengl_pose(const Frame& frame) {
  Eigen::Matrix4d pose = frame.world_from_camera->matrix();
  pose.col(1) *= -1;
  pose.col(2) *= -1;
  return pose;
}

std::string rows_of(const Eigen::Matrix4d& m) {
  std::string rows;
  for (int r = 0; r < 4; ++r)
    rows += fmt::format("{}[{:.12g}, {:.12g}, {:.12g}, {:.12g}]", r ? ", " : "", m(r, 0), m(r, 1), m(r, 2), m(r, 3));
  return "[" + rows + "]";
}

void expect_poses(const fs::path& folder, int frames = kFrames) {
  const auto truth = recorded_truth(folder);
  ASSERT_EQ(truth.size(), static_cast<std::size_t>(frames));
  for (int i = 0; i < frames; ++i)
    EXPECT_TRUE(
        truth[static_cast<std::size_t>(i)].world_from_camera.isApprox(*view(kCamera, i).world_from_camera, 1e-6))
        << i;
}

/// Median and 90th percentile of the depth difference in meters, over pixels with depth in both.
std::pair<double, double> depth_difference(const std::vector<float>& a, const std::vector<float>& b) {
  std::vector<double> all;
  for (std::size_t i = 0; i < a.size() && i < b.size(); ++i)
    if (a[i] > 0 && b[i] > 0) all.push_back(std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
  std::sort(all.begin(), all.end());
  if (all.size() < a.size() / 2) return {1e9, 1e9};
  return {all[all.size() / 2], all[all.size() * 9 / 10]};
}

struct Nerfstudio {
  TemporaryFolder folder;
  std::string camera = R"("w": 64, "h": 48, "fl_x": 52.5, "fl_y": 52.25, "cx": 32, "cy": 24.25)", frames;
  double scale = 1;  // of the poses

  void write_images(int i, const Camera& its = kCamera) const {
    write_png(folder / fmt::format("depth/{}.png", i), view(its, i), its);
    write_color(folder / fmt::format("images/{}.png", i), view(its, i), its);
  }
  /// `names`: file_path, depth_file_path and further fields of the frame.
  void add(int i, const std::string& names) {
    Eigen::Matrix4d pose = opengl_pose(view(kCamera, i));
    pose.topRightCorner<3, 1>() *= scale;
    frames += fmt::format("{}{{{}, \"transform_matrix\": {}}}", frames.empty() ? "" : ",", names, rows_of(pose));
  }
  void write(const std::string& more = "") const {
    write_text(folder / "transforms.json", "{" + camera + more + ", \"frames\": [" + frames + "]}");
  }
  [[nodiscard]] std::unique_ptr<Source> open() const { return open_source(folder.path().string()); }
  void expect_all(int frames_there = kFrames) const {
    const auto source = open();
    for (int i = 0; i < frames_there; ++i) {
      const auto frame = source->next();
      ASSERT_TRUE(frame);
      ASSERT_FALSE(frame->problem) << *frame->problem;
      EXPECT_LT(depth_difference(frame->depth, view(kCamera, i).depth).second, 1e-3);
      EXPECT_EQ(frame->color, view(kCamera, i).color);
    }
    EXPECT_FALSE(source->next());
  }
};

TEST(Nerfstudio, AcceptsWindowsPathsAndMissingExtensions) {
  Nerfstudio windows, bare;
  for (int i = 0; i < kFrames; ++i) {
    windows.write_images(i);
    bare.write_images(i);
    windows.add(i, fmt::format(R"("file_path": "images\\{0}.png", "depth_file_path": "depth\\{0}.png")", i));
    bare.add(i, fmt::format(R"("file_path": "./images/{0}", "depth_file_path": "./depth/{0}")", i));
  }
  windows.write();
  bare.write();
  windows.expect_all();
  bare.expect_all();
}

TEST(Nerfstudio, SkipsFramesWithoutDepth) {
  Nerfstudio scan;
  for (int i = 0; i < kFrames; ++i) scan.write_images(i);
  scan.add(0, R"("file_path": "images/0.png")");
  scan.add(1, R"("file_path": "images/1.png", "depth_file_path": "depth/1.png")");
  scan.add(2, R"("file_path": "images/2.png")");
  scan.add(2, R"("file_path": "images/9.png")");
  scan.write();
  testing::internal::CaptureStdout();
  scan.expect_all();
  const std::string output = testing::internal::GetCapturedStdout();
  EXPECT_NE(output.find("1 of 4 frames have no depth"), std::string::npos) << output;
}

TEST(Nerfstudio, ReadsDepthWithoutColor) {
  Nerfstudio scan;
  for (int i = 0; i < kFrames; ++i) {
    write_png(scan.folder / fmt::format("depth/{}.png", i), view(kCamera, i), kCamera);
    scan.add(i, fmt::format(R"("depth_file_path": "depth/{}.png")", i));
  }
  scan.camera = R"("w": 128, "h": 96, "fl_x": 105, "fl_y": 104.5, "cx": 64, "cy": 48.5)";  // size of the missing images
  scan.write();
  const auto source = scan.open();
  EXPECT_EQ(source->rig(), Rig(kCamera));
  const auto frame = source->next();
  ASSERT_FALSE(frame->problem) << *frame->problem;
  EXPECT_LT(depth_difference(frame->depth, view(kCamera, 0).depth).second, 1e-3);
  expect_poses(scan.folder.path());
}

TEST(Nerfstudio, UsesFieldOfViewAndImageSize) {
  Nerfstudio scan;
  Camera its = kCamera;
  its.fy = its.fx, its.cy = 23.5;
  for (int i = 0; i < kFrames; ++i) {
    scan.write_images(i, its);
    scan.add(i, fmt::format(R"("file_path": "images/{0}.png", "depth_path": "depth/{0}.png")", i));
  }
  scan.camera = fmt::format("\"camera_angle_x\": {:.12g}", 2 * std::atan(32 / its.fx));
  scan.write();
  const Camera found = scan.open()->rig().depth;
  EXPECT_EQ(found.width, 64);
  EXPECT_NEAR(found.fx, its.fx, 1e-6);
  EXPECT_NEAR(found.fy, its.fy, 1e-6);
  EXPECT_EQ(found.cx, its.cx);
  EXPECT_EQ(found.cy, its.cy);
}

TEST(Nerfstudio, UndoesPoseScale) {
  Nerfstudio scan;
  scan.scale = 0.25;
  for (int i = 0; i < kFrames; ++i) {
    scan.write_images(i);
    scan.add(i, fmt::format(R"("depth_file_path": "depth/{}.png")", i));
  }
  scan.write(R"(, "applied_scale": 0.25)");
  expect_poses(scan.folder.path());
  scan.write(R"(, "applied_transform": [[0, 0.25, 0, 0], [0, 0, 0.25, 0], [0.25, 0, 0, 0]])");
  expect_poses(scan.folder.path());
}

/// The focal length changes by 4 % per frame; depth is compared with the first camera's view.
TEST(Nerfstudio, ResamplesFramesIntoFirstCamera) {
  constexpr double kMedian = 2e-3, kMaxDifference = 0.015;  // meters; without resampling the difference is 1 cm or more
  Nerfstudio scan;
  for (int i = 0; i < kFrames; ++i) {
    Camera its = kCamera;
    its.fx *= 1 + 0.04 * i, its.fy *= 1 + 0.04 * i, its.cx += 0.5 * i;
    scan.write_images(i, its);
    scan.add(i, fmt::format(R"("file_path": "images/{0}.png", "depth_file_path": "depth/{0}.png", "fl_x": {1:.12g}, )"
                            R"("fl_y": {2:.12g}, "cx": {3:.12g})",
                            i, its.fx, its.fy, its.cx + 0.5));
    if (i == 0) continue;
    const Resampler turn(kCamera, its);
    EXPECT_GT(depth_difference(view(its, i).depth, view(kCamera, i).depth).first, 2 * kMedian);
    EXPECT_LT(depth_difference(turn.depth(view(its, i).depth), view(kCamera, i).depth).first, kMedian);
  }
  scan.write();
  const auto source = scan.open();
  EXPECT_EQ(source->rig(), Rig(kCamera));
  for (int i = 0; i < kFrames; ++i) {
    const auto frame = source->next();
    ASSERT_FALSE(frame->problem) << *frame->problem;
    const auto [median, largest] = depth_difference(frame->depth, view(kCamera, i).depth);
    EXPECT_LT(median, kMedian) << i;
    EXPECT_LT(largest, kMaxDifference) << i;
    EXPECT_EQ(frame->color.size(), 64u * 48u);
  }
}

TEST(Nerfstudio, DevicePosesHaveFrameTimes) {
  Nerfstudio scan;
  for (int i = 0; i < kFrames; ++i) {
    scan.write_images(i);
    scan.add(i, fmt::format(R"("file_path": "images/{0}.png", "depth_file_path": "depth/{0}.png")", i));
  }
  scan.write();
  const auto expect_times = [&](double rate, const fs::path& camera) {
    const auto source = open_source(scan.folder.path().string(), {.camera = camera});
    const Trajectory poses = device_poses(scan.folder.path(), camera);
    ASSERT_EQ(poses.size(), static_cast<std::size_t>(kFrames));
    for (int i = 0; i < kFrames; ++i) {
      EXPECT_NEAR(source->next()->timestamp, i / rate, 1e-9);
      EXPECT_NEAR(poses[static_cast<std::size_t>(i)].timestamp, i / rate, 1e-9);
    }
  };
  const std::string camera = "fx: 52.5\nfy: 52.25\ncx: 31.5\ncy: 23.75\nwidth: 64\nheight: 48\n";
  expect_times(30, {});
  write_text(scan.folder / "camera.yaml", camera + "frame_rate: 10\n");
  expect_times(10, {});
  const TemporaryFolder elsewhere;
  write_text(elsewhere / "camera.yaml", camera + "frame_rate: 5\n");
  expect_times(5, elsewhere / "camera.yaml");
}

TEST(Resampler, KeepsImagesOfNearlyEqualCamera) {
  Camera near = kCamera, far = kCamera;
  near.fx += 0.03;
  far.fx += 3;
  EXPECT_TRUE(Resampler(kCamera, near, 0.1).is_identity());
  EXPECT_FALSE(Resampler(kCamera, near).is_identity());
  EXPECT_FALSE(Resampler(kCamera, far, 0.1).is_identity());
}

struct Record3d {
  TemporaryFolder folder;
  std::string poses, times, more;
  Record3d() {
    for (int i = 0; i < kFrames; ++i) {
      const Frame frame = view(kCamera, i);
      Eigen::Matrix3d turn = opengl_pose(frame).topLeftCorner<3, 3>();
      const Eigen::Quaterniond q(turn);
      const Eigen::Vector3d t = frame.world_from_camera->translation();
      poses += fmt::format("{}[{:.15g}, {:.15g}, {:.15g}, {:.15g}, {:.15g}, {:.15g}, {:.15g}]", i ? ", " : "", q.x(),
                           q.y(), q.z(), q.w(), t.x(), t.y(), t.z());
      times += fmt::format("{}{}", i ? ", " : "", 0.1 * i);
      cv::Mat1f depth = depth_of(frame, kCamera);
      depth(0, 0) = NAN, depth(0, 1) = INFINITY;
      fs::create_directories(folder / "depth");
      write_text(folder / fmt::format("depth/{}.exr", i), exr({{"R", depth}}));
      write_color(folder / fmt::format("rgb/{}.jpg", i), frame, kCamera);
    }
  }
  /// K has twice the image size, as after downscaling the images.
  void write() const {
    write_text(folder / "metadata.json",
               fmt::format(R"({{"K": [105, 0, 0, 0, 104.5, 0, 63.5, 48, 1], "w": 128, "h": 96, "dw": 64, "dh": 48, )"
                           R"("fps": 60, "cameraType": 1, "poses": [{}], "frameTimestamps": [{}]{}}})",
                           poses, times, more));
  }
};

TEST(Record3d, ReadsDepthTimesPosesAndCamera) {
  const Record3d scan;
  scan.write();
  const auto source = open_source(scan.folder.path().string());
  EXPECT_EQ(source->layout(), "Record3D folder");
  EXPECT_EQ(source->rig().depth, kCamera);
  EXPECT_EQ(to_string(source->rig().sensor), "phone_lidar");
  for (int i = 0; i < kFrames; ++i) {
    const auto frame = source->next();
    ASSERT_FALSE(frame->problem) << *frame->problem;
    EXPECT_DOUBLE_EQ(frame->timestamp, 0.1 * i);
    EXPECT_EQ(frame->depth[0], 0);
    EXPECT_EQ(frame->depth[1], 0);
    EXPECT_EQ(frame->depth[500], view(kCamera, i).depth[500]);
    EXPECT_EQ(frame->color.size(), 64u * 48u);
  }
  expect_poses(scan.folder.path());
}

TEST(Record3d, SortsFramesByTime) {
  Record3d scan;
  scan.times = "0.2, 0.1, 0.0";
  scan.write();
  const auto source = open_source(scan.folder.path().string());
  for (int i = 0; i < kFrames; ++i) {
    const auto frame = source->next();
    ASSERT_FALSE(frame->problem) << *frame->problem;
    EXPECT_DOUBLE_EQ(frame->timestamp, 0.1 * i);
    EXPECT_EQ(frame->depth[500], view(kCamera, kFrames - 1 - i).depth[500]);
  }
  EXPECT_DOUBLE_EQ(recorded_truth(scan.folder.path())[0].timestamp, 0);
}

TEST(Record3d, ResamplesFramesOfOtherIntrinsics) {
  Record3d scan;
  scan.more =
      R"(, "perFrameIntrinsicCoeffs": [[105, 104.5, 63.5, 48], [110, 109.5, 63.5, 48], [105, 104.5, 63.5, 48]])";
  scan.write();
  const auto source = open_source(scan.folder.path().string());
  EXPECT_EQ(source->next()->depth[500], view(kCamera, 0).depth[500]);
  EXPECT_NE(source->next()->depth[500], view(kCamera, 1).depth[500]);
  EXPECT_EQ(source->next()->depth[500], view(kCamera, 2).depth[500]);
}

TEST(Record3d, ExplainsHowToExportArchive) {
  const TemporaryFolder folder;
  write_text(folder / "scan.r3d", "PK");
  fs::create_directories(folder / "unpacked/rgbd");
  write_text(folder / "unpacked/metadata", R"({"K": [], "w": 1, "h": 1})");
  write_text(folder / "unpacked/rgbd/0.depth", "bvx2");
  for (const char* name : {"scan.r3d", "unpacked"}) {
    const auto error = error_of([&] { (void)open_source((folder / name).string()); });
    EXPECT_NE(error.find("LZFSE"), std::string::npos) << error;
    EXPECT_NE(error.find("EXR + JPG"), std::string::npos) << error;
  }
}

TEST(Record3d, ReportsErrorInOneLine) {
  const Record3d scan;
  write_text(scan.folder / "metadata.json", R"({"K": [1, 2], "w": 64, "h": 48, "poses": []})");
  const auto error = error_of([&] { (void)open_source(scan.folder.path().string()); });
  EXPECT_NE(error.find("metadata.json: `K` is not"), std::string::npos) << error;
}

struct Polycam {
  TemporaryFolder folder;
  void write(const std::string& cameras, int i) const {
    const auto pose = opengl_pose(view(kCamera, i));
    std::string numbers;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 4; ++c) numbers += fmt::format(", \"t_{}{}\": {:.12g}", r, c, pose(r, c));
    fs::create_directories(folder / ("keyframes/" + cameras));
    write_text(
        folder / fmt::format("keyframes/{}/{}.json", cameras, 1442008525605 + 250000 * i),
        fmt::format(R"({{"fx": 52.5, "fy": 52.25, "cx": 31.5, "cy": 23.75, "width": 64, "height": 48{}}})", numbers));
  }
  explicit Polycam(bool with_depth = true) {
    for (int i = 0; i < kFrames; ++i) {
      const std::string stem = std::to_string(1442008525605 + 250000 * i);
      write("corrected_cameras", i);
      write("cameras", 0);
      write_color(folder / ("keyframes/images/" + stem + ".jpg"), view(kCamera, i), kCamera);
      if (!with_depth) continue;
      write_png(folder / ("keyframes/depth/" + stem + ".png"), view(kCamera, i), kCamera);
      fs::create_directories(folder / "keyframes/confidence");
      cv::Mat1b confidence(48, 64, std::uint8_t{54});
      confidence(0, 0) = 255, confidence(0, 1) = 0;
      cv::imwrite((folder / ("keyframes/confidence/" + stem + ".png")).string(), confidence);
    }
  }
};

TEST(Polycam, ReadsKeyframesWithAdjustedPoses) {
  const Polycam scan;
  const auto source = open_source(scan.folder.path().string());
  EXPECT_EQ(source->layout(), "Polycam folder");
  EXPECT_EQ(source->rig().depth, kCamera);
  const auto first = source->next(), second = source->next();
  ASSERT_FALSE(first->problem) << *first->problem;
  EXPECT_NEAR(second->timestamp - first->timestamp, 0.25, 1e-9);
  EXPECT_LT(depth_difference(first->depth, view(kCamera, 0).depth).second, 1e-3);
  EXPECT_EQ(first->color.size(), 64u * 48u);
  EXPECT_EQ(first->confidence[0], 255);
  EXPECT_EQ(first->confidence[1], 0);
  EXPECT_EQ(first->confidence[2], 128);  // threshold of phone_lidar
  expect_poses(scan.folder.path());
}

TEST(Polycam, ExplainsMissingDepth) {
  const Polycam scan(false);
  const auto error = error_of([&] { (void)open_source(scan.folder.path().string()); });
  EXPECT_NE(error.find("LiDAR"), std::string::npos) << error;
}

}  // namespace
}  // namespace cairn
