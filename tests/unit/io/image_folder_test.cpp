// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Image folders without a specific layout.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgcodecs.hpp>

#include "cairn/io/known_cameras.hpp"
#include "io/recording.hpp"
#include "support/depth_files.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr int kWidth = 64, kHeight = 48;
constexpr const char* kCamera = "{width: 64, height: 48, fx: 52.5, fy: 52.25, cx: 31.5, cy: 23.75, depth_scale: 1000}";
const Camera kExpectedCamera{64, 48, 52.5, 52.25, 31.5, 23.75, {}};

/// Writes image i: depth 1 m + i cm, color value i.
void write_depth(const fs::path& file, int i, double units = 1000) {
  fs::create_directories(file.parent_path());
  cv::Mat depth(kHeight, kWidth, CV_16U, cv::Scalar(std::round((1 + 0.01 * i) * units)));
  depth.at<std::uint16_t>(0, 0) += 1;  // avoids a constant image
  cv::imwrite(file.string(), depth);
}
void write_color(const fs::path& file, int i, int width = kWidth, int height = kHeight) {
  fs::create_directories(file.parent_path());
  // JPEG preserves gray exactly.
  cv::imwrite(file.string(), cv::Mat(height, width, CV_8UC3, cv::Scalar::all(i)));
}
void write_bytes(const fs::path& file, const std::string& bytes) {
  fs::create_directories(file.parent_path());
  write_text(file, bytes);
}

/// Frame of a folder: the indices of its depth and color images, -1: none, and its time.
struct FrameValues {
  int depth, color;
  double time;
  friend bool operator==(const FrameValues&, const FrameValues&) = default;
};
void PrintTo(const FrameValues& result, std::ostream* out) {
  *out << result.depth << ' ' << result.color << ' ' << result.time;
}

struct Read {
  std::vector<FrameValues> frames;
  std::string output;
  Rig rig;
};
Read read(const fs::path& folder, const SourceOptions& options = {}) {
  testing::internal::CaptureStdout();
  Read read;
  try {
    const auto source = open_source(folder.string(), options);
    read.rig = source->rig();
    while (const auto frame = source->next()) {
      if (frame->problem) {
        read.frames.push_back({-1, -1, frame->timestamp});
        continue;
      }
      read.frames.push_back({static_cast<int>(std::lround(100 * (frame->depth[100] - 1))),
                             frame->color.empty() ? -1 : static_cast<int>(frame->color[100] & 255u),
                             1e-6 * std::round(1e6 * frame->timestamp)});
    }
  } catch (...) {
    (void)testing::internal::GetCapturedStdout();
    throw;
  }
  read.output = testing::internal::GetCapturedStdout();
  return read;
}
std::string refusal(const fs::path& folder, const SourceOptions& options = {}) {
  const std::string error = error_of([&] { (void)read(folder, options); });
  EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  return error;
}
std::string interpretation(const fs::path& folder, const char* what) {
  for (const auto& line : interpretation_of(folder.string()))
    if (line.what == what) return line.words;
  return {};
}
bool has(const std::string& text, const std::string& part) { return text.find(part) != text.npos; }
std::size_t lines(const std::string& text) {
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
}

double at(int frame) { return 1e-6 * std::round(1e6 * frame / 30.0); }

TEST(ImageFolder, IsReadInNaturalOrder) {
  const TemporaryFolder folder;
  write_text(folder / "camera.yaml", kCamera);
  std::vector<FrameValues> all;
  for (int i = 0; i < 20; ++i) {
    write_depth(folder / fmt::format("depth/{}.png", i), i);
    write_color(folder / fmt::format("color/{}.jpg", i), i);
    all.push_back({i, i, at(i)});
  }
  const Read result = read(folder.path());
  EXPECT_EQ(result.frames, all);
  EXPECT_EQ(result.output, "");
  EXPECT_EQ(result.rig, Rig(kExpectedCamera));
  EXPECT_EQ(interpretation(folder.path(), "pairing"), "by equal names; 0 depth and 0 color images are unpaired");
}

