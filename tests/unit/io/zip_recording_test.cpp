// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/datasets/zip_recording.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <opencv2/imgcodecs.hpp>

#include "cairn/io/layouts.hpp"
#include "cairn/io/source.hpp"
#include "support/files.hpp"
#include "support/recordings.hpp"
#include "support/scenes.hpp"
#include "support/zips.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr int kFrames = 3;

/// Zip entries of a folder; `top` is prepended to the names: empty, or a name and a slash.
std::vector<ZipEntry> entries_of(const fs::path& folder, const std::string& top = "") {
  std::vector<ZipEntry> entries;
  for (const auto& [name, bytes] : bytes_below(folder))
    entries.push_back({top + name + (fs::is_directory(folder / name) ? "/" : ""), bytes});
  return entries;
}

/// Sets the folder for unpacked archives during its lifetime.
class Unpacking {
 public:
  Unpacking() { setenv("TMPDIR", place_.path().c_str(), 1); }
  ~Unpacking() {
    EXPECT_THROW((void)unpacked("no.zip"), std::runtime_error);  // releases the last archive before its folder
    EXPECT_EQ(folders(), 0);
    unsetenv("TMPDIR");
  }
  Unpacking(const Unpacking&) = delete;
  Unpacking& operator=(const Unpacking&) = delete;
  [[nodiscard]] int folders() const {
    const auto is_one = [](const fs::directory_entry& entry) {
      return entry.path().filename().string().starts_with("cairn-unpacked-");
    };
    return static_cast<int>(std::count_if(fs::directory_iterator(place_.path()), fs::directory_iterator(), is_one));
  }
  [[nodiscard]] const fs::path& place() const { return place_.path(); }

 private:
  TemporaryFolder place_;
};

void write(const std::string& layout, const fs::path& folder) {
  fs::create_directories(folder);
  const auto writer = write_layout(layout, folder, small_camera());
  for (int i = 0; i < kFrames; ++i) writer->add(scene_frame(synthetic_scene("room"), small_camera(), i));
  writer->finish();
}

void expect_same(const std::string& packed, const std::string& plain) {
  const auto a = open_source(packed), b = open_source(plain);
  EXPECT_EQ(a->rig(), b->rig());
  EXPECT_EQ(a->size(), b->size());
  while (const auto frame = b->next()) {
    const auto same = a->next();
    ASSERT_TRUE(same);
    EXPECT_FALSE(same->problem) << *same->problem;
    EXPECT_EQ(same->timestamp, frame->timestamp);
    EXPECT_EQ(same->depth, frame->depth);
    EXPECT_EQ(same->color, frame->color);
    EXPECT_EQ(same->confidence, frame->confidence);
  }
  EXPECT_FALSE(a->next());
  const auto truth = recorded_truth(packed), expected = recorded_truth(plain);
  ASSERT_EQ(truth.size(), expected.size());
  for (std::size_t i = 0; i < truth.size(); ++i)
    EXPECT_TRUE(truth[i].world_from_camera.isApprox(expected[i].world_from_camera));
}

void expect_same_packed(const std::string& layout, const std::string& file = "") {
  SCOPED_TRACE(layout);
  const Unpacking unpacking;
  const TemporaryFolder folder;
  write(layout, folder / "scan");
  // Flat, in a folder, packed by macOS, and packed by Windows.
  for (const std::string top : {"", "scan/", "./a/b/", "scan\\"}) {
    SCOPED_TRACE(top);
    auto entries = entries_of(folder / "scan", top);
    entries.push_back({"__MACOSX/._scan", "something"});
    entries.push_back({".DS_Store", "something"});
    const auto archive = folder / ("packed" + std::to_string(top.size()) + ".zip");
    write_zip(archive, entries);
    expect_same(archive, folder / "scan" / file);
    EXPECT_EQ(unpacking.folders(), 1);
  }
}

TEST(ZipRecording, MatchesFolder) {
  for (const char* layout : {"tum", "open3d", "replica", "nerfstudio"}) expect_same_packed(layout);
}

TEST(ZipRecording, IsRecognizedByExtension) {
  const Unpacking unpacking;
  const TemporaryFolder folder;
  write("scannet", folder / "scan");
  fs::rename(folder / "scan/recording.sens", folder / "scan/RECORDING.SENS");
  write_zip(folder / "SCAN.ZIP", entries_of(folder / "scan"));
  expect_same(folder / "SCAN.ZIP", folder / "scan/RECORDING.SENS");
}

