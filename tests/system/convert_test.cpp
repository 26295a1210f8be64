// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// `cairn convert`: output of every reader in TUM's layout.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "cairn/io/layouts.hpp"
#include "cairn/io/source.hpp"
#include "cairn/synthetic/synthetic.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr int kFrames = 4;

Rig rig_beside() {
  Rig rig(small_camera(),
          ColorCamera{.camera = {.width = 640, .height = 400, .fx = 480, .fy = 480, .cx = 319.5, .cy = 199.5}});
  rig.color->color_from_depth =
      Eigen::Translation3d(-0.05, 0.01, 0.005) * Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitY());
  return rig;
}

std::vector<Frame> room(const Rig& rig) {
  const Scene scene = synthetic_scene("room");
  std::vector<Frame> frames;
  for (int i = 0; i < kFrames; ++i) {
    frames.push_back(scene_frame(scene, rig.depth, i));
    frames.back().color =
        scene_frame_at(scene, rig.color_view(), *frames.back().world_from_camera * rig.depth_from_color()).color;
  }
  return frames;
}

/// Recording in a given layout.
struct Input {
  TemporaryFolder folder;
  std::string name;
  explicit Input(const std::string& layout, const Rig& rig = rig_beside()) {
    fs::create_directories(folder / "in");
    const auto writer = write_layout(layout, folder / "in", rig);
    for (const Frame& frame : room(rig)) writer->add(frame);
    writer->finish();
    name = layout == "scannet" ? folder / "in/recording.sens" : folder / "in";
  }
  [[nodiscard]] std::string out() const { return folder / "out"; }
  [[nodiscard]] Ran convert(std::vector<std::string> options = {}) const {
    options.insert(options.begin(), {"convert", name, "-o", out(), "--json"});
    return run_cairn(options);
  }
};

std::set<std::string> names_in(const fs::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.insert(entry.path().filename().string());
  return names;
}

std::vector<Frame> read(const std::string& name) {
  std::vector<Frame> frames;
  const auto source = open_source(name);
  while (auto frame = source->next()) frames.push_back(*std::move(frame));
  return frames;
}

TEST(Convert, KeepsAllOfTheRecording) {
  const std::pair<std::string, double> kinds[] = {{"tum", 5000}, {"scannet", 1000}, {"replica", 6553.5}};
  for (const auto& [layout, units] : kinds) {
    SCOPED_TRACE(layout);
    const Input in(layout, layout == "replica" ? Rig(small_camera()) : rig_beside());
    const Ran ran = in.convert();
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_EQ(nlohmann::json::parse(ran.out)["depth_scale"], units);
    const Rig was = open_source(in.name)->rig(), is = open_source(in.out())->rig();
    EXPECT_EQ(is.depth, was.depth);
    EXPECT_EQ(is.color_view(), was.color_view());
    EXPECT_TRUE(is.depth_from_color().isApprox(was.depth_from_color(), 1e-12));
    const auto before = read(in.name), after = read(in.out());
    ASSERT_EQ(after.size(), std::size_t{kFrames});
    for (std::size_t i = 0; i < after.size(); ++i) {
      EXPECT_NEAR(after[i].timestamp, before[i].timestamp, 1e-6);
      EXPECT_TRUE(after[i].depth == before[i].depth) << "not bit for bit";
      EXPECT_TRUE(after[i].color == before[i].color);
    }
    const auto truth = recorded_truth(in.name), kept = recorded_truth(in.out());
    ASSERT_EQ(kept.size(), truth.size());
    for (std::size_t i = 0; i < truth.size(); ++i)
      EXPECT_TRUE(kept[i].world_from_camera.isApprox(truth[i].world_from_camera, 1e-6));
    EXPECT_EQ(names_in(in.folder.path()), (std::set<std::string>{"in", "out"}));
  }
}

TEST(Convert, BringsColorToDepthForProgramsThatKnowOneCamera) {
  const Input in("tum");
  ASSERT_EQ(in.convert({"--registered"}).exit_code, 0);
  EXPECT_EQ(open_source(in.out())->rig(), Rig(small_camera()));
  const auto registered = read(in.out()), expected = room(small_camera());
  ASSERT_EQ(registered.size(), expected.size());
  double difference = 0;
  std::size_t seen = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    ASSERT_EQ(registered[i].color.size(), expected[i].color.size());
    for (std::size_t p = 0; p < expected[i].color.size(); ++p) {
      if ((registered[i].color[p] & 0xffffffu) == 0) continue;  // out of the color camera's view, or occluded
      ++seen;
      for (const int shift : {0, 8, 16})
        difference += std::abs(static_cast<int>(registered[i].color[p] >> shift & 255u) -
                               static_cast<int>(expected[i].color[p] >> shift & 255u));
    }
  }
  EXPECT_GT(static_cast<double>(seen), 0.75 * kFrames * 320 * 240);
  EXPECT_LT(difference / static_cast<double>(3 * seen), 6);  // of 255: patterns and JPEG
}

TEST(Convert, TellsABadFrameAndGoesOn) {
  const Input in("tum");
  write_text(fs::path(in.name) / "depth/0.033333.png", "no image");
  const Ran ran = in.convert();
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_NE(ran.err.find("1 of 4 frames left out: is not an image: neither PNG nor JPEG (frame 1, "), std::string::npos)
      << ran.err;
  EXPECT_EQ(nlohmann::json::parse(ran.out)["unreadable"], 1);
  EXPECT_EQ(read(in.out()).size(), std::size_t{kFrames - 1});
}

TEST(Convert, KeepsWhatCameBeforeAFileIsCutOff) {
  const Input in("scannet");
  fs::resize_file(in.name, fs::file_size(in.name) - 1000);
  expect_last_line(in.convert(), 1, "is cut off in frame 3 of 4");
  EXPECT_EQ(read(in.out()).size(), std::size_t{kFrames - 1});
}

TEST(Convert, ReadsARecordingThatIsNamedAsTemporaryFoldersOnceWere) {
  const Input in("tum");
  fs::rename(in.folder / "in", in.folder / "out.part");
  const auto before = bytes_below(in.folder / "out.part");
  const Ran ran = run_cairn({"convert", in.folder / "out.part", "-o", in.out()});
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_TRUE(bytes_below(in.folder / "out.part") == before);
  EXPECT_EQ(names_in(in.folder.path()), (std::set<std::string>{"out", "out.part"}));
}

TEST(Convert, RefusesWhatItCannotDoInOneLine) {
  const Input in("tum");
  expect_one_line(run_cairn({"convert", "openni:", "-o", in.out()}), 1, "is a sensor");
  expect_one_line(run_cairn({"convert", in.folder / "none", "-o", in.out()}), 1, "there is no such folder");
  expect_one_line(in.convert({"--frames", "100:"}), 1, "contains no readable frame");
  EXPECT_EQ(names_in(in.folder.path()), std::set<std::string>{"in"});
  write_text(in.folder / "notes.txt", "mine");
  expect_one_line(run_cairn({"convert", in.name, "-o", in.folder.path().string()}), 1, "contains the input");
  fs::create_directory(in.folder / "full");
  write_text(in.folder / "full" / "notes.txt", "mine");
  expect_one_line(run_cairn({"convert", in.name, "-o", in.folder / "full"}), 1, "has other content");
  EXPECT_EQ(read_bytes(in.folder / "full" / "notes.txt"), "mine");
  EXPECT_EQ(read_bytes(in.folder / "notes.txt"), "mine");
}

}  // namespace
}  // namespace cairn
