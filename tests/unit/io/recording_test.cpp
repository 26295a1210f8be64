// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/recording.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "cairn/io/recorder.hpp"
#include "cairn/io/source.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using namespace std::string_literals;

void write_depth(const fs::path& file, int value, int type = CV_16U, int width = 64, int height = 48) {
  cv::imwrite(file.string(), cv::Mat(height, width, type, cv::Scalar(value)));
}
void write_color(const fs::path& file, int width = 64, int height = 48) {
  cv::imwrite(file.string(), cv::Mat(height, width, CV_8UC3, cv::Scalar(10, 20, 30)));
}

/// TUM recording of four frames at 0, 0.1, 0.2 and 0.3 s, 1 m deep.
struct Tum {
  TemporaryFolder folder;
  Tum() {
    fs::create_directories(folder / "rgb");
    fs::create_directories(folder / "depth");
    write_text(folder / "camera.yaml",
               "{width: 64, height: 48, fx: 50, fy: 50, cx: 31.5, cy: 23.5, depth_scale: 5000}");
    std::string rgb = "# color\n", depth = "# depth\n";
    for (int i = 0; i < 4; ++i) {
      const std::string name = std::to_string(i);
      write_depth(folder / ("depth/" + name + ".png"), 5000);
      write_color(folder / ("rgb/" + name + ".png"));
      depth += "0." + name + " depth/" + name + ".png\n";
      rgb += "0." + name + "05 rgb/" + name + ".png\n";
    }
    write_text(folder / "rgb.txt", rgb);
    write_text(folder / "depth.txt", depth);
  }
  [[nodiscard]] std::vector<Frame> read(const FrameRange& range = {}) const {
    const auto source = open_recording(folder.path(), {.range = range});
    std::vector<Frame> frames;
    while (auto frame = source->next()) frames.push_back(std::move(*frame));
    return frames;
  }
};

TEST(TumRecording, PassesEachAccelerometerSampleOn) {
  const Tum tum;
  std::string samples;
  for (int i = 0; i < 40; ++i) samples += fmt::format("{:.4f} {} 9.81 3\n", 0.0025 + 0.01 * i, i);
  write_text(tum.folder / "accelerometer.txt", samples);
  const auto frames = tum.read();
  ASSERT_EQ(frames[1].accelerations.size(), 10u);
  EXPECT_DOUBLE_EQ(frames[1].accelerations[0].timestamp, 0.0025);
  EXPECT_EQ(frames[2].accelerations[3].value, Eigen::Vector3d(-13, -9.81, 3));
  // Means at the times of the images, as written for frames without samples.
  write_text(tum.folder / "accelerometer.txt", "0 0 9.81 0\n0.1 0 9.81 0\n0.2 0 9.81 0\n0.3 0 9.81 0\n");
  for (const Frame& frame : tum.read()) {
    EXPECT_TRUE(frame.accelerations.empty());
    EXPECT_TRUE(frame.acceleration);
  }
}

TEST(TumRecording, KeepsAccelerometerSamplesOfSkippedFrames) {
  const Tum tum;
  std::string samples;
  for (int i = 0; i < 40; ++i) samples += fmt::format("{:.4f} 0 9.81 0\n", 0.0025 + 0.01 * i);
  write_text(tum.folder / "accelerometer.txt", samples);
  EXPECT_EQ(tum.read({.step = 2}).at(1).accelerations.size(), 20u);
}

TEST(TumRecording, ReadsRecordedAccelerometerSamples) {
  const TemporaryFolder folder;
  const Camera camera{64, 48, 50, 50, 31.5, 23.5, {}};
  const std::vector<float> depth(64 * 48, 1.0f);
  Recorder recorder(folder / "recording", camera);
  for (int i = 0; i < 4; ++i) {
    Frame frame{.index = i, .timestamp = 0.1 * i, .depth = depth};
    frame.color.assign(64 * 48, 0xff102030u);
    frame.acceleration = Eigen::Vector3d(1, -9.81, 2);
    for (int k = 1; k <= 5; ++k)
      frame.accelerations.push_back({0.1 * i - 0.1 + 0.02 * k - 0.003, Eigen::Vector3d(k, -9.81, 2)});
    recorder.add(encode(frame, camera));
  }
  const auto source = open_recording(folder / "recording", {});
  ASSERT_EQ(source->next()->accelerations.size(), 5u);
  const auto frame = source->next();
  ASSERT_EQ(frame->accelerations.size(), 5u);
  EXPECT_NEAR(frame->accelerations[1].timestamp, 0.037, 1e-9);
  EXPECT_EQ(frame->accelerations[1].value, Eigen::Vector3d(2, -9.81, 2));
  EXPECT_TRUE(frame->acceleration);
}