TEST(ImageFolder, LosesOnlyFramesWithMissingImages) {
  const TemporaryFolder folder;
  write_text(folder / "camera.yaml", kCamera);
  for (int i = 0; i < 12; ++i) {
    if (i != 7) write_depth(folder / fmt::format("depth/depth_{}.png", i), i);
    if (i != 3 && i != 4) write_color(folder / fmt::format("rgb/rgb_{:04}.png", i), i);
  }
  const Read result = read(folder.path());
  std::vector<FrameValues> expected;
  for (int i = 0; i < 12; ++i)
    if (i != 7) expected.push_back({i, i == 3 || i == 4 ? -1 : i, at(i)});
  EXPECT_EQ(result.frames, expected);
  EXPECT_EQ(lines(result.output), 2u);
  EXPECT_TRUE(has(result.output,
                  "2 of 11 frames have depth only: the color image is missing (first: frame 3, depth/depth_3.png)"))
      << result.output;
  EXPECT_TRUE(
      has(result.output, "1 of 10 color images are not used: the depth image is missing (first: rgb/rgb_0007.png)"))
      << result.output;
  EXPECT_EQ(interpretation(folder.path(), "pairing"), "by equal numbers; 2 depth and 1 color images are unpaired");
}

TEST(ImageFolder, FindsCommonFolderNames) {
  struct Case {
    const char *depth, *color;
  };
  for (const Case& c : {Case{"depth/{}.png", "images/{}.jpg"},
                        {"depths/{}.png", "image/{}.png"},
                        {"depth_raw/{}.png", "color/{}.png"},
                        {"Depth/{}.PNG", "RGB/{}.JPG"},
                        {"depth_16bit/{}.png", "rgb_left/{}.png"},
                        {"{}_depth.png", "{}_rgb.png"},
                        {"frame-{:06}.depth.png", "frame-{:06}.color.jpg"},
                        {"depth_{}.png", "rgb_{}.jpg"},
                        {"scene_1_{}_depth.png", "scene_1_{}.png"},
                        {"{}_d.png", "{}_c.png"},
                        {"{}.tiff", "{}.jpg"},
                        {"depth/scan {}.png", "rgb/scan {}.png"},
                        {"depth/\xc3\xbc{}.png", "rgb/\xc3\xbc{}.png"}}) {
    SCOPED_TRACE(c.depth);
    const TemporaryFolder folder;
    write_text(folder / "camera.yaml", kCamera);
    std::vector<FrameValues> all;
    for (int i = 8; i < 11; ++i) {
      write_depth(folder / fmt::format(fmt::runtime(c.depth), i), i);
      write_color(folder / fmt::format(fmt::runtime(c.color), i), i);
      all.push_back({i, i, at(i - 8)});
    }
    const Read result = read(folder.path());
    EXPECT_EQ(result.frames, all);
    EXPECT_EQ(result.output, "");
  }
}

TEST(ImageFolder, ReadsTimesFromNames) {
  struct Case {
    const char* unit;
    double units, begin;  // units per second; seconds
    int decimals;
  };
  for (const Case& c : {Case{"seconds", 1, 1305031102, 6},
                        {"milliseconds", 1e3, 1700000000, 0},
                        {"microseconds", 1e6, 1700000000, 0},
                        {"nanoseconds", 1e9, 100, 0},
                        {"milliseconds", 1e3, 0, 0}}) {
    SCOPED_TRACE(c.unit);
    const TemporaryFolder folder;
    write_text(folder / "camera.yaml", kCamera);
    std::vector<FrameValues> expected;
    for (int i = 0; i < 9; ++i) {
      const double depth = c.begin + i / 30.0, color = depth + 0.006;
      const auto name = [&](double time) { return fmt::format("{:.{}f}", time * c.units, c.decimals); };
      if (i != 5) write_depth(folder / ("depth/" + name(depth) + ".png"), i);
      if (i != 2) write_color(folder / ("rgb/" + name(color) + ".png"), i);
      if (i != 5) expected.push_back({i, i == 2 ? -1 : i, depth});
    }
    const Read result = read(folder.path());
    ASSERT_EQ(result.frames.size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
      EXPECT_EQ(result.frames[i].depth, expected[i].depth);
      EXPECT_EQ(result.frames[i].color, expected[i].color);
      EXPECT_NEAR(result.frames[i].time, expected[i].time, 6e-4);  // precision of names in milliseconds
    }
    EXPECT_EQ(interpretation(folder.path(), "times"), fmt::format("{} in the names", c.unit));
    EXPECT_EQ(interpretation(folder.path(), "pairing"), "by near times; 1 depth and 1 color images are unpaired");
  }
}

