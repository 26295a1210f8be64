// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/atomic_file.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <set>

#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

TEST(WriteWhole, LeavesTheOldFileWhenWritingFails) {
  const TemporaryFolder folder;
  write_text(folder / "a.txt", "old");
  EXPECT_THROW(write_whole(folder / "a.txt",
                           [](std::ostream& out) {
                             out << "half";
                             throw std::runtime_error("something went wrong");
                           }),
               std::runtime_error);
  EXPECT_EQ(read_bytes(folder / "a.txt"), "old");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST(WriteWhole, TellsTheSystemsReasonAndWhatToDo) {
  // /dev/full is a disk without room; whoever writes need not look after it.
  EXPECT_NE(error_of([&] { write_whole("/proc/self/a.txt", "text"); }).find("make the folder first"),
            std::string::npos);
  const TemporaryFolder folder;
  const fs::path link = folder / (".cairn-" + std::to_string(getpid()) + ".a.txt");
  for (const bool as_stream : {false, true}) {
    fs::create_symlink("/dev/full", link);
    const std::string error = error_of([&] {
      if (as_stream)
        write_whole(folder / "a.txt", [](std::ostream& out) { out << std::string(3 << 20, 'x'); });
      else
        write_whole(folder / "a.txt", "text");
    });
    EXPECT_NE(error.find("a.txt: the disk is full (No space left on device): make room"), std::string::npos) << error;
    EXPECT_TRUE(fs::is_empty(folder.path()));
  }
}

TEST(WriteWhole, SeeksInTheStreamAsInAFile) {
  const TemporaryFolder folder;
  const std::string much(3 << 20, 'x');
  write_whole(folder / "a.txt", [&](std::ostream& out) {
    out << much;
    EXPECT_EQ(out.tellp(), std::streampos(3 << 20));
    out.seekp(2) << "ab";
    out.seekp(0, std::ios::end) << "end";
  });
  std::string expected = much + "end";
  expected.replace(2, 2, "ab");
  EXPECT_TRUE(read_bytes(folder / "a.txt") == expected);
}

TEST(WriteWhole, LeftoversOfKilledProgramsGoAndThoseOfRunningOnesStay) {
  const TemporaryFolder folder;
  for (const char* name : {".cairn-4711.a.txt", ".cairn-4711.b.txt", ".cairn-x.txt", ".cairn-", ".hidden", "a.txt"})
    write_text(folder / name, "something");
  // The one of this program, which writes just now.
  write_whole(folder / "b.txt", [&](std::ostream&) {
    remove_leftovers(folder.path());
    EXPECT_TRUE(fs::exists(folder / (".cairn-" + std::to_string(getpid()) + ".b.txt")));
  });
  std::set<std::string> left;
  for (const auto& entry : fs::directory_iterator(folder.path())) left.insert(entry.path().filename().string());
  EXPECT_EQ(left, (std::set<std::string>{".cairn-x.txt", ".cairn-", ".hidden", "a.txt", "b.txt"}));
}

TEST(WriteWhole, NamesTheFolderThatIsMissing) {
  const TemporaryFolder folder;
  EXPECT_NE(error_of([&] { write_whole(folder / "no" / "a.txt", "text"); }).find("cannot write"), std::string::npos);
}

TEST(WriteFolder, TakesItsPlaceWhenItIsWhole) {
  const TemporaryFolder above;
  const fs::path folder = above / "a";
  const auto write = [](const char* text) { return [=](const fs::path& part) { write_text(part / "mark", text); }; };
  write_folder(folder, write("first"));
  EXPECT_EQ(read_bytes(folder / "mark"), "first");
  EXPECT_NE(error_of([&] { write_folder(folder, write("second")); }).find("holds something else"), std::string::npos);
  EXPECT_NE(error_of([&] { write_folder(folder, write("second"), "other"); }).find("choose another"),
            std::string::npos);
  EXPECT_EQ(error_of([&] {
              write_folder(
                  folder,
                  [&](const fs::path& part) {
                    write("second")(part);
                    throw std::runtime_error("something went wrong");
                  },
                  "mark");
            }),
            "something went wrong");
  EXPECT_EQ(read_bytes(folder / "mark"), "first");
  write_folder(folder, write("second"), "mark");
  EXPECT_EQ(read_bytes(folder / "mark"), "second");
  EXPECT_EQ(std::distance(fs::directory_iterator(above.path()), {}), 1);
  EXPECT_NE(error_of([&] { write_folder("/proc/self/a", write("")); }).find("cannot write /proc/self/a: "),
            std::string::npos);
}

}  // namespace
}  // namespace cairn
