// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Recording from a virtual depth camera: tests/support/sensor.
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>

#include "cairn/io/source.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

/// Environment with the virtual sensor as `openni:`; `behavior` in the syntax of its driver.
std::string sensor(const std::string& behavior = "") {
  return "LD_LIBRARY_PATH='" + openni_folder() + "' CAIRN_SENSOR='" + behavior + "'";
}

int frames_in(Source& source) {
  int frames = 0;
  while (const auto frame = source.next()) frames += !frame->problem && !frame->color.empty();
  return frames;
}

class Record : public testing::Test {
 protected:
  [[nodiscard]] std::string out(const std::string& name) const { return (folder / name).string(); }
  /// Records until the command is killed.
  void record_and_kill(const std::string& output) const {
    const Ran ran = run_cairn({"record", "openni:", "-o", output}, sensor() + " timeout -s KILL 2");
    EXPECT_NE(ran.exit_code, 0);
  }
  /// Writes an image for the virtual sensor with frames=FOLDER.
  void show(std::size_t number, const std::vector<std::uint16_t>& depth) const {
    std::ofstream(folder / ("depth-" + std::to_string(number) + ".raw"), std::ios::binary)
        .write(reinterpret_cast<const char*>(depth.data()), 2 * 640 * 480);
    write_text(folder / ("color-" + std::to_string(number) + ".raw"), std::string(3 * 640 * 480, 'x'));
  }
  TemporaryFolder folder;
};

TEST_F(Record, RecordsEveryFrameOfASensor) {
  const Ran ran = run_cairn({"record", "openni:", "-o", out("a"), "--seconds", "2", "--json"}, sensor());
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  const auto result = nlohmann::json::parse(ran.out);
  EXPECT_NEAR(result["frames"].get<int>(), 60, 1);
  EXPECT_EQ(result["dropped"], 0);
  const auto source = open_source(folder / "a");
  EXPECT_NEAR(source->rig().depth.fx, 525, 0.01);
  EXPECT_EQ(frames_in(*source), result["frames"]);
}

TEST_F(Record, WritesAndReadsOniWithIdenticalDepth) {
  // Irregular depth, which a lossy codec would change.
  std::vector<std::vector<std::uint16_t>> images(3, std::vector<std::uint16_t>(640 * 480));
  std::uint32_t random = 7;
  for (std::size_t i = 0; i < images.size(); ++i) {
    for (auto& z : images[i]) z = static_cast<std::uint16_t>((random = random * 1664525u + 1013904223u) % 10000);
    show(i, images[i]);
  }
  const Ran ran = run_cairn({"record", "openni:", "-o", out("a.oni"), "--seconds", "1"},
                            sensor("frames=" + folder.path().string()));
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  const auto source = open_source(out("a.oni"));
  const auto is = [&](const Frame& frame, std::size_t image) {
    for (std::size_t p = 0; p < frame.depth.size(); ++p)
      if (std::lround(frame.depth[p] * 1000) != images[image % images.size()][p]) return false;
    return true;
  };
  int frames = 0;
  std::size_t first = 0;  // image shown at the start of the recording
  double begin = 0;
  for (; const auto frame = source->next(); ++frames) {
    if (frames == 0) begin = frame->timestamp;
    while (frames == 0 && first < images.size() && !is(*frame, first)) ++first;
    ASSERT_LT(first, images.size());
    ASSERT_TRUE(is(*frame, first + static_cast<std::size_t>(std::lround(30 * (frame->timestamp - begin))))) << frames;
  }
  EXPECT_GE(frames, 30);
}

TEST_F(Record, KeepsFramesBeforeAKill) {
  record_and_kill(out("a"));
  const auto source = open_source(folder / "a");
  EXPECT_GT(frames_in(*source), 15);
  record_and_kill(out("a.oni"));
  EXPECT_GT(frames_in(*open_source(out("a.oni"))), 15);
}

TEST_F(Record, FinishesAtCtrlC) {
  const std::string interrupted = "f() { " + sensor() + " \"$@\" & p=$!; while [ $(ls '" + out("a") +
                                  "/depth' 2>/dev/null | wc -l) -lt 20 ] && kill -0 $p 2>/dev/null; do sleep 0.05; "
                                  "done; kill -INT $p; wait $p; }; f";
  const Ran ran = run_cairn({"record", "openni:", "-o", out("a"), "--json"}, interrupted);
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NE(ran.out.find("\"dropped\": "), std::string::npos) << ran.err;
  EXPECT_GE(frames_in(*open_source(folder / "a")), 19);
}

TEST_F(Record, KeepsFramesBeforeAnUnplug) {
  expect_last_line(run_cairn({"record", "openni:", "-o", out("a")}, sensor("unplug=20")), 1,
                   "unplugged; the frames before are in");
  EXPECT_NEAR(frames_in(*open_source(folder / "a")), 20, 2);
}

TEST_F(Record, KeepsFramesBeforeAFullDisk) {
  // A file size limit acts as a full disk: ten small images, then a large image.
  std::vector<std::uint16_t> depth(640 * 480, 1000);
  for (std::size_t i = 0; i < 10; ++i) show(i, depth);
  for (std::size_t i = 0; i < depth.size(); ++i) depth[i] = static_cast<std::uint16_t>(i * i % 9973);
  show(10, depth);
  const Ran ran = run_cairn({"record", "openni:", "-o", out("a")},
                            with_files_of(50 << 10) + " " + sensor("frames=" + folder.path().string()));
  expect_last_line(ran, 1, "File too large");
  EXPECT_EQ(frames_in(*open_source(folder / "a")), 10);
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder / "a"))
    EXPECT_NE(entry.path().filename().string()[0], '.') << entry.path();
}

TEST_F(Record, ReportsErrorsInOneLine) {
  expect_one_line(run_cairn({"record", "openni:", "-o", out("a")}), 1, "no depth sensor is plugged in");
  expect_one_line(run_cairn({"record", "openni:", "-o", out("a")}, sensor("nodepth")), 1, "has no depth images");
  expect_one_line(run_cairn({"record", "openni:virtual", "-o", out("a")}, sensor("busy")), 1,
                  "is another program using it?");
  expect_one_line(run_cairn({"record", "openni:", "-o", out("no/folder/a")}, sensor()), 1, "there is no such folder");
  expect_one_line(run_cairn({"record", "synthetic:room", "-o", out("a.oni")}), 1, "only OpenNI2 sources");
  std::filesystem::create_directories(folder / "full" / "of");
  expect_one_line(run_cairn({"record", "openni:", "-o", out("full")}, sensor()), 1, "is not empty");
  EXPECT_FALSE(std::filesystem::exists(folder / "a"));
}

}  // namespace
}  // namespace cairn