TEST(ImageFolder, AppliesFrameRateToNumberedImages) {
  const TemporaryFolder folder;
  write_text(folder / "camera.yaml", "{fx: 52.5, fy: 52.25, cx: 31.5, cy: 23.75, depth_scale: 1000, frame_rate: 10}");
  for (const int i : {0, 5, 10}) write_depth(folder / fmt::format("depth/{}.png", i), i);
  const Read result = read(folder.path());
  EXPECT_EQ(result.frames, (std::vector<FrameValues>{{0, -1, 0}, {5, -1, 0.5}, {10, -1, 1}}));
  EXPECT_EQ(result.rig, Rig(kExpectedCamera));  // with the images' size
  EXPECT_EQ(interpretation(folder.path(), "times"), "frame numbers in the names, 10 a second");
}

TEST(ImageFolder, ReadsDepthOfEachFormat) {
  const cv::Mat units(kHeight, kWidth, CV_16U, cv::Scalar(1250));
  cv::Mat meters(kHeight, kWidth, CV_32F, cv::Scalar(1.25));
  meters.at<float>(0, 0) = NAN;
  meters.at<float>(0, 1) = INFINITY;
  meters.at<float>(0, 2) = -1;
  meters.at<float>(0, 3) = 1e30f;
  cv::Mat doubles;
  meters.convertTo(doubles, CV_64F);
  struct Case {
    const char* name;
    std::string bytes;
    const char* unit;
  };
  for (const Case& c : {Case{"1.tif", tiff(units), "millimeters"},
                        {"1.tiff", tiff(meters), "meters"},
                        {"1.npy", npy("<u2", units), "millimeters"},
                        {"1.npy", npy("<f4", meters), "meters"},
                        {"1.npy", npy("<f8", doubles), "meters"},
                        {"1.npy", npy("<f4", cv::Mat(meters * 1000)), "millimeters"}}) {
    SCOPED_TRACE(c.name);
    const TemporaryFolder folder;
    write_text(folder / "camera.yaml", "{fx: 52.5, fy: 52.25, cx: 31.5, cy: 23.75}");
    write_bytes(folder / ("depth/" + std::string(c.name)), c.bytes);
    EXPECT_TRUE(has(interpretation(folder.path(), "unit of depth"), fmt::format("{} assumed: median 1.2 m", c.unit)) ||
                has(interpretation(folder.path(), "unit of depth"), fmt::format("{} assumed: median 1.3 m", c.unit)));
    const auto frame = open_source(folder.path().string())->next();
    ASSERT_FALSE(frame->problem) << *frame->problem;
    EXPECT_FLOAT_EQ(frame->depth[100], 1.25f);
    if (!has(c.unit, "milli")) {
      for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(frame->depth[i], 0.0f) << i;
    }
  }
}

