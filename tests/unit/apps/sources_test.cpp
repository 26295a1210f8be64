// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Sources other than folders: OpenNI2 files, color from a separate camera, live playback.
#include <gtest/gtest.h>

#include <chrono>
#include <cstring>
#include <map>
#include <thread>

#include "cairn/io/live_source.hpp"
#include "cairn/io/recorder.hpp"
#include "cairn/io/source.hpp"
#include "io/camera_file.hpp"
#include "io/intrinsics.hpp"
#include "io/recording.hpp"
#include "io/sensors/openni.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

using namespace std::chrono_literals;

/// Source of small frames, on demand or one per `period`.
class Ticks final : public Source {
 public:
  Ticks(int count, std::chrono::milliseconds period, bool can_skip = false)
      : count_(count), period_(period), can_skip_(can_skip) {}
  [[nodiscard]] int read() const { return read_; }
  std::optional<double> next_timestamp() const override {
    return can_skip_ && next_ < count_ ? std::optional(0.02 * next_) : std::nullopt;
  }
  void skip() override { ++next_; }
  const Rig& rig() const override { return rig_; }
  std::optional<int> size() const override { return count_ - next_; }
  std::optional<Frame> next() override {
    if (next_ == count_) return std::nullopt;
    ++read_;
    std::this_thread::sleep_for(period_);
    return Frame{.index = next_, .timestamp = 0.02 * next_++, .depth = {1, 2, 3, 4, 5, 6}, .color = {}};
  }

 private:
  Rig rig_ = Camera{.width = 3, .height = 2};
  int count_, next_ = 0, read_ = 0;
  std::chrono::milliseconds period_;
  bool can_skip_;
};

