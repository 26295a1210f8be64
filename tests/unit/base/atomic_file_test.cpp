// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/atomic_file.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <set>

#include "base/file_lock.hpp"
#include "base/system_file.hpp"
#include "base/writable_folder.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// Limits the size of files during its lifetime.
class FilesOf {
 public:
  explicit FilesOf(rlim_t bytes) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit now{bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &now);
  }
  ~FilesOf() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, signal_);
  }
  FilesOf(const FilesOf&) = delete;
  FilesOf& operator=(const FilesOf&) = delete;

 private:
  rlimit before_{};
  void (*signal_)(int) = std::signal(SIGXFSZ, SIG_IGN);
};

TEST(WriteWhole, KeepsOldFileOnError) {
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

TEST(WriteWhole, ReportsSystemErrorAndRemedy) {
  // A missing folder and a full disk, each with its remedy.
  EXPECT_NE(error_of([&] { write_whole("/proc/self/a.txt", "text"); }).find("make the folder first"),
            std::string::npos);
  EXPECT_EQ(reason(ENOSPC).find("the disk is full (No space left on device): make room"), 0u);
  // A file size limit acts as a full disk; callers need no check of their own.
  const TemporaryFolder folder;
  for (const bool as_stream : {false, true}) {
    const FilesOf limit(1 << 20);
    const std::string much(3 << 20, 'x');
    const std::string error = error_of([&] {
      if (as_stream)
        write_whole(folder / "a.txt", [&](std::ostream& out) { out << much; });
      else
        write_whole(folder / "a.txt", much);
    });
    EXPECT_NE(error.find("a.txt: File too large: raise the limit on files"), std::string::npos) << error;
    EXPECT_TRUE(fs::is_empty(folder.path()));
  }
}

TEST(WriteWhole, KeepsFileWithNameOfTemporary) {
  const TemporaryFolder folder;
  const std::string name = ".cairn-" + std::to_string(getpid()) + ".a.txt";
  write_text(folder / "victim", "mine");
  write_text(folder / name, "mine");
  fs::create_symlink(folder / "victim", folder / (".cairn-" + std::to_string(getpid()) + ".1.a.txt"));
  write_whole(folder / "a.txt", "text");
  EXPECT_EQ(read_bytes(folder / "a.txt"), "text");
  EXPECT_EQ(read_bytes(folder / "victim"), "mine");
  EXPECT_EQ(read_bytes(folder / name), "mine");
}

TEST(WriteWhole, ChecksFolderWithoutChangingFiles) {
  const TemporaryFolder folder;
  write_text(folder / ".cairn", "mine");
  const auto before = bytes_below(folder.path());
  expect_writable(folder.path());
  EXPECT_TRUE(bytes_below(folder.path()) == before);
  EXPECT_NE(error_of([] { expect_writable("/proc/self"); }).find("cannot write /proc/self: "), std::string::npos);
}

TEST(WriteWhole, SeeksInStream) {
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

TEST(WriteWhole, RemovesOnlyLeftoversOfKilledPrograms) {
  const TemporaryFolder folder;
  for (const char* name : {".cairn-4711.a.txt", ".cairn-4711.b.txt", ".cairn-x.txt", ".cairn-", ".hidden", "a.txt"})
    write_text(folder / name, "something");
  // The temporary file of this program, in use.
  write_whole(folder / "b.txt", [&](std::ostream&) {
    remove_leftovers(folder.path());
    EXPECT_TRUE(fs::exists(folder / (".cairn-" + std::to_string(getpid()) + ".b.txt")));
  });
  std::set<std::string> left;
  for (const auto& entry : fs::directory_iterator(folder.path())) left.insert(entry.path().filename().string());
  EXPECT_EQ(left, (std::set<std::string>{".cairn-x.txt", ".cairn-", ".hidden", "a.txt", "b.txt"}));
}

TEST(WriteWhole, NamesMissingFolder) {
  const TemporaryFolder folder;
  EXPECT_NE(error_of([&] { write_whole(folder / "no" / "a.txt", "text"); }).find("cannot write"), std::string::npos);
}

TEST(WriteFolder, AppearsWhenComplete) {
  const TemporaryFolder above;
  const fs::path folder = above / "a";
  const auto write = [](const char* text) { return [=](const fs::path& part) { write_text(part / "mark", text); }; };
  write_folder(folder, write("first"));
  EXPECT_EQ(read_bytes(folder / "mark"), "first");
  EXPECT_NE(error_of([&] { write_folder(folder, write("second")); }).find("has other content"), std::string::npos);
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

TEST(WriteFolder, KeepsNeighborsOfAnyName) {
  const TemporaryFolder above;
  const std::string own = ".cairn-" + std::to_string(getpid()) + ".a";
  for (const std::string& name : {std::string("a.part"), std::string(".cairn-4711.a"), own}) {
    fs::create_directory(above / name);
    write_text(above / name / "thesis.txt", "mine");
  }
  const auto before = bytes_below(above.path());
  write_folder(above / "a", [](const fs::path& part) {
    EXPECT_EQ(part.filename(), "a");
    write_text(part / "new.txt", "new");
  });
  EXPECT_EQ(read_bytes(above / "a" / "new.txt"), "new");
  fs::remove_all(above / "a");
  EXPECT_TRUE(bytes_below(above.path()) == before);
}

TEST(WriteFolder, KeepsFilesCreatedMeanwhile) {
  const TemporaryFolder above;
  EXPECT_NE(error_of([&] {
              write_folder(above / "a", [&](const fs::path& part) {
                write_text(part / "new.txt", "new");
                fs::create_directory(above / "a");
                write_text(above / "a" / "thesis.txt", "mine");
              });
            }).find("has other content"),
            std::string::npos);
  EXPECT_EQ(read_bytes(above / "a" / "thesis.txt"), "mine");
  EXPECT_EQ(std::distance(fs::directory_iterator(above.path()), {}), 1);
}

/// Staging folder left by a killed program.
void leave_staging(const fs::path& folder) {
  fs::create_directories(folder);
  write_text(folder / ".cairn-mark", "A folder that cairn makes for what it writes, and removes.\n");
}

TEST(WriteFolder, RemovesMarkedUnlockedLeftover) {
  const TemporaryFolder above;
  for (const char* name : {".cairn-4711.left", ".cairn-4711.held", ".cairn-4711.2.left"}) {
    leave_staging(above / name);
    fs::create_directory(above / name / "left");
    write_text(above / name / "left" / "half.txt", "half");
  }
  fs::create_directory(above / ".cairn-4711.mine");
  write_text(above / ".cairn-4711.mine" / ".cairn-mark", "another text");
  {
    const auto held = FileLock::take(above / ".cairn-4711.held" / ".cairn-mark", FileLock::Kind::exclusive);
    remove_leftovers(above.path());
    EXPECT_FALSE(fs::exists(above / ".cairn-4711.left"));
    EXPECT_FALSE(fs::exists(above / ".cairn-4711.2.left"));
    EXPECT_TRUE(fs::exists(above / ".cairn-4711.held" / "left" / "half.txt"));
  }
  remove_leftovers(above.path());
  EXPECT_FALSE(fs::exists(above / ".cairn-4711.held"));
  EXPECT_EQ(read_bytes(above / ".cairn-4711.mine" / ".cairn-mark"), "another text");
}

TEST(WriteFolder, RestoresFolderMovedAsideByKilledProgram) {
  const TemporaryFolder above;
  const auto leave = [&](bool has_content) {
    leave_staging(above / ".cairn-4711.a");
    fs::create_directory(above / ".cairn-4711.a" / ".cairn-aside");
    write_text(above / ".cairn-4711.a" / ".cairn-aside" / "old.txt", "old");
    if (has_content) fs::create_directory(above / ".cairn-4711.a" / "a");
  };
  leave(true);
  remove_leftovers(above.path());
  EXPECT_EQ(read_bytes(above / "a" / "old.txt"), "old");
  EXPECT_FALSE(fs::exists(above / ".cairn-4711.a"));
  // Another folder has taken the place: no files are removed.
  leave(true);
  remove_leftovers(above.path());
  EXPECT_EQ(read_bytes(above / ".cairn-4711.a" / ".cairn-aside" / "old.txt"), "old");
  // The new folder was already in place.
  fs::remove_all(above / ".cairn-4711.a");
  leave(false);
  remove_leftovers(above.path());
  EXPECT_FALSE(fs::exists(above / ".cairn-4711.a"));
  EXPECT_EQ(read_bytes(above / "a" / "old.txt"), "old");
}

}  // namespace
}  // namespace cairn
