// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Typical failures of runs: the program's final message.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "cairn/mapping/trajectory.hpp"
#include "support/files.hpp"
#include "support/recordings.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

/// Small recordings, named relative to their folder.
class Ending : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder = new TemporaryFolder;
    write_small_recording(*folder / "rec", {.frames = 40, .speed = 2});
    setenv("CAIRN_VALIDATION", "0", 1);
  }
  static void TearDownTestSuite() {
    setenv("CAIRN_VALIDATION", "1", 1);
    delete folder;
  }
  static Ran run(std::vector<std::string> arguments, const std::string& environment = "") {
    if (arguments[0] == "reconstruct") arguments.insert(arguments.end(), {"--config", "rec.yaml", "--no-texture"});
    return run_cairn(arguments, "cd '" + folder->path().string() + "'; " + environment);
  }
  static std::string last_line(const std::string& text) {
    const auto end = text.find_last_not_of('\n');
    if (end == text.npos) return {};
    const auto begin = text.rfind('\n', end);
    return text.substr(begin == text.npos ? 0 : begin + 1, end - (begin == text.npos ? 0 : begin + 1) + 1);
  }
  /// Copy of the recording with another camera.yaml.
  static void copy_with_camera(const std::string& name, const std::string& camera) {
    fs::copy(*folder / "rec", *folder / name, fs::copy_options::recursive);
    write_text(*folder / name / "camera.yaml", camera);
  }
  static TemporaryFolder* folder;
};
TemporaryFolder* Ending::folder = nullptr;

TEST_F(Ending, OfAGoodRunSaysSoAndWhatIsNext) {
  const Ran ran = run({"reconstruct", "rec", "good"});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NE(ran.out.find("next: cairn view good\n"), std::string::npos) << ran.out;
  EXPECT_EQ(last_line(ran.out), "good: 40 of 40 frames are in the map");
  EXPECT_EQ(ran.err.find("sigma"), std::string::npos) << ran.err;
  const Ran info = run({"info", "good"});
  EXPECT_EQ(info.exit_code, 0) << info.err;
  EXPECT_EQ(last_line(info.out), "good: 40 of 40 frames are in the map");
  for (const char* told : {"mesh.glb", "session", "triangles, with the voxels' colors", "voxels          3.0 cm"})
    EXPECT_NE(info.out.find(told), std::string::npos) << told << info.out;
  const auto json = Json::parse(run({"info", "good", "--json"}).out);
  EXPECT_EQ(json["verdict"]["level"], "good");
  EXPECT_EQ(json["frames"]["fused"], 40);
  EXPECT_GT(json["extent_m"][0].get<double>(), 1);
  // The output for a recording is unchanged.
  EXPECT_NE(run({"info", "rec"}).out.find("depth camera"), std::string::npos);
  // Numbers only with --verbose.
  EXPECT_NE(run({"reconstruct", "rec", "numbers", "--frames", "0:12", "--verbose"}).err.find("inliers within"),
            std::string::npos);
}

TEST_F(Ending, OfAWrongDepthScaleAsksForIt) {
  for (const auto& [name, scale] : {std::pair{"mm", "5"}, {"um", "500000"}}) {
    copy_with_camera(name, std::string("{width: 160, height: 120, fx: 131.25, fy: 131.25, cx: 79.5, cy: 59.5, "
                                       "depth_scale: ") +
                               scale + "}");
    expect_last_line(run({"reconstruct", name, std::string("out-") + name}), 1, "is depth_scale right?");
  }
}

/// Box rotating before a wall, with a hash of gray tiles, seen by a static camera.
Frame turntable_frame(const Camera& camera, int index) {
  Frame frame{.index = index, .timestamp = index / 30.0};
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.07 * index, Eigen::Vector3d::UnitY()).toRotationMatrix();
  const Eigen::Vector3d center(0, 0, 0.8), half(0.14, 0.12, 0.08);
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector3d ray = camera.ray(x, y), from = turn * -center, along = turn * ray;
      double in = 0, out = 1e9, z = 1.4;
      for (int k = 0; k < 3; ++k) {
        const double a = (-half[k] - from[k]) / along[k], b = (half[k] - from[k]) / along[k];
        in = std::max(in, std::min(a, b)), out = std::min(out, std::max(a, b));
      }
      const bool is_box = in < out;
      if (is_box) z = in;
      const Eigen::Vector3d at = is_box ? Eigen::Vector3d(from + z * along) : Eigen::Vector3d(z * ray);
      const Eigen::Vector3i tile = (at / 0.04 + Eigen::Vector3d::Constant(0.01)).array().floor().cast<int>();
      const auto hash = static_cast<std::uint32_t>(tile.x() * 73856093 ^ tile.y() * 19349663 ^ tile.z() * 83492791);
      frame.depth.push_back(static_cast<float>(z + 0.0008 * std::sin(12.9 * x + 78.2 * y + 37.7 * index)));
      frame.color.push_back(0xff000000u | (60 + (hash >> 3) % 160) * 0x010101u);
    }
  return frame;
}

