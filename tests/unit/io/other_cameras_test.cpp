// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Camera files of SLAM programs, of structure from motion, and of phone apps.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "cairn/io/inspect.hpp"
#include "io/intrinsics.hpp"
#include "io/recording.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
const Camera kCamera{64, 48, 52.5, 52.25, 31.5, 23.75, {}};

struct Folder : TemporaryFolder {
  Folder() {
    fs::create_directories(*this / "depth");
    for (int i = 0; i < 3; ++i)
      cv::imwrite((*this / fmt::format("depth/{}.png", i)).string(), cv::Mat(48, 64, CV_16U, cv::Scalar(1000 + i)));
  }
  void write(const std::string& name, const std::string& text) const {
    fs::create_directories((*this / name).parent_path());
    write_text(*this / name, text);
  }
};
std::string refusal(const fs::path& folder, const fs::path& camera = {}) {
  const std::string error = error_of([&] { (void)open_source(folder.string(), {.camera = camera}); });
  EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  return error;
}
bool has(const std::string& text, const std::string& part) { return text.find(part) != text.npos; }

constexpr const char* kOrbSlam =
    "%YAML:1.0\n---\n# RGB-D\nCamera.type: \"PinHole\"\nCamera.fx: 52.5\nCamera.fy: 52.25\nCamera.cx: 31.5\n"
    "Camera.cy: 23.75\nCamera.k1: 0.1\nCamera.k2: -0.2\nCamera.p1: 0.001\nCamera.p2: 0.002\nCamera.k3: 0.3\n"
    "Camera.width: 64\nCamera.height: 48\nCamera.fps: 10.0\nCamera.RGB: 1\nDepthMapFactor: 500.0\n";

TEST(OtherCameras, ReadOrbSlam2) {
  const Folder folder;
  folder.write("TUM1.yaml", kOrbSlam);
  Camera expected = kCamera;
  expected.distortion = {0.1, -0.2, 0.001, 0.002, 0.3};
  for (const fs::path& option : {fs::path(), folder / "TUM1.yaml"}) {
    const auto source = open_source(folder.path().string(), {.camera = option});
    EXPECT_EQ(source->rig(), Rig(expected));
    EXPECT_FLOAT_EQ(source->next()->depth[0], 2.0f);
    EXPECT_DOUBLE_EQ(source->next()->timestamp, 0.1);
  }
  folder.write("TUM2.yaml", kOrbSlam);
  const std::string error = refusal(folder.path());
  EXPECT_TRUE(has(error, "TUM1.yaml and TUM2.yaml each have a camera: give one of them with --camera")) << error;
  EXPECT_EQ(open_source(folder.path().string(), {.camera = folder / "TUM2.yaml"})->rig(), Rig(expected));
}

TEST(OtherCameras, ReadOrbSlam3) {
  const Folder folder;
  folder.write("camera.yaml",
               "%YAML:1.0\n\nFile.version: \"1.0\"\nCamera.type: \"KannalaBrandt8\"\nCamera1.fx: 52.5\nCamera1.fy: "
               "52.25\nCamera1.cx: 31.5\nCamera1.cy: 23.75\nCamera1.k1: 0.1\nCamera1.k2: 0.2\nCamera1.k3: "
               "0.03\nCamera1.k4: 0.04\nRGBD.DepthMapFactor: 500.0\nTbc: !!opencv-matrix\n  rows: 1\n  cols: 1\n  dt: "
               "f\n  data: [1.0]\n");
  const auto source = open_source(folder.path().string());
  Camera expected = kCamera;
  expected.lens = Lens::fisheye;
  expected.distortion = {0.1, 0.2, 0.03, 0.04};
  EXPECT_EQ(source->rig(), Rig(expected));  // in the images' size
  EXPECT_FLOAT_EQ(source->next()->depth[0], 2.0f);
}

