// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/unfinished.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <functional>
#include <utility>

#include "base/atomic_file.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// Runs `work` in a child process, which may exit in the middle of it.
void end_within(const std::function<void(const std::function<void()>& end)>& work) {
  const pid_t child = fork();
  if (child == 0) {
    work([] {
      remove_unfinished();
      _exit(0);
    });
    _exit(1);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
}

TEST(Unfinished, RemovesOnlyRegisteredFiles) {
  const TemporaryFolder folder;
  fs::create_directories(folder / "made/below");
  fs::create_directories(folder / "kept");
  fs::create_directory_symlink(folder / "kept", folder / "link");
  for (const char* file : {"made/below/a", "kept/b", "c", "done"}) write_text(folder / file, "x");
  fs::create_directories(folder / "empty");
  end_within([&](const auto& end) {
    const Unfinished made(folder / "made"), link(folder / "link"), file(folder / "c"),
        full(folder / "kept", Unfinished::Kind::empty), empty(folder / "empty", Unfinished::Kind::empty);
    { const Unfinished done(folder / "done"); }
    end();
  });
  for (const char* name : {"made", "link", "c", "empty"})
    EXPECT_FALSE(fs::exists(fs::symlink_status(folder / name))) << name;
  for (const char* name : {"kept/b", "done"}) EXPECT_TRUE(fs::exists(folder / name)) << name;
}

TEST(Unfinished, FilesAndFoldersAreCompleteOrAbsent) {
  const TemporaryFolder folder;
  write_text(folder / "old", "before");
  end_within([&](const auto& end) {
    write_whole(folder / "old", [&](std::ostream& out) {
      out << "half" << std::flush;
      end();
    });
  });
  end_within([&](const auto& end) {
    write_folder(folder / "new", [&](const fs::path& part) {
      write_text(part / "half", "");
      end();
    });
  });
  EXPECT_EQ(bytes_below(folder.path()), (std::map<std::string, std::string>{{"old", "before"}}));
}

}  // namespace
}  // namespace cairn