TEST(ZipRecording, MatchesPackedFile) { expect_same_packed("scannet", "recording.sens"); }

TEST(ZipRecordingOfAPhone, MatchesFolder) { expect_same_packed("stray-scanner"); }

TEST(ZipRecording, KeepsNameForLayoutDetection) {
  const Unpacking unpacking;
  const TemporaryFolder folder;
  write("tum", folder / "scan");
  fs::remove(folder / "scan/camera.yaml");
  for (const auto& entry : fs::directory_iterator(folder / "scan/depth"))  // the benchmark's size
    cv::imwrite(entry.path().string(), cv::Mat(480, 640, CV_16U, cv::Scalar(5000)));
  write_zip(folder / "rgbd_dataset_freiburg3_office.zip", entries_of(folder / "scan"));
  EXPECT_EQ(open_source(folder / "rgbd_dataset_freiburg3_office.zip")->rig().depth.fx, 535.4);
}

TEST(ZipRecording, StaysUnpackedWhileRead) {
  const Unpacking unpacking;
  const TemporaryFolder folder;
  write("tum", folder / "scan");
  write_zip(folder / "a.zip", entries_of(folder / "scan"));
  write_zip(folder / "b.zip", entries_of(folder / "scan"));
  auto a = open_source(folder / "a.zip");
  const auto again = open_source(folder / "a.zip");
  EXPECT_EQ(unpacking.folders(), 1);
  const auto b = open_source(folder / "b.zip");
  EXPECT_EQ(unpacking.folders(), 2);
  EXPECT_FALSE(a->next()->problem);
  a.reset();
  EXPECT_FALSE(again->next()->problem);
  // Another file of the same name is another recording.
  write_zip(folder / "b.zip", {{"readme", "nothing"}});
  EXPECT_THROW((void)open_source(folder / "b.zip"), std::runtime_error);
}

TEST(ZipRecording, ErrorsNameArchive) {
  const Unpacking unpacking;
  const TemporaryFolder folder;
  write("tum", folder / "scan");
  const auto archive = folder / "a.zip";
  auto entries = entries_of(folder / "scan", "scan/");
  std::string depth;  // name of the first depth image
  for (auto& entry : entries)
    if (depth.empty() && entry.name.starts_with("scan/depth/") && entry.name.ends_with(".png")) {
      depth = entry.name;
      entry.bytes.resize(100);
    }
  write_zip(archive, entries);
  const auto frame = open_source(archive)->next();
  ASSERT_TRUE(frame && frame->problem);
  EXPECT_NE(frame->problem->find(archive.string() + "/" + depth + ": "), std::string::npos) << *frame->problem;
  for (auto& entry : entries)
    if (entry.name == "scan/depth.txt") entry.bytes = "wrong\n";
  write_zip(archive, entries);
  EXPECT_EQ(error_of([&] { (void)open_source(archive); }).find(archive.string() + "/scan/depth.txt:1: "), 0u);
  write_zip(archive, {{"scan/readme", "nothing"}, {"scan/more", "nothing"}});
  EXPECT_EQ(error_of([&] { (void)open_source(archive); }).find(archive.string() + "/scan: is not a known recording"),
            0u);
}

TEST(ZipRecording, KeepsFramesDespiteDamagedFile) {
  const Unpacking unpacking;
  const TemporaryFolder folder;
  write("tum", folder / "scan");
  auto entries = entries_of(folder / "scan");
  std::string depth;
  for (auto& entry : entries)
    if (entry.stored = true; depth.empty() && entry.name.starts_with("depth/")) depth = entry.bytes;
  write_zip(folder / "a.zip", entries);
  std::string bytes = read_bytes(folder / "a.zip");
  const auto at = bytes.find(depth);
  ASSERT_NE(at, std::string::npos);
  bytes[at + depth.size() / 2] ^= 1;
  write_text(folder / "a.zip", bytes);
  testing::internal::CaptureStdout();
  const auto source = open_source(folder / "a.zip");
  const auto output = testing::internal::GetCapturedStdout();
  EXPECT_NE(output.find("a.zip: 1 of "), std::string::npos) << output;
  EXPECT_EQ(source->size(), kFrames);
  (void)source->next();
  EXPECT_FALSE(source->next()->problem);
}