TEST(OtherCameras, ReportInvalidOrbSlamKey) {
  struct Case {
    const char *text, *error;
  };
  for (const Case& c :
       {Case{"Camera.fx: 52.5\nCamera.cx: 31.5\nCamera.cy: 23.75\n", "`Camera.fy` is missing"},
        {"Camera.fx: wide\nCamera.fy: 1\n", "`Camera.fx` takes a number"},
        {"Camera1.fx: 52.5\nCamera1.fy: 52\n", "`Camera1.cx` is missing"},
        {"Camera.type: Omni\nCamera.fx: 52.5\nCamera.fy: 52\nCamera.cx: 31\nCamera.cy: 23\n",
         "`Camera.type` is 'Omni'"},
        {"Camera.fx: 52.5\nCamera.fy: 52\nCamera.cx: 31\nCamera.cy: 23\nDepthMapFactor: -1\n", "depth_scale is -1"}}) {
    const Folder folder;
    folder.write("RealSense.yaml", c.text);
    const std::string error = refusal(folder.path());
    EXPECT_TRUE(has(error, c.error)) << error;
    EXPECT_TRUE(has(error, "RealSense.yaml")) << error;
  }
}

TEST(OtherCameras, ReadColmapModels) {
  struct Case {
    const char* line;
    double fy;
    std::array<double, 8> distortion;
    Lens lens;
  };
  const Lens brown = Lens::brown_conrady;
  for (const Case& c :
       {Case{"SIMPLE_PINHOLE 64 48 52.5 32 24.25", 52.5, {}, brown},
        {"PINHOLE 64 48 52.5 52.25 32 24.25", 52.25, {}, brown},
        {"SIMPLE_RADIAL 64 48 52.5 32 24.25 0.1", 52.5, {0.1}, brown},
        {"RADIAL 64 48 52.5 32 24.25 0.1 0.2", 52.5, {0.1, 0.2}, brown},
        {"OPENCV 64 48 52.5 52.25 32 24.25 0.1 0.2 0.01 0.02", 52.25, {0.1, 0.2, 0.01, 0.02}, brown},
        {"FULL_OPENCV 64 48 52.5 52.25 32 24.25 0.1 0.2 0.01 0.02 0.3 0.4 0.5 0.6",
         52.25,
         {0.1, 0.2, 0.01, 0.02, 0.3, 0.4, 0.5, 0.6},
         brown},
        {"OPENCV_FISHEYE 64 48 52.5 52.25 32 24.25 0.1 0.2 0.01 0.02", 52.25, {0.1, 0.2, 0.01, 0.02}, Lens::fisheye}}) {
    SCOPED_TRACE(c.line);
    Camera expected = kCamera;
    expected.fy = c.fy, expected.distortion = c.distortion, expected.lens = c.lens;
    for (const char* name : {"cameras.txt", "sparse/0/cameras.txt"}) {
      const Folder folder;
      folder.write(name,
                   fmt::format("# Camera list\n# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n1 {0}\n2 {0}\n", c.line));
      EXPECT_EQ(open_source(folder.path().string())->rig(), Rig(expected));
    }
  }
}

TEST(OtherCameras, RejectUnsupportedColmapModels) {
  struct Case {
    const char *text, *error;
  };
  for (const Case& c :
       {Case{"1 THIN_PRISM_FISHEYE 64 48 1 1 1 1 1 1 1 1 1 1 1 1\n", "the model 'THIN_PRISM_FISHEYE' is not supported"},
        {"1 FOV 64 48 50 50 32 24 0.9\n", "'FOV'"},
        {"1 PINHOLE 64 48 50 50 32\n", "PINHOLE takes 4 parameters, found 3"},
        {"1 PINHOLE 64 48 50 50 x 24\n", "line 1: 'x' is not a number"},
        {"1 PINHOLE 64 48 50 50 32 24\n2 PINHOLE 64 48 51 50 32 24\n", "line 2: differs from the first camera"},
        {"# none\n", "has no camera"}}) {
    const Folder folder;
    folder.write("cameras.txt", c.text);
    EXPECT_TRUE(has(refusal(folder.path()), c.error)) << refusal(folder.path());
    EXPECT_TRUE(has(refusal(folder.path()), "cameras.txt"));
  }
  const Folder folder;
  folder.write("cameras.bin", "\1\2");
  EXPECT_TRUE(has(refusal(folder.path()), "cameras.bin: is binary; write COLMAP's model as text"));
}

