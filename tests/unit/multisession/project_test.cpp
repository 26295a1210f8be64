// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/building/project.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>

#include "cairn/io/inspect.hpp"
#include "cairn/io/source.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "support/files.hpp"
#include "support/recordings.hpp"
#include "support/ros_files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Ranges = std::vector<std::pair<int, int>>;

Ranges ranges_of(const Project& plan, std::size_t recording = 0) {
  Ranges ranges;
  for (const auto& part : plan.segments)
    if (part.recording == recording) ranges.emplace_back(part.begin, part.end);
  return ranges;
}

/// Writes small depth images without color.
void write_recording(const fs::path& folder, int frames) {
  write_small_recording(folder, {.frames = frames, .color = false});
}

struct Plan {
  TemporaryFolder folder;
  const fs::path at = folder / "plan";
  [[nodiscard]] std::string part(const std::string& name) const { return (at / "parts" / name).string(); }
  Project of(const std::vector<std::string>& recordings, int frames_per_segment, int overlap) const {
    return plan_project(recordings, at, {.frames_per_segment = frames_per_segment, .overlap = overlap});
  }
  /// Splits a recording of 12 frames into two segments: frames 0 to 6, and 5 to 11.
  std::string of_twelve() const {
    const std::string recording = (folder / "walk").string();
    write_recording(recording, 12);
    EXPECT_EQ(ranges_of(of({recording}, 5, 2)), (Ranges{{0, 7}, {5, 12}}));
    return recording;
  }
};

std::vector<int> indices_of(const std::string& name, const FrameRange& range = {}) {
  const auto source = open_source(name, {.range = range});
  std::vector<int> indices;
  const auto size = source->size();
  while (const auto frame = source->next()) indices.push_back(frame->index);
  EXPECT_EQ(size, static_cast<int>(indices.size()));
  return indices;
}

void expect_error(const std::string& error, const std::vector<std::string>& words) {
  for (const std::string& word : words) EXPECT_NE(error.find(word), std::string::npos) << word << "\n" << error;
  EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  EXPECT_EQ(error.find("json.exception"), std::string::npos) << error;
}

TEST(Parts, AreOfEqualLengthAndOverlap) {
  const Plan plan;
  EXPECT_EQ(ranges_of(plan.of({"synthetic:room"}, 100, 20)), (Ranges{{0, 113}, {93, 206}, {186, 300}}));
}

TEST(Parts, AreOneForAShortRecording) {
  EXPECT_EQ(ranges_of(Plan().of({"synthetic:room"}, 300, 20)), (Ranges{{0, 300}}));
  EXPECT_EQ(ranges_of(Plan().of({"synthetic:room"}, 280, 20)), (Ranges{{0, 300}}));
  EXPECT_EQ(ranges_of(Plan().of({"synthetic:room"}, 279, 20)).size(), 2u);
  EXPECT_EQ(ranges_of(Plan().of({"synthetic:room"}, 1000, 400)), (Ranges{{0, 300}}));
}

TEST(Parts, RoundTrip) {
  const Plan plan;
  const Project made = plan.of({"synthetic:room", "synthetic:plane"}, 200, 10), read = read_plan(plan.at);
  EXPECT_EQ(read.frames_per_segment, 200);
  EXPECT_EQ(read.overlap, 10);
  ASSERT_EQ(read.recordings.size(), 2u);
  EXPECT_EQ(read.recordings[1].name, "synthetic:plane");
  EXPECT_EQ(read.recordings[1].frames, 300);
  ASSERT_EQ(read.segments.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(read.segments[i].name, "00" + std::to_string(i));
    EXPECT_EQ(read.segments[i].recording, i / 2);
  }
  EXPECT_EQ(ranges_of(read), ranges_of(made));
  EXPECT_EQ(ranges_of(read, 1), ranges_of(made, 1));
}