TEST(ImageFolder, EstimatesAndReportsDepthUnit) {
  struct Case {
    double units;  // units per meter
    const char* words;
  };
  for (const Case& c :
       {Case{1000, "depth in millimeters assumed: median 1.0 m; set depth_scale"},
        {5000, "depth in units of 1/5000 m assumed: median 1.0 m"},
        {10000, "depth in units of 1/5000 m assumed: median 2.1 m"}}) {  // wrong, as no evidence exists, but reported
    const TemporaryFolder folder;
    write_text(folder / "intrinsics.txt", "52.5 52.25 31.5 23.75");
    for (int i = 3; i < 6; ++i) {
      fs::create_directories(folder / "depth");
      cv::Mat depth(kHeight, kWidth, CV_16U);
      for (int p = 0; p < kWidth * kHeight; ++p)  // whole millimeters
        depth.ptr<std::uint16_t>()[p] = static_cast<std::uint16_t>((1000 + p % 80) * c.units / 1000);
      cv::imwrite((folder / fmt::format("depth/{}.png", i)).string(), depth);
    }
    const Read result = read(folder.path());
    EXPECT_TRUE(has(result.output, c.words)) << result.output;
    EXPECT_EQ(lines(result.output), 2u) << result.output;  // also reports missing color
  }
}

TEST(ImageFolder, PairsRealRecordingAsItsLists) {
  CAIRN_REQUIRE_DATA("tum_fr1_rpy_400");
  const fs::path recording = data_folder() / "tum_fr1_rpy_400";
  const TemporaryFolder folder;
  for (const char* name : {"depth", "rgb"}) fs::create_directory_symlink(recording / name, folder / name);
  write_text(folder / "K.txt", "517.3 0 318.6\n0 516.5 255.3\n0 0 1\n");
  EXPECT_TRUE(has(interpretation(folder.path(), "unit of depth"), "1/5000 m assumed: median 1.2 m"));
  EXPECT_EQ(interpretation(folder.path(), "times"), "seconds in the names");
  const SourceOptions some{.range = {.begin = 0, .end = 400, .step = 40}};
  const auto listed = open_source(recording.string(), some), found = open_source(folder.path().string(), some);
  while (const auto truth = listed->next()) {
    const auto frame = found->next();
    ASSERT_TRUE(frame);
    EXPECT_NEAR(frame->timestamp, truth->timestamp, 1e-6);
    EXPECT_EQ(frame->depth, truth->depth);
    EXPECT_EQ(frame->color, truth->color);
    EXPECT_NEAR(frame->color_delay, truth->color_delay, 1e-6);
  }
}

TEST(ImageFolder, ReadsCommonCameraFiles) {
  struct Case {
    const char *name, *text;
  };
  for (const Case& c :
       {Case{"intrinsics.txt", "52.5 0 31.5\n0 52.25 23.75\n0 0 1\n"},
        {"intrinsics.txt", "# 4x4\n52.5 0 31.5 0\n0 52.25 23.75 0\n0 0 1 0\n0 0 0 1\n"},
        {"Intrinsics.txt", "fx fy cx cy\n52.5, 52.25, 31.5, 23.75\n"},
        {"camera-intrinsics.txt", " 5.25e+01\t 0.0e+00\t 3.15e+01\t\n 0 5.225e+01 2.375e+01\n 0 0 1\n"},
        {"K.txt", "[[52.5   0.   31.5 ]\n [ 0.   52.25 23.75]\n [ 0.    0.    1.  ]]\n"},
        {"camera.txt", "fx: 52.5\nfy = 52.25\ncx 31.5\ncy: 23.75\nwidth: 64\nheight: 48\n"},
        {"camera_primesense.json",
         R"({"width": 64, "height": 48, "intrinsic_matrix": [52.5, 0, 0, 0, 52.25, 0, 31.5, 23.75, 1]})"},
        {"camera_intrinsic.json", R"({"intrinsic_matrix": [[52.5, 0, 31.5], [0, 52.25, 23.75], [0, 0, 1]]})"},
        {"camera.json",
         R"({"class_name": "PinholeCameraParameters", "intrinsic": {"width": 64, "height": 48, "intrinsic_matrix":
               [52.5, 0, 0, 0, 52.25, 0, 31.5, 23.75, 1]}})"},
        {"intrinsics.json", R"({"K": [52.5, 0, 31.5, 0, 52.25, 23.75, 0, 0, 1]})"},
        {"intrinsics.json", R"({"width": 64, "height": 48, "fx": 52.5, "fy": 52.25, "ppx": 31.5, "ppy": 23.75,
               "model": "distortion.inverse_brown_conrady", "coeffs": [0, 0, 0, 0, 0]})"},
        {"camera_info.yaml",
         "image_width: 64\nimage_height: 48\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: "
         "[52.5, 0, 31.5, 0, 52.25, 23.75, 0, 0, 1]\ndistortion_model: plumb_bob\n"},
        {"camera_info.yaml", "height: 48\nwidth: 64\nK: [52.5, 0, 31.5, 0, 52.25, 23.75, 0, 0, 1]\nD: []\n"},
        {"ost.yaml",
         "%YAML:1.0\n---\nimage_width: 64\nimage_height: 48\ncamera_matrix: {rows: 3, cols: 3, data: "
         "[52.5, 0, 31.5, 0, 52.25, 23.75, 0, 0, 1]}\n"},
        {"intrinsic/intrinsic_depth.txt", "52.5 0 31.5 0\n0 52.25 23.75 0\n0 0 1 0\n0 0 0 1\n"}}) {
    SCOPED_TRACE(c.name);
    SCOPED_TRACE(c.text);
    const TemporaryFolder folder;
    write_depth(folder / "depth/0.png", 0);
    write_color(folder / "images/0.png", 0);
    write_bytes(folder / c.name, c.text);
    const Read result = read(folder.path());
    EXPECT_EQ(result.rig, Rig(kExpectedCamera));
    EXPECT_EQ(interpretation(folder.path(), "camera of"), (folder / c.name).string());
  }
}