TEST(OtherCameras, ReadPhoneApps) {
  struct Case {
    const char *name, *text;
  };
  // Color has twice the size; Record3D's K is column-major, 3D Scanner App's row-major.
  for (const Case& c : {Case{"metadata.json", R"({"w": 128, "h": 96, "dw": 64, "dh": 48, "fps": 30,
                             "K": [105, 0, 0, 0, 104.5, 0, 63.5, 48, 1]})"},
                        {"frame_00000.json", R"({"time": 1.5, "frame_index": 0,
                             "intrinsics": [105, 0, 63.5, 0, 104.5, 48, 0, 0, 1]})"},
                        {"info.json", R"({"title": "a", "intrinsics": [105, 0, 63.5, 0, 104.5, 48, 0, 0, 1]})"}}) {
    SCOPED_TRACE(c.name);
    const Folder folder;
    for (int i = 0; i < 3; ++i) {
      folder.write("rgb/none", "");
      cv::imwrite((folder / fmt::format("rgb/{}.jpg", i)).string(), cv::Mat(96, 128, CV_8UC3, cv::Scalar(1, 2, 3)));
    }
    folder.write(c.name, c.text);
    const Rig rig = open_source(folder.path().string())->rig();
    EXPECT_EQ(rig.depth, kCamera);
    ASSERT_TRUE(rig.color);
    EXPECT_EQ(rig.color->camera.fx, 105);
  }
  const Folder folder;  // files with these names from other programs are ignored
  folder.write("metadata.json", R"({"title": "scan"})");
  folder.write("info.json", "not JSON");
  EXPECT_TRUE(has(refusal(folder.path()), "the camera is unknown: write its intrinsics"));
}

constexpr const char* kCalibration =
    "%YAML:1.0\n---\ncamera_name: a\nimage_width: 64\nimage_height: 48\ncamera_matrix:\n   rows: 3\n   cols: 3\n   "
    "data: "
    "[{}]\ndistortion_model: plumb_bob\ndistortion_coefficients:\n   rows: 1\n   cols: 5\n   data: [0.5, 0, 0, 0, "
    "0]\nprojection_matrix:\n   rows: 3\n   cols: 4\n   data: [{}]\n";

TEST(OtherCameras, ReadRectifiedRtabMap) {
  const Folder folder;
  const auto write = [&](const char* matrix, const char* projection) {
    folder.write("calibration.yaml", fmt::format(fmt::runtime(kCalibration), matrix, projection));
  };
  const char* projection = "52.5, 0, 31.5, 0, 0, 52.25, 23.75, 0, 0, 0, 1, 0";
  write("60, 0, 31.5, 0, 60, 23.75, 0, 0, 1", projection);
  EXPECT_EQ(open_source(folder.path().string())->rig().depth.fx, 60);
  EXPECT_EQ(open_source(folder.path().string())->rig().depth.distortion[0], 0.5);
  write("0, 0, 0, 0, 0, 0, 0, 0, 0", projection);
  EXPECT_EQ(open_source(folder.path().string())->rig(), Rig(kCamera));
  for (const char* invalid : {"60, 31.5, 0, 60, 0, 23.75, 0, 0, 1", "60, 0, 0, 0, 60, 0, 31.5, 23.75, 1",
                              "60, 0, 31.5, 7, 60, 23.75, 0, 0, 1", "60, 0, 31.5, 0, 60, 23.75, 0, 0, 0"}) {
    write(invalid, projection);
    EXPECT_TRUE(has(refusal(folder.path()), "`camera_matrix` is not [fx, 0, cx, 0, fy, cy, 0, 0, 1]")) << invalid;
  }
  write("0, 0, 0, 0, 0, 0, 0, 0, 0", "52.5, 0, 31.5");
  EXPECT_TRUE(has(refusal(folder.path()), "`projection_matrix` takes 12 numbers"));
}

TEST(OtherCameras, NameUnreadableFilesWithReason) {
  const Folder folder;
  folder.write("my_camera.json", R"({"fx": 50})");
  std::string error = refusal(folder.path());
  EXPECT_TRUE(has(error, "my_camera.json: `fy` is missing")) << error;
  EXPECT_TRUE(has(error, "write its intrinsics into")) << error;
  folder.write("my_camera.json", R"({"fx": 50, "fy": 50, "cx": 31, "cy": 24})");
  error = refusal(folder.path());
  EXPECT_TRUE(has(error, "my_camera.json has one, give it with --camera")) << error;
  EXPECT_EQ(open_source(folder.path().string(), {.camera = folder / "my_camera.json"})->rig().depth.fx, 50);
}

}  // namespace
}  // namespace cairn