TEST(Parts, StayUnchangedWhenAPlanGrows) {
  const Plan plan;
  plan.of({"synthetic:room"}, 150, 10);
  const auto long_ago = fs::file_time_type::clock::now() - std::chrono::hours(5);
  const auto all = [&] {
    std::vector<fs::path> files;
    for (const auto& entry : fs::recursive_directory_iterator(plan.at))
      if (entry.is_regular_file()) files.push_back(entry.path());
    return files;
  };
  const auto old = all();
  ASSERT_EQ(old.size(), 3u);  // two segments, and the plan
  for (const fs::path& file : old) fs::last_write_time(file, long_ago);
  const auto bytes = bytes_below(plan.at);
  const auto is_untouched = [&](const fs::path& file) { return fs::last_write_time(file) == long_ago; };

  plan.of({"synthetic:room"}, 150, 10);
  EXPECT_TRUE(std::ranges::all_of(all(), is_untouched));

  const Project grown = plan.of({"synthetic:plane"}, 150, 10);
  EXPECT_EQ(grown.recordings.size(), 2u);
  EXPECT_EQ(all().size(), 5u);
  EXPECT_EQ(ranges_of(grown), ranges_of(grown, 1));
  for (const fs::path& file : old) EXPECT_EQ(is_untouched(file), file.filename() != "plan.json") << file;
  for (const auto& [name, content] : bytes_below(plan.at / "parts"))
    if (bytes.contains("parts/" + name)) {
      EXPECT_EQ(bytes.at("parts/" + name), content) << name;
    }
  EXPECT_EQ(grown.segments[2].name, "002");
}

TEST(Parts, AreRecreatedIfMissing) {
  const Plan plan;
  const std::string recording = plan.of_twelve();
  const auto bytes = bytes_below(plan.at);
  fs::remove_all(plan.part("000"));
  write_text(plan.part("001") + "/part.json", "{");
  plan.of({recording}, 5, 2);
  EXPECT_EQ(bytes_below(plan.at), bytes);
}

TEST(Parts, OfTheSameRecordingAreCreatedOnce) {
  const Plan plan;
  const std::string recording = plan.of_twelve();
  const auto here = fs::relative(recording).string();
  const Project again = plan.of({recording, recording + "/", recording + "/../walk/.", here}, 5, 2);
  ASSERT_EQ(again.recordings.size(), 1u);
  EXPECT_EQ(again.recordings[0].name, fs::canonical(recording).string());
  EXPECT_EQ(again.segments.size(), 2u);
}

