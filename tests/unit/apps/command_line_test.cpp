// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "apps/cli/command_line.hpp"

#include <gtest/gtest.h>

#include "base/quoted.hpp"

namespace cairn::apps {
namespace {

TEST(ResumeCommand, AddsResumeToTheCommand) {
  EXPECT_EQ(resume_command({"cairn", "reconstruct", "rec", "-o", "out"}, "out", "out"),
            "cairn reconstruct rec -o out --resume");
  // Arguments that already decide about an earlier map get no second option.
  EXPECT_EQ(resume_command({"cairn", "live", "rec", "out", "--overwrite"}, "out", "out"),
            "cairn live rec out --resume");
  EXPECT_EQ(resume_command({"cairn", "live", "rec", "out", "--resume", "--json"}, "out", "out"),
            "cairn live rec out --resume --json");
}

TEST(ResumeCommand, UsesTheWrittenFolder) {
  const auto line = [](std::vector<std::string> words) { return resume_command(std::move(words), "out/", "out-2"); };
  EXPECT_EQ(line({"cairn", "reconstruct", "rec", "out/", "--auto-name"}), "cairn reconstruct rec out-2 --resume");
  EXPECT_EQ(line({"cairn", "reconstruct", "-o", "out/", "rec", "--auto-name"}),
            "cairn reconstruct -o out-2 rec --resume");
  EXPECT_EQ(line({"cairn", "reconstruct", "-oout/", "rec", "--auto-name"}), "cairn reconstruct -oout-2 rec --resume");
  EXPECT_EQ(line({"cairn", "reconstruct", "--auto-name", "--output=out/", "rec"}),
            "cairn reconstruct --output=out-2 rec --resume");
  // Another option with the same value stays.
  EXPECT_EQ(line({"cairn", "reconstruct", "-o", "out/", "rec", "--auto-name", "--title", "out/"}),
            "cairn reconstruct -o out-2 rec --title out/ --resume");
}

TEST(ResumeCommand, QuotesForTheShell) {
  EXPECT_EQ(quoted("rec/a_1.bag"), "rec/a_1.bag");
  EXPECT_EQ(quoted(""), "''");
  EXPECT_EQ(quoted("my scan"), "'my scan'");
  EXPECT_EQ(quoted("it's $HOME"), "'it'\\''s $HOME'");
  EXPECT_EQ(quoted(std::filesystem::path("-scan")), "./-scan");
  EXPECT_EQ(resume_command({"cairn", "reconstruct", "my scan", "out"}, "out", "out"),
            "cairn reconstruct 'my scan' out --resume");
}

}  // namespace
}  // namespace cairn::apps