TEST(ImageFolder, RejectsImpossibleCameraInOneLine) {
  struct Case {
    const char *name, *text, *error;
  };
  for (const Case& c : {Case{"intrinsics.txt", "", "intrinsics.txt: has 0 numbers; expected a 3x3"},
                        {"intrinsics.txt", "1 2 3 4 5 6 7 8 9", "`the matrix` is not [fx, 0, cx"},
                        {"K.txt", "52.5 0 31.5 0 52.25", "has 5 numbers"},
                        {"camera.yaml", "fx: 52.5\n", "`fy` is missing"},
                        {"camera.yaml", "{fx: 52.5, fy: 52.5, cx: 31.5, cy: 23.5, frame_rate: 0}", "`frame_rate` is 0"},
                        {"camera.json", "{\"fx\": 1}", "`fy` is missing"},
                        {"intrinsics.json", R"({"intrinsic_matrix": [52.5]})", "`intrinsic_matrix` takes 9 numbers"},
                        {"intrinsics.json", R"({"fx": 52, "fy": 52, "cx": 31, "cy": 23, "model": "ftheta",
                          "coeffs": [1, 0, 0, 0, 0]})",
                         "'ftheta' of the lens is unknown; write camera.yaml"},
                        {"camera_info.yaml", "K: [1, 2]\nwidth: 64\nheight: 48\n", "`K` takes 9 numbers"},
                        {"camera_info.yaml", "K: [1, 2\n", "camera_info.yaml:2: "},
                        {"intrinsics.txt", "1e9 1e9 32 24", "fx is 1000000000, allowed:"},
                        {"camera.yaml", "{width: 640, height: 640, fx: 525, fy: 525, cx: 320, cy: 320}",
                         "depth/0.png: is 64x48, the camera 640x640"}}) {
    SCOPED_TRACE(c.text);
    const TemporaryFolder folder;
    write_depth(folder / "depth/0.png", 0);
    write_text(folder / c.name, c.text);
    EXPECT_TRUE(has(refusal(folder.path()), c.error)) << refusal(folder.path());
  }
}