TEST(Parts, OpenAsFramesOfTheRecording) {
  const Plan plan;
  const std::string recording = plan.of_twelve();
  const auto part = open_source(plan.part("001")), full = open_source(recording);
  EXPECT_EQ(part->rig(), full->rig());
  EXPECT_EQ(part->layout(), "part 001 of a plan: " + full->layout());
  EXPECT_EQ(part->size(), 7);
  for (int i = 0; i < 12; ++i) {
    const auto expected = full->next();
    ASSERT_TRUE(expected);
    if (i < 5) continue;
    EXPECT_EQ(part->next_timestamp(), expected->timestamp);
    const auto frame = part->next();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->index, i);
    EXPECT_EQ(frame->timestamp, expected->timestamp);
    EXPECT_EQ(frame->depth, expected->depth);
  }
  EXPECT_FALSE(part->next());
  EXPECT_EQ(indices_of(plan.part("000")), (std::vector{0, 1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(first_index(plan.part("000")), 0);
  EXPECT_EQ(first_index(plan.part("001")), 5);
  EXPECT_EQ(first_index(recording), 0);
}

TEST(Parts, OfASceneSkipEarlierFrames) {
  const Plan plan;
  plan.of({"synthetic:room"}, 150, 10);
  const auto source = open_source(plan.part("001"), {.range = {.end = 2}});
  EXPECT_EQ(source->size(), 2);
  const auto frame = source->next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->index, 145);
  EXPECT_EQ(frame->timestamp, 145 / 30.0);
}

TEST(Parts, HaveRangesRelativeToTheirStart) {
  const Plan plan;
  plan.of_twelve();
  EXPECT_EQ(indices_of(plan.part("001"), {.begin = 1, .end = 6, .step = 2}), (std::vector{6, 8, 10}));
  EXPECT_EQ(indices_of(plan.part("000"), {.begin = 5}), (std::vector{5, 6}));
  EXPECT_EQ(indices_of(plan.part("000"), {.end = 100, .step = 3}), (std::vector{0, 3, 6}));
  EXPECT_EQ(indices_of(plan.part("000"), {.begin = 7}), std::vector<int>{});
  EXPECT_EQ(indices_of(plan.part("000"), {.begin = std::numeric_limits<int>::max(), .step = 9}), std::vector<int>{});
}

TEST(Parts, HaveTheGroundTruthOfTheirRecording) {
  const Plan plan;
  const std::string recording = (plan.folder / "walk").string();
  write_small_recording(recording, {.frames = 6});
  const Scene scene = synthetic_scene("room");
  Trajectory truth;
  for (int i = 0; i < 6; ++i) truth.push_back({i / 30.0, scene.world_from_camera(i / 30.0)});
  write_trajectory(recording + "/groundtruth.txt", truth);
  plan.of({recording}, 3, 1);
  const Trajectory of_part = recorded_truth(plan.part("001"));
  ASSERT_EQ(of_part.size(), 6u);
  EXPECT_TRUE(of_part[5].world_from_camera.isApprox(truth[5].world_from_camera, 1e-5));
  EXPECT_EQ(interpretation_of(plan.part("001")).size(), interpretation_of(recording).size());
}

/// Writes depth frames to a ROS bag; without an index the number of frames is unknown.
void write_bag(const fs::path& file, int frames, bool indexed) {
  constexpr ros::Wire kWire = ros::Wire::ros1;
  constexpr std::int64_t kFirst = 1'700'000'000'000'000'000, kStep = 33'000'000;  // ns
  const Camera camera{32, 24, 26.25, 26.25, 15.5, 11.5, {}};
  ros::Messages messages;
  for (int i = 0; i < frames; ++i) {
    const std::int64_t stamp = kFirst + i * kStep;
    const std::vector<std::uint16_t> depth(32u * 24u, static_cast<std::uint16_t>(1000 + i));
    messages.push_back({"/depth/camera_info", "sensor_msgs/CameraInfo", stamp,
                        ros::camera_info(kWire, "depth", camera, "plumb_bob", {0, 0, 0, 0, 0})});
    messages.push_back(
        {"/depth/image_raw", "sensor_msgs/Image", stamp,
         ros::image(kWire, {stamp,
                            "depth",
                            32,
                            24,
                            "16UC1",
                            {reinterpret_cast<const char*>(depth.data()), depth.size() * sizeof(std::uint16_t)},
                            2})});
  }
  write_text(file, ros::bag(messages, {.indexed = indexed}));
}

TEST(Parts, SplitSequentialRecordings) {
  for (const bool indexed : {true, false}) {
    const Plan plan;
    const std::string bag = (plan.folder / "a.bag").string();
    write_bag(bag, 9, indexed);
    EXPECT_EQ(open_source(bag)->size().has_value(), indexed);
    EXPECT_EQ(ranges_of(plan.of({bag}, 4, 1)), (Ranges{{0, 5}, {4, 9}}));
    const auto source = open_source(plan.part("001"), {.range = {.begin = 1, .end = 4, .step = 2}});
    for (const int i : {5, 7}) {
      const auto frame = source->next();
      ASSERT_TRUE(frame);
      EXPECT_EQ(frame->index, i);
      EXPECT_NEAR(frame->depth[0], 1 + 0.001 * i, 1e-6);
    }
    EXPECT_FALSE(source->next());
    EXPECT_TRUE(is_ros_recording(plan.part("000")));
    EXPECT_EQ(recorded_topics(plan.part("000")).size(), 2u);
  }
}

/// Writes frames of a room, rendered with a rig.
void write_taken_by(const fs::path& folder, const Rig& rig, int frames = 4) {
  const Scene scene = synthetic_scene("room");
  SceneRenderer depth(test_device(), scene, rig.depth), color(test_device(), scene, rig.color_view());
  Recorder writer(folder, rig);
  for (int i = 0; i < frames; ++i) {
    const Eigen::Isometry3d pose = scene.world_from_camera(i / 30.0);
    writer.add(encode({.index = i,
                       .timestamp = i / 30.0,
                       .depth = depth.render(pose).depth,
                       .color = color.render(pose * rig.depth_from_color()).color},
                      rig));
  }
}

TEST(Parts, OfAnotherCameraAreReprojected) {
  const Plan plan;
  const Camera first{160, 120, 131.25, 131.25, 79.5, 59.5, {}};
  Camera second{200, 150, 150, 152, 97, 76, {0.05, -0.02, 0.001, 0.0005}};
  const std::string a = (plan.folder / "a").string(), b = (plan.folder / "b").string();
  write_taken_by(a, Rig(first));
  write_taken_by(b, Rig(second, sensor_model("time_of_flight")));
  const Project planned = plan.of({a, b}, 10, 2);
  EXPECT_FALSE(planned.recordings[0].other_camera);
  EXPECT_TRUE(planned.recordings[1].other_camera);
  const auto own = open_source(plan.part("000")), other = open_source(plan.part("001"));
  EXPECT_TRUE(other->rig().has_same_cameras(own->rig()));
  for (int i = 0; i < 4; ++i) {
    const auto x = own->next(), y = other->next();
    ASSERT_TRUE(x && y);
    ASSERT_EQ(y->depth.size(), x->depth.size());
    ASSERT_EQ(y->color.size(), x->color.size());
    std::size_t seen = 0, near = 0, similar = 0;
    for (std::size_t p = 0; p < x->depth.size(); ++p) {
      if (x->depth[p] <= 0 || y->depth[p] <= 0) continue;
      ++seen;
      near += std::abs(x->depth[p] - y->depth[p]) < 0.002f;
      int max_difference = 0;
      for (int shift = 0; shift < 24; shift += 8)
        max_difference = std::max(max_difference, std::abs(static_cast<int>(x->color[p] >> shift & 255u) -
                                                           static_cast<int>(y->color[p] >> shift & 255u)));
      similar += max_difference < 16;
    }
    EXPECT_GT(seen, x->depth.size() * 9 / 10);
    EXPECT_GT(near, seen * 95 / 100);  // a shift of half a pixel gives 93 %, and 82 % alike
    EXPECT_GT(similar, seen * 84 / 100);
  }
  // The plan grows and keeps the cameras assigned, also if the first recording is not named again.
  write_taken_by(plan.folder / "c", Rig(second));
  const auto bytes = bytes_below(plan.at / "parts" / "001");
  EXPECT_TRUE(plan.of({b, (plan.folder / "c").string()}, 10, 2).recordings[2].other_camera);
  EXPECT_EQ(bytes_below(plan.at / "parts" / "001"), bytes);
  fs::remove(plan.at / "parts" / "001" / "camera.yaml");
  expect_error(error_of([&] { (void)open_source(plan.part("001")); }), {"camera.yaml"});
  plan.of({a}, 10, 2);  // writes the file again
  EXPECT_EQ(bytes_below(plan.at / "parts" / "001"), bytes);
  fs::remove_all(b);
  write_taken_by(b, Rig(first));
  expect_error(error_of([&] { plan.of({b}, 10, 2); }), {b + ": its camera differs from the planned one"});
  fs::remove_all(a);
  write_taken_by(a, Rig(second));
  expect_error(error_of([&] { plan.of({b}, 10, 2); }), {a + ": its camera differs from the plan's"});
}

TEST(Parts, OfAnotherColorCameraAreReprojected) {
  const Plan plan;
  const Camera depth{160, 120, 131.25, 131.25, 79.5, 59.5, {}}, color{320, 240, 260, 260, 159.5, 119.5, {}};
  Camera zoomed = color;
  zoomed.fx = zoomed.fy = 264;
  const std::string a = (plan.folder / "a").string(), b = (plan.folder / "b").string();
  write_taken_by(a, Rig(depth, ColorCamera{.camera = color}));
  write_taken_by(b, Rig(depth, ColorCamera{.camera = zoomed}));
  plan.of({a, b}, 10, 2);
  const auto own = open_source(plan.part("000")), other = open_source(plan.part("001"));
  EXPECT_TRUE(other->rig().has_same_cameras(own->rig()));
  const auto x = own->next(), y = other->next();
  ASSERT_TRUE(x && y);
  EXPECT_EQ(y->depth, x->depth);
  ASSERT_EQ(y->color.size(), x->color.size());
  std::size_t similar = 0;
  for (std::size_t p = 0; p < x->color.size(); ++p)
    similar += std::abs(static_cast<int>(x->color[p] & 255u) - static_cast<int>(y->color[p] & 255u)) < 16;
  EXPECT_GT(similar, x->color.size() * 95 / 100);
}

TEST(Parts, OfIncompatibleCamerasAreRejected) {
  const Plan plan;
  const std::string small = plan.of_twelve();
  const auto bytes = bytes_below(plan.at);
  Rig beside(Camera{160, 120, 140, 140, 79.5, 59.5, {}}, ColorCamera{.camera = small_camera()});
  const std::string rolling = (plan.folder / "rolling").string();
  Camera slow{160, 120, 131.25, 131.25, 79.5, 59.5, {}};
  slow.readout = 0.03;
  write_taken_by(rolling, Rig(slow), 2);
  expect_error(error_of([&] { plan.of({rolling}, 5, 2); }),
               {rolling + ": has another camera than ", fs::canonical(small).string(),
                "its shutter readout is 30.0 ms, not 0.0 ms", "make a plan for each camera"});
  EXPECT_EQ(bytes_below(plan.at), bytes);
  const std::string left = (plan.folder / "left").string(), right = (plan.folder / "right").string();
  beside.color->color_from_depth.translation().x() = 0.025;
  write_taken_by(left, beside, 2);
  beside.color->color_from_depth.translation().x() = -0.025;
  write_taken_by(right, beside, 2);
  const Plan other;
  expect_error(error_of([&] {
                 other.of({left, right}, 5, 2);
               }),
               {"color camera has another position", "`cairn convert --registered`"});
  EXPECT_FALSE(fs::exists(other.at));
}

TEST(Parts, AreOnlyOfRecordings) {
  const Plan plan;
  const std::string recording = plan.of_twelve();
  expect_error(error_of([&] { plan.of({"openni:"}, 5, 2); }), {"openni:: is a sensor", "`cairn record`"});
  expect_error(error_of([&] { plan.of({plan.part("001")}, 5, 2); }),
               {plan.part("001") + ": is part 001 of a plan: give its recording, "});
  expect_error(error_of([&] { plan.of({(plan.folder / "nowhere").string()}, 5, 2); }), {"nowhere: there is no such"});
  expect_error(error_of([&] { plan.of({}, 5, 2); }), {"no recording"});
  fs::create_directories(plan.folder / "map");
  write_text(plan.folder / "map" / "report.json", "{}");
  expect_error(error_of([&] { plan_project({recording}, plan.folder / "map", {}); }),
               {"map: contains a map (report.json); choose another folder"});
}

TEST(Parts, OfOtherLengthsAreRejected) {
  const Plan plan;
  const std::string recording = plan.of_twelve();
  expect_error(error_of([&] { plan.of({recording}, 6, 2); }),
               {"was made with Project::frames_per_segment 5 and Project::overlap 2"});
  expect_error(error_of([&] { plan.of({recording}, 5, 1); }), {"was made with"});
  expect_error(error_of([&] { Plan().of({recording}, 5, 5); }), {"Project::overlap is 5: take 0 or more, and less"});
  expect_error(error_of([&] { Plan().of({recording}, 5, -1); }), {"Project::overlap is -1"});
  expect_error(error_of([&] { Plan().of({recording}, 0, 0); }), {"Project::frames_per_segment is 0"});
}

TEST(Parts, OfAChangedRecordingAreRejected) {
  const Plan plan;
  const std::string recording = plan.of_twelve();
  fs::remove_all(recording);
  write_recording(recording, 11);
  expect_error(error_of([&] { plan.of({recording}, 5, 2); }),
               {fs::canonical(recording).string() + ": has 11 frames, but had 12 when it was planned"});
  EXPECT_EQ(indices_of(plan.part("000")).size(), 7u);
  expect_error(error_of([&] { (void)open_source(plan.part("001")); }),
               {plan.part("001") + ": its recording, ", "has fewer frames"});
  fs::remove_all(recording);
  expect_error(error_of([&] { (void)open_source(plan.part("001")); }),
               {plan.part("001") + ": its recording, ", "is missing: restore it"});
}

/// Returns the error of reading a plan after `change` of its plan.json.
std::string error_of_plan(const Plan& plan, const std::function<void(nlohmann::json&)>& change) {
  auto json = nlohmann::json::parse(read_bytes(plan.at / "plan.json"));
  const std::string before = read_bytes(plan.at / "plan.json");
  change(json);
  write_text(plan.at / "plan.json", json.dump());
  const std::string error = error_of([&] { (void)read_plan(plan.at); });
  write_text(plan.at / "plan.json", before);
  (void)read_plan(plan.at);
  return error;
}

TEST(Parts, OfADamagedPlanAreRejected) {
  const Plan plan;
  plan.of_twelve();
  const std::string file = (plan.at / "plan.json").string();
  const std::pair<std::string, std::function<void(nlohmann::json&)>> changes[] = {
      {"`overlap` is missing", [](auto& j) { j.erase("overlap"); }},
      {"`overlap` is not an integer from 0 to 4", [](auto& j) { j["overlap"] = 5; }},
      {"`frames_per_part` is not an integer", [](auto& j) { j["frames_per_part"] = "5"; }},
      {"`recordings` is not a list", [](auto& j) { j["recordings"] = 1; }},
      {"`name` is not a string", [](auto& j) { j["recordings"][0]["name"] = 1; }},
      {"`name` is missing", [](auto& j) { j["recordings"][0] = 1; }},
      {"`frames` is not an integer", [](auto& j) { j["recordings"][0]["frames"] = 1.5; }},
      {"`frames` is not an integer", [](auto& j) { j["recordings"][0]["frames"] = 1e300; }},
      {"part 001 has a wrong name", [](auto& j) { j["parts"][1]["name"] = "../001"; }},
      {"`recording` is not an integer", [](auto& j) { j["parts"][0]["recording"] = 1; }},
      {"`recording` is not an integer", [](auto& j) { j["recordings"] = nlohmann::json::array(); }},
      {"`end` is not an integer from 1 to 12", [](auto& j) { j["parts"][1]["end"] = 13; }},
      {"`begin` is not an integer from 0 to 11", [](auto& j) { j["parts"][1]["begin"] = 12; }}};
  for (const auto& [what, change] : changes)
    expect_error(error_of_plan(plan, change), {file + ": is damaged: " + what, "remove it and run `cairn plan` again"});
  const std::string full = read_bytes(file);
  for (const std::string& text : {full.substr(0, full.size() / 2), std::string(), std::string("\xff\xfe")}) {
    write_text(file, text);
    expect_error(error_of([&] { (void)read_plan(plan.at); }), {file + ": is damaged: is not JSON", "`cairn plan`"});
  }
  for (const char* text : {"[1]", "{}", R"({"kind": 3, "format": 1})"}) {
    write_text(file, text);
    expect_error(error_of([&] { (void)read_plan(plan.at); }), {file + ": is not a plan"});
  }
  fs::remove(file);
  expect_error(error_of([&] { (void)read_plan(plan.at); }), {plan.at.string() + ": has no plan.json"});
}

TEST(Parts, OfAnotherVersionAreRejected) {
  const Plan plan;
  const std::string recording = plan.of_twelve();
  for (const auto& format : {nlohmann::json(2), nlohmann::json("1"), nlohmann::json()}) {
    const auto change = [&](auto& j) { j["format"] = format; };
    expect_error(
        error_of_plan(plan, change),
        {(plan.at / "plan.json").string() + ": was made by another version of Cairn; make it again with `cairn plan`"});
  }
  write_text(plan.part("000") + "/part.json", R"({"kind": "cairn part", "format": 2})");
  expect_error(error_of([&] { (void)open_source(plan.part("000")); }),
               {plan.part("000") + "/part.json: was made by another version of Cairn"});
}

TEST(Parts, WithDamagedFilesAreRejected) {
  const Plan plan;
  const std::string recording = plan.of_twelve(), file = plan.part("001") + "/part.json";
  const auto good = nlohmann::json::parse(read_bytes(file));
  const auto expect_damaged = [&](const std::string& text, const std::string& what) {
    write_text(file, text);
    expect_error(error_of([&] { (void)open_source(plan.part("001")); }), {file + ": is damaged: " + what});
    expect_error(error_of([&] { (void)recorded_truth(plan.part("001")); }), {what});
  };
  const auto changed = [&](const char* key, const nlohmann::json& value) {
    auto json = good;
    json[key] = value;
    return json.dump();
  };
  expect_damaged("", "is not JSON");
  expect_damaged(good.dump().substr(0, 40), "is not JSON");
  expect_damaged(changed("begin", 12), "`begin` is not an integer from 0 to 11");
  expect_damaged(changed("begin", -1), "`begin`");
  expect_damaged(changed("end", 3e9), "`end` is not an integer");
  expect_damaged(changed("recording", 3), "`recording` is not a string");
  expect_damaged(changed("recording", "walk"), "`recording` is not an absolute path");
  expect_damaged(changed("recording", plan.part("001")), "`recording` is itself a part of a plan");
  expect_damaged(changed("recording", plan.part("000")), "`recording` is itself a part of a plan");
}

TEST(Parts, IgnoreForeignPartFiles) {
  const Plan plan;
  const std::string recording = plan.of_twelve();
  for (const char* text : {"[]", "{}", R"({"kind": "engine", "begin": 3})"}) {
    write_text(recording + "/part.json", text);
    EXPECT_EQ(open_source(recording)->size(), 12);
    EXPECT_EQ(indices_of(plan.part("001")).size(), 7u);
  }
}

}  // namespace
}  // namespace cairn