TEST(TumRecording, ReadsDepthInMetersAndColor) {
  const auto frames = Tum().read();
  ASSERT_EQ(frames.size(), 4u);
  EXPECT_FLOAT_EQ(frames[1].depth[100], 1.0f);
  EXPECT_EQ(frames[1].color[100], 0xff0a141eu);  // R 30, G 20, B 10
  EXPECT_DOUBLE_EQ(frames[3].timestamp, 0.3);
}

TEST(TumRecording, SkipsColorIfOnlyDepthIsRequested) {
  const Tum tum;
  const auto source = open_recording(tum.folder.path(), {.find_color_camera = false, .depth_only = true});
  fs::remove_all(tum.folder / "rgb");
  int frames = 0;
  for (; const auto frame = source->next(); ++frames) {
    EXPECT_FLOAT_EQ(frame->depth[100], 1.0f);
    EXPECT_TRUE(frame->color.empty());
    EXPECT_FALSE(frame->problem);
  }
  EXPECT_EQ(frames, 4);
}

TEST(TumRecording, PairsNearestTimestampsOneToOne) {
  Tum tum;
  write_text(tum.folder / "rgb.txt", "0.012 rgb/0.png\n0.101 rgb/1.png\n0.25 rgb/2.png\n");
  const auto frames = tum.read();
  EXPECT_FALSE(frames[0].color.empty());  // 12 ms off
  EXPECT_FALSE(frames[1].color.empty());
  EXPECT_TRUE(frames[2].color.empty());  // 50 ms off
  EXPECT_FALSE(frames[2].problem);
}

TEST(TumRecording, SortsListsByTime) {
  Tum tum;
  std::string moved_depth, moved_color;
  for (const char* i : {"3", "1", "0", "2"}) {
    moved_depth += fmt::format("0.{0} depth/{0}.png\n", i);
    moved_color += fmt::format("0.{0}05 rgb/{0}.png\n", i);
    write_depth(tum.folder / fmt::format("depth/{}.png", i), 5000 + 50 * (*i - '0'));
  }
  write_text(tum.folder / "depth.txt", moved_depth);
  write_text(tum.folder / "rgb.txt", moved_color);
  write_text(tum.folder / "groundtruth.txt", "0.3 3 0 0 0 0 0 1\n0.1 1 0 0 0 0 0 1\n0.2 2 0 0 0 0 0 1\n");
  const auto frames = tum.read();
  ASSERT_EQ(frames.size(), 4u);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    ASSERT_FALSE(frames[i].problem) << *frames[i].problem;
    EXPECT_DOUBLE_EQ(frames[i].timestamp, 0.1 * static_cast<double>(i));
    EXPECT_FLOAT_EQ(frames[i].depth[100], 1 + 0.01f * static_cast<float>(i));
    EXPECT_NEAR(frames[i].color_delay, 0.005, 1e-9);
  }
  EXPECT_DOUBLE_EQ(recorded_truth(tum.folder.path())[0].timestamp, 0.1);
}

TEST(TumRecording, ReadsOnlyRequestedFrames) {
  const auto frames = Tum().read({.begin = 1, .end = 4, .step = 2});
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(frames[0].index, 1);
  EXPECT_EQ(frames[1].index, 3);
}