TEST(ImageFolder, ExplainsMissingCamera) {
  const TemporaryFolder folder;
  for (int i = 0; i < 3; ++i) write_depth(folder / fmt::format("depth/{}.png", i), i);
  const std::string error = refusal(folder.path());
  EXPECT_TRUE(
      has(error, "the camera is unknown: write its intrinsics into " + (folder / "camera.yaml").string() +
                     ", such as {width: 64, height: 48, fx: 52.5, fy: 52.5, cx: 31.5, cy: 23.5, depth_scale: 1000}"))
      << error;
  EXPECT_TRUE(has(error, "--camera")) << error;
  EXPECT_TRUE(has(error, "freiburg1, freiburg2")) << error;
  // The suggested text works as a camera file.
  const std::size_t begin = error.find('{'), end = error.find('}');
  write_text(folder / "camera.yaml", error.substr(begin, end + 1 - begin));
  EXPECT_EQ(read(folder.path()).frames.size(), 3u);
}

TEST(ImageFolder, ScalesKnownCameraToImages) {
  const TemporaryFolder folder;
  for (int i = 0; i < 2; ++i) write_depth(folder / fmt::format("depth/{}.png", i), i, 5000);
  const Read result = read(folder.path(), {.camera = "freiburg1"});
  Camera expected = scaled_to(known_camera("freiburg1")->camera, {kWidth, kHeight});
  EXPECT_EQ(result.rig, Rig(expected));
  EXPECT_EQ(result.frames, (std::vector<FrameValues>{{0, -1, 0}, {1, -1, at(1)}}));  // 5000 units per meter, as for TUM
  EXPECT_TRUE(has(refusal(folder.path(), {.camera = "kinect-v2"}), "is 64x48, the camera 512x424"));
  EXPECT_TRUE(has(refusal(folder.path(), {.camera = "freiburg9"}),
                  "freiburg9: is neither a file nor a known camera; known cameras: freiburg1, "));
}

TEST(ImageFolder, ScalesColorCameraToSmallerDepth) {
  const TemporaryFolder folder;
  write_depth(folder / "depth/0.png", 0);
  write_color(folder / "rgb/0.png", 0, 128, 96);
  write_text(folder / "camera.yaml",
             "{width: 128, height: 96, fx: 105, fy: 104.5, cx: 63.5, cy: 48, depth_scale: 1000}");
  const Read result = read(folder.path());
  EXPECT_EQ(result.rig.depth, kExpectedCamera);
  ASSERT_TRUE(result.rig.color);
  EXPECT_EQ(result.rig.color->camera, (Camera{128, 96, 105, 104.5, 63.5, 48, {}}));
  EXPECT_EQ(result.frames, (std::vector<FrameValues>{{0, 0, 0}}));
}

TEST(ImageFolder, KeepsGoodFramesAmongBadImages) {
  const TemporaryFolder folder;
  write_text(folder / "camera.yaml", kCamera);
  for (int i = 0; i < 12; ++i) {
    write_depth(folder / fmt::format("depth/{}.png", i), i);
    write_color(folder / fmt::format("rgb/{}.png", i), i);
  }
  write_text(folder / "depth/readme.txt", "not an image");
  write_text(folder / "depth/._3.png", "what macOS leaves");
  write_text(folder / "depth/Thumbs.db", "what Windows leaves");
  write_text(folder / "rgb/.hidden.png", "");
  cv::imwrite((folder / "depth/1.png").string(), cv::Mat(24, 32, CV_16U, cv::Scalar(1000)));
  cv::imwrite((folder / "depth/2.png").string(), cv::Mat(kHeight, kWidth, CV_8U, cv::Scalar(100)));
  cv::imwrite((folder / "depth/3.png").string(), cv::Mat(kHeight, kWidth, CV_8UC3, cv::Scalar(1, 2, 3)));
  write_text(folder / "depth/4.png", "");
  write_color(folder / "rgb/5.png", 5, 32, 24);
  write_text(folder / "rgb/6.png", "");
  fs::remove(folder / "depth/7.png");
  fs::create_symlink(folder / "depth/8.png", folder / "depth/7.png");  // link to a file: a normal image
  fs::remove(folder / "depth/9.png");
  fs::create_symlink(folder / "nowhere.png", folder / "depth/9.png");  // dangling link: reported as a problem
  const Read result = read(folder.path());
  ASSERT_EQ(result.frames.size(), 12u);
  for (const int bad : {1, 2, 3, 4, 9}) EXPECT_EQ(result.frames[static_cast<std::size_t>(bad)].depth, -1) << bad;
  for (const int good : {0, 8, 10, 11})
    EXPECT_EQ(result.frames[static_cast<std::size_t>(good)], (FrameValues{good, good, at(good)}));
  EXPECT_EQ(result.frames[7], (FrameValues{8, 7, at(7)}));
  for (const int gray : {5, 6})
    EXPECT_EQ(result.frames[static_cast<std::size_t>(gray)], (FrameValues{gray, -1, at(gray)}));
  EXPECT_EQ(lines(result.output), 1u) << result.output;
  EXPECT_TRUE(has(result.output, "2 of 12 color images are not used, their frames have depth only; the first: "))
      << result.output;
  EXPECT_TRUE(has(result.output, "5.png: is 32x24, the color camera 64x48")) << result.output;
}