TEST_F(Ending, OfATurntableSaysThatTheCameraDidNotMove) {
  const Camera camera{160, 120, 131.25, 131.25, 79.5, 59.5, {}};
  {
    Recorder writer(*folder / "turntable", camera);
    for (int i = 0; i < 60; ++i) writer.add(encode(turntable_frame(camera, i), camera));
  }
  const Ran ran = run({"reconstruct", "turntable", "turned", "--voxel-size", "0.02"});
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  const auto report = Json::parse(read_bytes(*folder / "turned" / "report.json"));
  EXPECT_NE(report["verdict"]["level"], "good");
  EXPECT_NE(report["verdict"].dump().find("the camera did not move, "), std::string::npos) << report["verdict"];
  EXPECT_NE(ran.out.find("on a turntable, remove the background (surface.max_depth or a mask)"), std::string::npos)
      << ran.out;
  EXPECT_NE(run({"info", "turned"}).out.find("the camera did not move, "), std::string::npos);
}

TEST_F(Ending, OfAWrongFocalLengthSaysItAlsoWhereAllIsTracked) {
  ASSERT_EQ(run({"synth", "room", "-o", "turning", "--frames", "50", "--width", "320"}).exit_code, 0);
  write_text(*folder / "turning" / "camera.yaml", "{width: 320, height: 240, fx: 135, fy: 135, cx: 159.5, cy: 119.5}");
  const Ran ran = run({"reconstruct", "turning", "bent", "--frames", "0:50:2", "--json"});
  const auto report = Json::parse(read_bytes(*folder / "bent" / "report.json"));
  EXPECT_NE(report["verdict"]["level"], "good");
  EXPECT_NE(report["verdict"].dump().find("check the camera's intrinsics"), std::string::npos) << report["verdict"];
  EXPECT_NE(ran.err.find("check the camera's intrinsics"), std::string::npos) << ran.err;  // also with --json
}

TEST_F(Ending, OfARunThatLostMostHasItsExitCodeAndReason) {
  // A quarter of a second of the room, then a fast motion elsewhere.
  write_small_recording(*folder / "fast", {.frames = 40, .speed = 30});
  const Ran ran = run({"reconstruct", "fast", "lost"});
  ASSERT_EQ(ran.exit_code, 3) << ran.out << ran.err;
  EXPECT_NE(ran.out.find("\nBAD: "), std::string::npos) << ran.out;
  EXPECT_NE(ran.out.find("  - too fast: "), std::string::npos) << ran.out;
  EXPECT_EQ(ran.out.find("\ngood"), std::string::npos) << ran.out;
  const auto report = Json::parse(read_bytes(*folder / "lost" / "report.json"));
  EXPECT_EQ(report["verdict"]["level"], "bad");
  EXPECT_NE(report["warnings"].dump().find("too fast"), std::string::npos) << report["warnings"];
  // `cairn info` repeats the same.
  const Ran info = run({"info", "lost"});
  EXPECT_EQ(info.exit_code, 0) << info.err;
  EXPECT_NE(info.out.find(ran.out.substr(ran.out.find("BAD: "))), std::string::npos) << info.out;
  // The same frames with large gaps in time.
  const Ran few = run({"reconstruct", "rec", "few", "--frames", "0:40:20"});
  EXPECT_NE(few.out.find("only 2 frames"), std::string::npos) << few.out;
}

TEST_F(Ending, AfterAResumeTellsTheRatesOfThisRun) {
  ASSERT_EQ(run({"reconstruct", "rec", "half", "--frames", "0:25"}).exit_code, 0);
  const Ran ran = run({"reconstruct", "rec", "half", "--resume", "--json"});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  const auto report = Json::parse(ran.out);
  EXPECT_EQ(report["frames"]["total"], 40);
  EXPECT_EQ(report["frames_of_this_run"], 15);
  EXPECT_NEAR(report["frames_per_second"].get<double>() * report["seconds"].get<double>(), 15, 1e-6);
  const Ran nothing = run({"reconstruct", "rec", "half", "--resume"});
  EXPECT_NE(nothing.out.find("40 of 40 frames fused (0 lost, 0 skipped), 0 of them in this run"), std::string::npos)
      << nothing.out;
}