/// Expects a one-line error with the archive's name and `what`.
void expect_error(const fs::path& archive, const std::string& what) {
  const auto error = error_of([&] { (void)open_source(archive); });
  EXPECT_EQ(error.find(archive.string() + ": "), 0u) << error;
  EXPECT_NE(error.find(what), std::string::npos) << error;
  EXPECT_EQ(error.find('\n'), std::string::npos) << error;
}

TEST(ZipRecording, RejectsInvalidFilesInOneLine) {
  const Unpacking unpacking;
  const TemporaryFolder folder;
  const auto archive = folder / "a.zip";
  expect_error(archive, "there is no such file");
  write_text(archive, "");
  expect_error(archive, "is empty; copy it again");
  write_text(archive, "this is no archive");
  expect_error(archive, "is cut off or not a .zip file; copy it again");
  write_zip(archive, {{"rgb.txt", std::string(5000, 'x'), true}, {"depth.txt", "nothing"}});
  const std::string good = read_bytes(archive);
  write_text(archive, good.substr(0, good.size() / 2));
  expect_error(archive, "is cut off or not a .zip file; copy it again");
  write_text(archive, good.substr(0, good.size() - 30));
  expect_error(archive, "is cut off or not a .zip file; copy it again");
  for (const char* name : {"../rgb.txt", "a/../../rgb.txt", "..\\rgb.txt"}) {
    write_zip(archive, {{name, "nothing"}});
    expect_error(archive, "rgb.txt', which leads outside its folder");
  }
  for (const char* name : {"/etc/rgb.txt", "\\rgb.txt"}) {
    write_zip(archive, {{name, "nothing"}});
    expect_error(archive, "rgb.txt', which is not a relative path");
  }
  write_zip(archive, {{"rgb.txt", "nothing", false, false, "secret"}});
  expect_error(archive, "has 'rgb.txt', which is encrypted; unpack the archive with its password");
  write_zip(archive, {{"depth", "/etc", false, true}});
  expect_error(archive, "has 'depth', which is a link");
  write_zip(archive, {{"a", "nothing"}, {"a/b", "nothing"}});
  expect_error(archive, "cannot be unpacked");
  write_zip(archive, {{"scan/", ""}});
  expect_error(archive, "has no files");
}

TEST(ZipRecording, StaysInTemporaryFolder) {
  const Unpacking unpacking;
  const TemporaryFolder folder;
  for (const char* name : {"...zip", "..zip", ".hidden.zip"}) {
    SCOPED_TRACE(name);
    write_text(unpacking.place() / "victim.txt", "mine\n");
    write_zip(folder / name, {{"victim.txt", "from the archive\n"}, {"sub/evil.sh", "echo\n"}});
    EXPECT_THROW((void)open_source(folder / name), std::runtime_error);
    EXPECT_EQ(read_bytes(unpacking.place() / "victim.txt"), "mine\n");
    EXPECT_FALSE(fs::exists(unpacking.place() / "sub"));
    write("tum", folder / "scan");
    write_zip(folder / name, entries_of(folder / "scan"));
    expect_same(folder / name, folder / "scan");
    EXPECT_FALSE(fs::exists(unpacking.place() / "rgb.txt"));
    fs::remove_all(folder / "scan");
  }
}

TEST(ZipRecording, RejectsInvalidNames) {
  const Unpacking unpacking;
  const TemporaryFolder folder;
  const auto archive = folder / "a.zip";
  write_zip(archive, {{std::string(300, 'x') + "/rgb.txt", "nothing"}});
  expect_error(archive, "which has too long a name");
  std::string far;
  for (int i = 0; i < 1500; ++i) far += "a/";
  write_zip(archive, {{far + "rgb.txt", "nothing"}});
  expect_error(archive, "which has too long a name");
  write_zip(archive, {{"a/rgb.txt", "one"}, {"a/./rgb.txt", "other"}});
  expect_error(archive, "has 'a/rgb.txt' twice");
}

/// Overwrites the file sizes in an archive's directory.
void tell_sizes(const fs::path& archive, std::uint32_t size) {
  std::string bytes = read_bytes(archive);
  for (std::size_t at = 0; (at = bytes.find("PK\1\2", at)) != bytes.npos; ++at)
    bytes.replace(at + 24, 4, reinterpret_cast<const char*>(&size), 4);
  write_text(archive, bytes);
}