TEST(ImageFolder, RejectsOtherFoldersWithRemedy) {
  {
    const TemporaryFolder folder;
    write_color(folder / "0.jpg", 0);
    write_color(folder / "1.jpg", 1);
    EXPECT_TRUE(has(refusal(folder.path()), "it has 2 images, none of them depth; expected depth images in depth"));
  }
  {
    const TemporaryFolder folder;
    write_text(folder / "camera.yaml", kCamera);
    write_color(folder / "rgb/0.jpg", 0);
    EXPECT_TRUE(has(refusal(folder.path()), "has camera.yaml, but no depth images"));
  }
  {
    const TemporaryFolder folder;
    write_bytes(folder / "depth/0.raw", "v");
    write_bytes(folder / "depth/1.raw", "v");
    EXPECT_TRUE(has(refusal(folder.path()), "depth: has no PNG, TIFF, EXR, NPY or PGM image; it has 2 files .raw"));
  }
  {
    const TemporaryFolder folder;
    write_depth(folder / "scan1/depth/0.png", 0);
    EXPECT_TRUE(has(refusal(folder.path()), "but its subfolder scan1 looks like one: give that folder"));
  }
  {
    const TemporaryFolder folder;
    write_text(folder / "intrinsics.txt", "52.5 52.25 31.5 23.75");
    for (int i = 0; i < 20; ++i) {
      fs::create_directories(folder / "depth");
      cv::imwrite((folder / fmt::format("depth/{}.png", i)).string(), cv::Mat(kHeight, kWidth, CV_8U, cv::Scalar(9)));
    }
    const std::string error = refusal(folder.path());
    EXPECT_TRUE(has(error, "depth/0.png: is an 8-bit image; depth must be a 16-bit image with one channel")) << error;
    EXPECT_TRUE(has(error, "9 of 20 depth images were tried")) << error;
  }
  {
    const TemporaryFolder folder;
    write_text(folder / "camera.yaml", kCamera);
    for (const char* name : {"a", "b"}) write_depth(folder / fmt::format("depth/{}.png", name), 0);
    for (const char* name : {"x", "y", "z"}) write_color(folder / fmt::format("rgb/{}.png", name), 0);
    EXPECT_TRUE(has(refusal(folder.path()),
                    "no color image matches a depth image by name (depth/a.png and rgb/x.png): give both"));
    fs::remove(folder / "rgb/z.png");
    EXPECT_TRUE(has(read(folder.path()).output, "they are paired in order"));
  }
}