TEST_F(Ending, OfAnInterruptedRunIsTheCommandThatGoesOn) {
  write_small_recording(*folder / "long scan", {.frames = 250});
  // Acts as Ctrl-C after some keyframes.
  const std::string interrupted =
      "f() { \"$@\" & p=$!; while [ $(ls 'cut off'/session/run-0001/keyframes 2>/dev/null | wc -l) -lt 6 ] && kill -0 "
      "$p "
      "2>/dev/null; do sleep 0.02; done; kill -INT $p; wait $p; }; f";
  const Ran ran = run({"reconstruct", "long scan", "-o", "cut off"}, interrupted);
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  const std::string last = last_line(ran.out), go_on = " of 250 frames; resume with: ";
  const auto at = last.find(go_on);
  ASSERT_NE(at, std::string::npos) << ran.out;
  const int done = std::stoi(last);
  EXPECT_GT(done, 0);
  EXPECT_LT(done, 250);
  const std::string command = last.substr(at + go_on.size());
  EXPECT_NE(command.find("reconstruct 'long scan' -o 'cut off'"), std::string::npos) << command;
  EXPECT_NE(command.find("--resume"), std::string::npos) << command;
  EXPECT_EQ(last_line(run({"info", "cut off"}).out).find(std::to_string(250 - done) + " frames remain: resume with"),
            0u);
  const std::string in = "cd '" + folder->path().string() + "'; ";
  ASSERT_EQ(std::system((in + command + " --json >gone-on.json 2>gone-on.txt").c_str()), 0)
      << read_bytes(*folder / "gone-on.txt");
  const auto report = Json::parse(read_bytes(*folder / "gone-on.json"));
  EXPECT_EQ(report["frames"]["total"], 250);
  EXPECT_EQ(report["frames_of_this_run"], 250 - done);
  EXPECT_FALSE(report.contains("interrupted"));
}

TEST_F(Ending, WaitsForTheFilesThatAreBeingWritten) {
  // Acts as Ctrl-C after the map is written, before its mesh.
  const std::string interrupted =
      "f() { \"$@\" & p=$!; while [ ! -e once/map.vdb ] && kill -0 $p 2>/dev/null; do sleep 0.005; done; kill -INT "
      "$p; wait $p; }; f";
  const Ran ran = run({"reconstruct", "rec", "once"}, interrupted);
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NE(ran.err.find("writing the result; interrupt again to end at once"), std::string::npos) << ran.err;
  EXPECT_TRUE(fs::exists(*folder / "once" / "report.json"));
}

TEST_F(Ending, WhileFilesAreWrittenIsToldAndCanBeGoneOnFrom) {
  // Acts as Ctrl-C twice after the map is written, before its mesh.
  const std::string interrupted =
      "f() { \"$@\" & p=$!; while [ ! -e written/map.vdb ] && kill -0 $p 2>/dev/null; do sleep 0.005; done; kill -INT "
      "$p; sleep 0.05; kill -INT $p; wait $p; }; f";
  const Ran ran = run({"reconstruct", "rec", "written"}, interrupted);
  EXPECT_EQ(ran.exit_code, 130) << ran.err;
  EXPECT_NE(ran.err.find("interrupted before all files were written; resume with: "), std::string::npos) << ran.err;
  EXPECT_FALSE(fs::exists(*folder / "written" / "report.json"));
  const Ran more = run({"reconstruct", "rec", "written", "--resume"});
  EXPECT_EQ(more.exit_code, 0) << more.err;
  EXPECT_NE(more.out.find("40 of 40 frames fused (0 lost, 0 skipped), 0 of them in this run"), std::string::npos)
      << more.out;
  EXPECT_TRUE(fs::exists(*folder / "written" / "report.json"));
}

TEST_F(Ending, OfARunThatWasKilledIsToldByInfo) {
  ASSERT_EQ(run({"reconstruct", "rec", "killed", "--frames", "0:12"}).exit_code, 0);
  for (const auto& entry : fs::directory_iterator(*folder / "killed"))
    if (entry.path().filename() != "session") fs::remove(entry.path());
  const Ran info = run({"info", "killed"});
  EXPECT_EQ(info.exit_code, 0) << info.err;
  EXPECT_NE(info.out.find("after 12 frames: repeat its command with --resume"), std::string::npos) << info.out;
  EXPECT_EQ(Json::parse(run({"info", "killed", "--json"}).out)["cut_off"], true);
  write_text(*folder / "killed" / "report.json", "{\"fra");
  expect_one_line(run({"info", "killed"}), 1, "report.json: is not valid JSON, so it was truncated");
}

}  // namespace
}  // namespace cairn