TEST(ZipRecording, DoesNotFillDisk) {
  const Unpacking unpacking;
  const TemporaryFolder folder;
  write_zip(folder / "a.zip", {{"rgb.txt", std::string(1000, 'x')}, {"depth.txt", std::string(1000, 'y')}});
  tell_sizes(folder / "a.zip", 0xf0000000u);
  expect_error(folder / "a.zip", "would unpack to 7680 MiB, more than 200 times its size");
  // Content beyond the declared size is cut off.
  write_zip(folder / "b.zip", {{"rgb.txt", std::string(5u << 20, 'x')}, {"depth.txt", "1 1.png\n"}});
  tell_sizes(folder / "b.zip", 8);
  testing::internal::CaptureStdout();
  EXPECT_THROW((void)open_source(folder / "b.zip"), std::runtime_error);
  EXPECT_NE(testing::internal::GetCapturedStdout().find("1 of 2 files in it are damaged"), std::string::npos);
}

TEST(ZipRecording, RemovesLeftoversOfKilledPrograms) {
  const TemporaryFolder folder;
  write_zip(folder / "a.zip", {{"scan/", ""}});
  const Unpacking unpacking;
  const auto folder_of = [&](const char* name, int minutes) {
    const fs::path made = unpacking.place() / name;
    fs::create_directories(made / "scan");
    fs::last_write_time(made, fs::file_time_type::clock::now() - std::chrono::minutes(minutes));
    return made;
  };
  const auto left = folder_of("cairn-unpacked-1", 10), young = folder_of("cairn-unpacked-2", 0),
             held = folder_of("cairn-unpacked-3", 10), other = folder_of("other", 10),
             own = folder_of("cairn-unpacked-mine", 10);
  for (const auto& marked : {left, young, held, other}) {
    const auto written = fs::last_write_time(marked);
    write_text(marked / ".cairn-unpacked", "A .zip file that cairn unpacks here while it reads it, and removes.\n");
    fs::last_write_time(marked, written);
  }
  {
    const auto lock = FileLock::take(held, FileLock::Kind::exclusive);
    EXPECT_THROW((void)unpacked(folder / "a.zip"), std::runtime_error);
    EXPECT_FALSE(fs::exists(left));
    for (const auto& kept : {young, held, other, own}) EXPECT_TRUE(fs::exists(kept)) << kept;
  }
  for (const auto& kept : {young, held, other, own}) fs::remove_all(kept);
}

TEST(ZipRecording, IsReconstructedResumedAndRemovedByTheProgram) {
  const TemporaryFolder folder, place;
  const std::string scan = folder / "scan", archive = folder / "scan.zip",
                    in = "TMPDIR='" + place.path().string() + "'";
  write_small_recording(scan, {.frames = 24});
  write_zip(archive, entries_of(scan, "scan/"));
  const auto run = [&](const std::string& sequence, const char* out, std::vector<std::string> more) {
    more.insert(more.begin(),
                {"reconstruct", "--no-texture", sequence, "-o", folder / out, "--config", scan + ".yaml"});
    const Ran ran = run_cairn(more, in);
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_TRUE(fs::is_empty(place.path()));
    return read_bytes(folder / out / "trajectory.txt");
  };
  const auto expected = run(scan, "whole", {});
  run(archive, "map", {"--frames", "0:12"});
  fs::copy(archive, folder / "again.zip");  // recognized by its images
  EXPECT_EQ(run(folder / "again.zip", "map", {"--resume"}), expected);
  const Ran info = run_cairn({"info", archive}, in), json = run_cairn({"info", archive, "--json"}, in);
  EXPECT_NE(info.out.find("layout          TUM RGB-D folder, packed as .zip\n"), std::string::npos) << info.out;
  EXPECT_NE(json.out.find("\"layout\": \"TUM RGB-D folder, packed as .zip\""), std::string::npos) << json.out;
  fs::resize_file(archive, fs::file_size(archive) / 2);
  expect_one_line(run_cairn({"info", archive}, in), 1, "scan.zip: is cut off");
  EXPECT_TRUE(fs::is_empty(place.path()));
}

}  // namespace
}  // namespace cairn