TEST(ImageFolder, Reads3DMatchCameraAndPoses) {
  const TemporaryFolder above;
  write_text(above / "camera-intrinsics.txt", "52.5 0 31.5\n0 52.25 23.75\n0 0 1\n");
  for (const int i : {0, 1, 3}) {
    write_depth(above / fmt::format("seq-01/frame-{:06}.depth.png", i), i);
    write_color(above / fmt::format("seq-01/frame-{:06}.color.png", i), i);
    write_text(above / fmt::format("seq-01/frame-{:06}.pose.txt", i),
               fmt::format("1 0 0 {}\n0 1 0 0\n0 0 1 0\n0 0 0 1\n", i));
  }
  const Read result = read(above / "seq-01");
  EXPECT_EQ(result.frames, (std::vector<FrameValues>{{0, 0, 0}, {1, 1, at(1)}, {3, 3, at(3)}}));
  EXPECT_EQ(result.rig, Rig(kExpectedCamera));
  const auto truth = recorded_truth(above / "seq-01");
  ASSERT_EQ(truth.size(), 3u);
  EXPECT_EQ(truth[2].world_from_camera.translation().x(), 3);
}

TEST(SevenScenes, ContinuesAfterGap) {
  const TemporaryFolder folder;
  for (const int i : {5, 6, 8}) {
    cv::imwrite((folder / fmt::format("frame-{:06}.depth.png", i)).string(),
                cv::Mat(480, 640, CV_16U, cv::Scalar(1000 + i)));
  }
  const auto source = open_recording(folder.path(), {.find_color_camera = false});
  EXPECT_EQ(source->size(), 3);
  (void)source->next();
  (void)source->next();
  EXPECT_NEAR(source->next()->timestamp, 8 / 30.0, 1e-9);
}

TEST(TumRecording, AcceptsKnownCameraUnderAnyName) {
  const TemporaryFolder folder;
  std::string depth, rgb;
  for (int i = 0; i < 3; ++i) {
    fs::create_directories(folder / "depth");
    cv::imwrite((folder / fmt::format("depth/{}.png", i)).string(), cv::Mat(480, 640, CV_16U, cv::Scalar(5000 + i)));
    depth += fmt::format("0.{} depth/{}.png\n", i, i);
    rgb += fmt::format("0.{} rgb/{}.png\n", i, i);
  }
  write_text(folder / "depth.txt", depth);
  write_text(folder / "rgb.txt", rgb);
  const std::string error = refusal(folder.path());
  EXPECT_TRUE(has(error, "write its intrinsics into " + (folder / "camera.yaml").string())) << error;
  EXPECT_TRUE(has(error, "--camera FILE or NAME (freiburg1")) << error;
  for (const char* name : {"freiburg1", "freiburg2", "freiburg3"}) {
    const auto source = open_source(folder.path().string(), {.camera = name});
    EXPECT_EQ(source->rig(), Rig(known_camera(name)->camera));
    EXPECT_FLOAT_EQ(source->next()->depth[0], 1.0f);
  }
  for (int i = 0; i < 3; ++i)
    cv::imwrite((folder / fmt::format("depth/{}.png", i)).string(), cv::Mat(240, 320, CV_16U, cv::Scalar(5000 + i)));
  EXPECT_EQ(open_source(folder.path().string(), {.camera = "kinect-v1"})->rig(),
            Rig(Camera{320, 240, 262.5, 262.5, 159.5, 119.5, {}}));
  for (int i = 0; i < 3; ++i)
    cv::imwrite((folder / fmt::format("depth/{}.png", i)).string(), cv::Mat(480, 640, CV_16U, cv::Scalar(5000 + i)));
  write_text(folder / "mine.yaml", "{fx: 500, fy: 500, cx: 320, cy: 240, depth_scale: 1000}");
  EXPECT_FLOAT_EQ(open_source(folder.path().string(), {.camera = folder / "mine.yaml"})->next()->depth[0], 5.0f);
  write_text(folder / "intrinsics.txt", "500 500 320 240");
  EXPECT_EQ(open_source(folder.path().string())->rig(), Rig(Camera{640, 480, 500, 500, 320, 240, {}}));
}

TEST(KnownCameras, AreValid) {
  for (const KnownCamera& known : known_cameras()) {
    check(known.camera);
    EXPECT_EQ(known_camera(known.name), &known);
    EXPECT_FALSE(known.of.empty());
  }
  EXPECT_EQ(known_camera("nothing"), nullptr);
}

}  // namespace
}  // namespace cairn