TEST(TumRecording, ReportsBadFrameAndContinues) {
  struct Case {
    const char* name;
    void (*damage)(const fs::path& file);
    const char* message;
  };
  const Case cases[] = {
      {"truncated", [](const fs::path& f) { fs::resize_file(f, fs::file_size(f) - 20); }, "cut off"},
      {"empty file", [](const fs::path& f) { fs::resize_file(f, 0); }, "is empty"},
      {"missing", [](const fs::path& f) { fs::remove(f); }, "cannot be read"},
      {"8 bit", [](const fs::path& f) { write_depth(f, 50, CV_8U); }, "one channel of 8 bits; depth must be a 16-bit"},
      {"colors", [](const fs::path& f) { write_color(f); }, "3 channels of 8 bits; depth must be a 16-bit"},
      {"other size", [](const fs::path& f) { write_depth(f, 5000, CV_16U, 32, 24); }, "32x24"},
      {"all zero", [](const fs::path& f) { write_depth(f, 0); }, "no measurement"},
      // 65536 x 65536 pixels of 16 bits, declared by a file of some hundred bytes.
      {"too large", [](const fs::path& f) { write_text(f, read_bytes(f).replace(16, 8, "\0\1\0\0\0\1\0\0"s)); },
       "is 65536x65536, the camera 64x48"},
      {"TIFF", [](const fs::path& f) { write_text(f, "II*\0\0\0\0\0"s); }, "not a readable TIFF"},
      // OpenCV would use its DICOM decoder, which aborts on many inputs.
      {"DICOM that begins like a PNG",
       [](const fs::path& f) { write_text(f, std::string("\x89PNG").append(124, '\0').append("DICM IEND")); },
       "neither PNG nor JPEG"},
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(c.name);
    Tum tum;
    c.damage(tum.folder / "depth/2.png");
    const auto frames = tum.read();
    ASSERT_EQ(frames.size(), 4u);
    EXPECT_NE(frames[2].problem->find(c.message), std::string::npos) << *frames[2].problem;
    EXPECT_NE(frames[2].problem->find("2.png"), std::string::npos);
    EXPECT_TRUE(frames[2].depth.empty());
    EXPECT_FALSE(frames[3].problem);
  }
}

TEST(TumRecording, SkipsFrameWithInvalidFileName) {
  Tum tum;
  const std::string too_long = "depth/" + std::string(300, 'x') + ".png";
  write_text(tum.folder / "depth.txt", "0.0 depth/0.png\n0.1 " + too_long + "\n0.2 depth/2.png\n0.3 depth/3.png\n");
  const auto frames = tum.read();
  ASSERT_EQ(frames.size(), 4u);
  ASSERT_TRUE(frames[1].problem);
  EXPECT_NE(frames[1].problem->find("xxx.png: cannot be read"), std::string::npos) << *frames[1].problem;
  EXPECT_FALSE(frames[2].problem);
}

TEST(TumRecording, SkipsSecondImageOfSameTime) {
  Tum tum;
  write_text(tum.folder / "depth.txt", "0.0 depth/0.png\n0.1 depth/1.png\n0.1 depth/2.png\n0.3 depth/3.png\n");
  const auto frames = tum.read();
  EXPECT_NE(frames[2].problem->find("timestamp"), std::string::npos);
  EXPECT_FALSE(frames[3].problem);
}

TEST(TumRecording, KeepsFrameWithBadColor) {
  Tum tum;
  write_text(tum.folder / "rgb/1.png", "not an image");
  const auto frames = tum.read();
  EXPECT_FALSE(frames[1].problem);
  EXPECT_TRUE(frames[1].color.empty());
}

TEST(OpenRecording, RejectsOtherFoldersWithReason) {
  const TemporaryFolder empty;
  EXPECT_NE(error_of([&] { (void)open_recording(empty / "nowhere"); }).find("no such folder"), std::string::npos);
  EXPECT_NE(error_of([&] { (void)open_recording(empty.path()); }).find("rgb.txt"), std::string::npos);
  {
    Tum tum;
    fs::remove(tum.folder / "depth.txt");
    EXPECT_NE(error_of([&] { (void)tum.read(); }).find("has rgb.txt but no depth.txt"), std::string::npos);
  }
  {
    Tum tum;
    write_text(tum.folder / "depth.txt", "0.1 depth/0.png\nnonsense depth/1.png\n");
    EXPECT_NE(error_of([&] { (void)tum.read(); }).find("depth.txt:2"), std::string::npos);
  }
  {
    Tum tum;
    fs::remove(tum.folder / "camera.yaml");
    EXPECT_NE(error_of([&] { (void)open_recording(tum.folder.path()); }).find("write its intrinsics into"),
              std::string::npos);
  }
}