double seconds_of(const std::function<void()>& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

TEST(OpenNi, ReadsAnOldKinectRecordingToItsEnd) {
  CAIRN_REQUIRE_DATA("oni/kinect_3DJ_12frames.oni");
  const auto source = open_openni(data_folder() / "oni/kinect_3DJ_12frames.oni");
  EXPECT_NEAR(source->rig().depth.fx, 320 / std::tan(1.0145 / 2), 0.1);
  EXPECT_EQ(source->size(), 12);
  double last = -1;
  for (int i = 0; i < 12; ++i) {
    const auto frame = source->next();
    ASSERT_TRUE(frame);
    EXPECT_FALSE(frame->problem);
    EXPECT_EQ(frame->index, i);
    EXPECT_GT(frame->timestamp, last);
    last = frame->timestamp;
    EXPECT_EQ(frame->color.size(), frame->depth.size());
    EXPECT_LT(std::abs(frame->color_delay), 0.017);
    const auto seen =
        std::count_if(frame->depth.begin(), frame->depth.end(), [](float z) { return z > 0.4f && z < 10; });
    EXPECT_GT(seen, 100000);
  }
  EXPECT_FALSE(source->next());
  EXPECT_FALSE(source->ended_early());
}

TEST(OpenNi, ReportsMissingAndDamagedFiles) {
  const TemporaryFolder folder;
  EXPECT_NE(error_of([&] { (void)open_openni((folder / "none.oni").string()); }).find("there is no such file"),
            std::string::npos);
  for (const char* name : {"text.oni", "TEXT.ONI"}) {
    write_text(folder / name, "this is not a recording");
    EXPECT_NE(error_of([&] {
                (void)open_source((folder / name).string());
              }).find("cut off or not a readable OpenNI recording"),
              std::string::npos);
  }
  CAIRN_REQUIRE_DATA("oni/kinect_3DJ_12frames.oni");
  write_text(folder / "cut.oni", read_bytes(data_folder() / "oni/kinect_3DJ_12frames.oni").substr(0, 700000));
  EXPECT_NE(error_of([&] { (void)open_openni((folder / "cut.oni").string()); }).find("cut off"), std::string::npos);
}

TEST(OpenNi, ChecksSizesBeforeOpenNiReadsTheFile) {
  CAIRN_REQUIRE_DATA("oni/kinect_3DJ_12frames.oni");
  const std::string good = read_bytes(data_folder() / "oni/kinect_3DJ_12frames.oni");
  const TemporaryFolder folder;
  const auto error = [&](std::size_t at, std::uint32_t value) {
    std::string bad = good;
    std::memcpy(&bad[at], &value, sizeof value);
    write_text(folder / "a.oni", bad);
    const std::string all = error_of([&] { (void)open_openni((folder / "a.oni").string()); });
    return all.substr(std::min(all.size(), all.find("at byte")));
  };
  // The second record is a property at byte 100: magic, kind, node, sizes of fields and payload, undo; the name.
  EXPECT_EQ(error(100, 7), "at byte 100, no record starts here");
  EXPECT_EQ(error(104, 99), "at byte 100, a record has the unknown kind 99");
  EXPECT_EQ(error(112, 3), "at byte 100, a record has an impossible size");
  EXPECT_EQ(error(116, 0xffffffff), "at byte 100, a record has an impossible size");
  EXPECT_EQ(error(128, 0x7fffffff), "at byte 100, a name is not terminated");
  const std::size_t mode = good.find("xnMapOutputMode") + 20;
  EXPECT_NE(error(mode, 1u << 30).find("an image has 1073741824 pixels per side, allowed: 16 to 4096"),
            std::string::npos);
}

TEST(OpenNi, RefusesACameraFileOfAnotherSize) {
  CAIRN_REQUIRE_DATA("oni/kinect_3DJ_12frames.oni");
  const TemporaryFolder folder;
  write_text(folder / "camera.yaml", "width: 320\nheight: 240\nfx: 300\nfy: 300\ncx: 160\ncy: 120\n");
  const auto open = [&] {
    (void)open_openni(data_folder() / "oni/kinect_3DJ_12frames.oni", {.camera = folder / "camera.yaml", .copy_to = {}});
  };
  EXPECT_NE(error_of(open).find("is for 320x240 pixels"), std::string::npos);
}

TEST(CameraFile, ErrorsNameFileAndLine) {
  const TemporaryFolder folder;
  const auto error = [&](const std::string& text) {
    write_text(folder / "camera.yaml", text);
    return error_of([&] { (void)read_camera_file(folder / "camera.yaml"); });
  };
  EXPECT_NE(error("fx: 500\nfy: 500\ncx: 320\n").find("`cy` is missing"), std::string::npos);
  EXPECT_NE(error("fx: 500\nfy: five\ncx: 320\ncy: 240\n").find("camera.yaml:2"), std::string::npos);
  EXPECT_NE(
      error("fx: 50\nfy: 50\ncx: 3\ncy: 2\ncolor: {fx: 50, fy: 50, cx: 3, cy: 2, translation: [0, 0, 0], rotation: "
            "[0, 0, 0, 2]}\n")
          .find("unit quaternion"),
      std::string::npos);
  EXPECT_NE(error("fx: 500\nfy: 500\ncx: 320\ncy: 240\nwidth: 640.5\n").find("camera.yaml:5: `width` takes an integer"),
            std::string::npos);
  EXPECT_NE(error("- 1\n- 2\n").find("camera.yaml: expected lines such as"), std::string::npos);
  EXPECT_NE(error(std::string(100000, '{')).find("camera.yaml:1: "), std::string::npos);
}

TEST(CameraFile, AcceptsKeysOfVersion01) {
  const TemporaryFolder folder;
  const auto rig = [&](const std::string& color, const std::string& min_confidence) {
    write_text(folder / "camera.yaml",
               "width: 640\nheight: 480\nfx: 525\nfy: 525\ncx: 320\ncy: 240\nsensor: {model: phone_lidar, " +
                   min_confidence + ": 77}\n" + color +
                   ": {width: 320, height: 240, fx: 260, fy: 260, cx: 160, cy: 120, translation: [0.1, 0, 0], "
                   "rotation: [0, 0, 0, 1]}\n");
    return read_camera_file(folder / "camera.yaml").rig;
  };
  const Rig old = rig("colour", "least_confidence");
  ASSERT_TRUE(old.color);
  EXPECT_EQ(old.color->camera.fx, 260);
  EXPECT_EQ(old.color->color_from_depth.translation().x(), 0.1);
  EXPECT_EQ(old.sensor.min_confidence, 77);
  EXPECT_EQ(old, rig("color", "min_confidence"));
}

TEST(CameraFile, RefusesImplausibleValues) {
  const TemporaryFolder folder;
  const auto error = [&](const std::string& changed, const std::string& value) {
    std::string text, json;
    for (const auto& [key, default_value] : std::map<std::string, std::string>{{"width", "640"},
                                                                               {"height", "480"},
                                                                               {"fx", "525"},
                                                                               {"fy", "525"},
                                                                               {"cx", "320"},
                                                                               {"cy", "240"},
                                                                               {"distortion", "[0, 0, 0, 0, 0]"},
                                                                               {"depth_scale", "1000"}}) {
      const std::string& now = key == changed ? value : default_value;
      text += key + ": " + now + "\n";
      json += (json.empty() ? "{\"" : ", \"") + key + "\": " + now;
    }
    write_text(folder / "camera.yaml", text);
    write_text(folder / "intrinsics.json", json + "}");
    // Both files report the same error in the same words.
    const std::string yaml = error_of([&] { (void)read_camera_file(folder / "camera.yaml"); });
    std::filesystem::remove(folder / "camera.yaml");  // camera.yaml would have precedence
    const std::string json_error = error_of([&] { (void)read_intrinsics(folder / "intrinsics.json"); });
    const auto after = [](const std::string& all, const std::string& name) {
      const auto at = all.find(name);
      return at == all.npos ? "no file named: " + all : all.substr(at + name.size());
    };
    EXPECT_TRUE(after(json_error, "intrinsics.json").starts_with(after(yaml, "camera.yaml"))) << json_error << '\n'
                                                                                              << yaml;
    return after(yaml, "camera.yaml");
  };
  EXPECT_EQ(error("cx", "-5000"), ": the camera's cx is -5000, allowed: -640 to 1280; check the intrinsics");
  EXPECT_EQ(error("fx", "-1"), ": the camera's fx is -1, allowed: 32 to 12800; check the intrinsics");
  EXPECT_EQ(error("fy", "0"), ": the camera's fy is 0, allowed: 32 to 12800; check the intrinsics");
  EXPECT_EQ(error("width", "0"), ": the camera's width is 0, allowed: 16 to 4096; check the intrinsics");
  EXPECT_EQ(error("height", "100000"), ": the camera's height is 100000, allowed: 16 to 4096; check the intrinsics");
  EXPECT_EQ(error("distortion", "[0, 1e9, 0, 0, 0]"),
            ": the camera's distortion is 1000000000, allowed: -1000 to 1000; check the intrinsics");
  EXPECT_EQ(error("depth_scale", "0"), ": depth_scale is 0, allowed: 1 to 1000000 units per meter");
}

TEST(IntrinsicsFolder, ErrorsNameTheKey) {
  const TemporaryFolder folder;
  const auto error = [&](const std::string& text) {
    write_text(folder / "intrinsics.json", text);
    const std::string all = error_of([&] { (void)read_intrinsics(folder / "intrinsics.json"); });
    return all.substr(all.find(".json") + 5, all.find(';') - all.find(".json") - 5);
  };
  const std::string valid_keys = R"("width": 64, "height": 48, "fx": 60, "fy": 60, "cx": 32)";
  EXPECT_EQ(error("{"), ": is not JSON");
  EXPECT_EQ(error("[]"), ": is not a JSON object");
  EXPECT_EQ(error("{" + valid_keys + "}"), ": `cy` is missing");
  EXPECT_EQ(error("{" + valid_keys + R"(, "cy": "24"})"), ": `cy` is not a number");
  EXPECT_EQ(error(R"({"width": 1e300})"), ": `width` is not a number of pixels");
  EXPECT_EQ(error("{" + valid_keys + R"(, "cy": 24, "distortion": [1]})"),
            ": `distortion` takes [k1, k2, p1, p2, k3], optionally followed by k4, k5, k6");
  EXPECT_EQ(error("{" + valid_keys + R"(, "cy": 24, "frame_rate": 0})"),
            ": `frame_rate` is 0, allowed: 0.001 to 100000 Hz");
}

TEST(LiveSource, DropsFramesForASlowReaderWithoutLag) {
  LiveSource source(std::make_unique<Ticks>(60, 10ms), Pace::as_it_comes);
  int received = 0, last = -1;
  while (const auto frame = source.next()) {
    EXPECT_GT(frame->index, last);
    last = frame->index;
    ++received;
    EXPECT_LT(LiveSource::Clock::now() - source.arrived(), 60ms);  // at most waited for the reader
    std::this_thread::sleep_for(35ms);
  }
  EXPECT_EQ(last, 59);
  EXPECT_LT(received, 30);
  EXPECT_EQ(source.dropped(), 60 - received);
}

TEST(LiveSource, DistinguishesTheEndFromATimeout) {
  LiveSource source(std::make_unique<Ticks>(1, 100ms), Pace::as_it_comes);
  EXPECT_FALSE(source.next_within(10ms));
  EXPECT_FALSE(source.ended());
  EXPECT_TRUE(source.next());
  EXPECT_FALSE(source.next());
  EXPECT_TRUE(source.ended());
}

TEST(LiveSource, PlaysARecordingAtRecordedSpeed) {
  LiveSource source(std::make_unique<Ticks>(21, 0ms), Pace::as_recorded);
  int frames = 0;
  EXPECT_NEAR(seconds_of([&] {
                while (source.next()) ++frames;
              }),
              0.4, 0.1);
  EXPECT_EQ(frames + source.dropped(), 21);
  EXPECT_GE(frames, 18);
}

TEST(LiveSource, SkipsFramesWithoutReadingForASlowReader) {
  for (const bool can_skip : {true, false}) {
    auto ticks = std::make_unique<Ticks>(60, 2ms, can_skip);
    const Ticks& played = *ticks;
    LiveSource source(std::move(ticks), Pace::as_recorded);
    int received = 0, last = -1;
    while (const auto frame = source.next()) {
      last = frame->index;
      ++received;
      EXPECT_LT(LiveSource::Clock::now() - source.arrived(), 120ms);
      std::this_thread::sleep_for(70ms);  // three and a half frames
    }
    EXPECT_GE(last, 56);
    EXPECT_LT(received, 25);
    EXPECT_EQ(received + source.dropped(), 60);
    EXPECT_EQ(played.read(), can_skip ? received : 60);
  }
}

TEST(LiveSource, WaitsForASlowReaderOfEveryFrame) {
  LiveSource source(std::make_unique<Ticks>(20, 0ms), Pace::every_frame);  // timestamps every 20 ms
  EXPECT_EQ(source.size(), Ticks(20, 0ms).size());
  std::vector<LiveSource::Clock::time_point> due;
  int last = -1;
  while (const auto frame = source.next()) {
    EXPECT_EQ(frame->index, ++last);
    EXPECT_GE(LiveSource::Clock::now(), source.arrived());
    due.push_back(source.arrived());
    if (last < 8) std::this_thread::sleep_for(60ms);
  }
  EXPECT_EQ(last, 19);
  EXPECT_EQ(source.dropped(), 0);
  // No faster than recorded, also after a delay: no catching up.
  for (std::size_t i = 1; i < due.size(); ++i) EXPECT_GE(due[i] - due[i - 1], 19ms) << i;
  EXPECT_GE(due[8] - due[0], 400ms);
}

TEST(LiveSource, SlowsDownIfReadingTakesLonger) {
  LiveSource source(std::make_unique<Ticks>(12, 50ms), Pace::as_recorded);  // timestamps every 20 ms
  int frames = 0;
  while (source.next()) ++frames;
  EXPECT_GE(frames, 9);
}

TEST(LiveSource, PauseStopsTheTimeOfARecording) {
  for (const bool can_skip : {true, false}) {
    LiveSource source(std::make_unique<Ticks>(40, 1ms, can_skip), Pace::as_recorded);  // timestamps every 20 ms
    std::vector<int> received;
    const auto receive = [&](std::size_t count) {
      while (received.size() < count)
        if (const auto frame = source.next()) received.push_back(frame->index);
    };
    receive(10);
    source.pause(true);
    const int dropped = source.dropped();
    std::this_thread::sleep_for(300ms);  // fifteen frames
    EXPECT_EQ(source.dropped(), dropped);
    EXPECT_FALSE(source.ended());
    const double left = seconds_of([&] {
      source.pause(false);
      receive(11);
      EXPECT_LE(received[10], received[9] + 2) << "it went on elsewhere";
      EXPECT_LT(LiveSource::Clock::now() - source.arrived(), 60ms) << "a pause is no delay";
      while (const auto frame = source.next()) received.push_back(frame->index);
    });
    EXPECT_NEAR(left, 0.02 * (39 - received[9]), 0.1) << "the rest plays as fast as it was taken";
    EXPECT_EQ(static_cast<int>(received.size()) + source.dropped(), 40);
    EXPECT_LE(source.dropped(), 4) << "the pause counts for nothing";
  }
}

TEST(LiveSource, CanPauseBeforeTheFirstFrameAndEndWhilePaused) {
  LiveSource source(std::make_unique<Ticks>(5, 0ms), Pace::as_recorded);
  source.pause(true);
  source.pause(true);
  (void)source.next_within(50ms);  // drains a frame from before the pause
  std::this_thread::sleep_for(200ms);
  EXPECT_LE(source.dropped(), 0);
  EXPECT_FALSE(source.ended());
}

TEST(LiveSource, SensorContinuesDuringAPause) {
  LiveSource source(std::make_unique<Ticks>(20, 10ms), Pace::as_it_comes);
  source.pause(true);
  int last = -1;
  while (const auto frame = source.next()) last = frame->index;
  EXPECT_EQ(last, 19);
}

TEST(Recorder, PreservesDepthAndTimestamps) {
  const TemporaryFolder folder;
  const Camera camera{.width = 16, .height = 16, .fx = 4, .fy = 5, .cx = 8, .cy = 8};
  const std::vector<std::uint32_t> color(256, 0xff102030u);
  std::vector<float> depth{0, 0.001f, 1.2346f, 5.0f, 13.1f, 20.0f};
  depth.resize(256, 2.0f);
  {
    Recorder writer(folder / "a", camera);
    writer.add(encode({.timestamp = 1.5, .depth = depth, .color_delay = 0.004, .color = color}, camera, true));
  }
  const auto source = open_recording(folder / "a");
  EXPECT_EQ(source->rig().depth.fy, 5);
  const auto frame = source->next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->timestamp, 1.5);
  EXPECT_NEAR(frame->color_delay, 0.004, 1e-9);
  EXPECT_EQ(frame->color, color);
  depth[5] = 0;  // not representable in the file
  for (std::size_t i = 0; i < depth.size(); ++i) EXPECT_NEAR(frame->depth[i], depth[i], 1e-4);
  EXPECT_NE(error_of([&] { Recorder(folder / "a", camera); }).find("is not empty"), std::string::npos);
}

}  // namespace
}  // namespace cairn