TEST(SevenScenes, FindsColorCamera) {
  CAIRN_REQUIRE_DATA("7scenes_redkitchen_600");
  const Rig rig = open_source((data_folder() / "7scenes_redkitchen_600").string())->rig();
  ASSERT_TRUE(rig.color);
  // A Kinect's lenses are 2.5 cm apart; the focal length of its color camera is 525 pixels in ROS' calibrations.
  EXPECT_NEAR(rig.color->camera.fx, 525, 5);
  EXPECT_NEAR(rig.color->color_from_depth.translation().x(), -0.025, 0.003);
  EXPECT_LT(rig.color->color_from_depth.translation().tail<2>().norm(), 0.006);
  EXPECT_EQ(rig.depth.readout, 0.03055);  // a Kinect's
  EXPECT_EQ(rig.color->camera.readout, 0.02611);
}

TEST(SevenScenes, Ignores0And65535AndUses30Hz) {
  const TemporaryFolder folder;
  for (int i = 0; i < 2; ++i) {
    cv::Mat depth(480, 640, CV_16U, cv::Scalar(2000));
    depth.at<std::uint16_t>(0, 0) = 65535;
    cv::imwrite((folder / ("frame-00000" + std::to_string(i) + ".depth.png")).string(), depth);
    write_text(folder / ("frame-00000" + std::to_string(i) + ".pose.txt"), "1 0 0 0.5\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
  }
  const auto source = open_recording(folder.path());
  (void)source->next();
  const auto frame = source->next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->depth[0], 0.0f);
  EXPECT_FLOAT_EQ(frame->depth[1], 2.0f);
  EXPECT_NEAR(frame->timestamp, 1.0 / 30, 1e-12);
  EXPECT_DOUBLE_EQ(recorded_truth(folder.path())[1].world_from_camera.translation().x(), 0.5);
}

TEST(IclNuim, UndoesMirroredCamera) {
  CAIRN_REQUIRE_DATA("icl_office_kt0_101");
  const auto folder = data_folder() / "icl_office_kt0_101";
  EXPECT_GT(open_recording(folder)->rig().depth.fy, 0);
  const auto truth = recorded_truth(folder);
  EXPECT_DOUBLE_EQ(truth[0].timestamp, 2.0);
  EXPECT_NEAR(truth[0].world_from_camera.translation().y(), -0.00897074, 1e-9);
}

TEST(IntrinsicsFolder, ReadsDepthWithoutColor) {
  const TemporaryFolder folder;
  fs::create_directories(folder / "depth");
  write_text(folder / "intrinsics.json",
             R"({"width":64,"height":48,"fx":50,"fy":50,"cx":32,"cy":24,"depth_scale":1000})");
  write_depth(folder / "depth/a.png", 1500);
  const auto frame = open_recording(folder.path())->next();
  ASSERT_TRUE(frame);
  EXPECT_FLOAT_EQ(frame->depth[0], 1.5f);
  EXPECT_TRUE(frame->color.empty());
  write_text(folder / "intrinsics.json", R"({"width":64})");
  EXPECT_NE(error_of([&] { (void)open_recording(folder.path()); }).find("intrinsics.json"), std::string::npos);
}

TEST(ReadAhead, KeepsOrderAndForwardsErrors) {
  Tum tum;
  const auto ahead = read_ahead(open_recording(tum.folder.path()), 2);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(ahead->next()->index, i);
  EXPECT_FALSE(ahead->next());

  struct Broken final : Source {
    Rig rig_;
    const Rig& rig() const override { return rig_; }
    std::optional<int> size() const override { return {}; }
    std::optional<Frame> next() override { throw std::runtime_error("unplugged"); }
  };
  EXPECT_EQ(error_of([] { (void)read_ahead(std::make_unique<Broken>())->next(); }), "unplugged");
}

TEST(WithPoses, InterpolatesExceptInGaps) {
  Tum tum;
  Trajectory poses{{0.05, Eigen::Isometry3d::Identity()}, {0.15, Eigen::Isometry3d(Eigen::Translation3d(1, 0, 0))}};
  const auto source = with_poses(open_recording(tum.folder.path()), poses);
  EXPECT_FALSE(source->next()->world_from_camera);
  const auto frame = source->next();
  ASSERT_TRUE(frame->world_from_camera);
  EXPECT_NEAR(frame->world_from_camera->translation().x(), 0.5, 1e-12);
}

}  // namespace
}  // namespace cairn
