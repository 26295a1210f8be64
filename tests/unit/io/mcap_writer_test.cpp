// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/ros/mcap_writer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "io/ros/ros_recording.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

struct Read {
  std::string topic, bytes;
  long long time;  // ns
  friend bool operator==(const Read&, const Read&) = default;
};

std::vector<Read> read(RosRecording& recording) {
  std::vector<Read> all;
  while (const auto m = recording.next())
    all.push_back(
        {recording.topics()[m->topic].name, {m->bytes.begin(), m->bytes.end()}, std::llround(1e9 * m->received)});
  return all;
}

/// Writes two topics with incompressible messages, large enough for several chunks.
std::vector<Read> write(McapWriter& writer) {
  const auto a = writer.add({"/a", "protobuf", "x.A", "protobuf", "what A is"});
  std::optional<std::uint16_t> b;
  std::mt19937 random(1);
  std::vector<Read> all;
  for (int i = 0; i < 40; ++i) {
    std::string bytes(i % 3 == 0 ? 200'000 : 10, '\0');
    for (char& c : bytes) c = static_cast<char>(random());
    if (i == 20) b = writer.add({"/b", "json", "x.B", "jsonschema", "{}"});
    const bool is_b = b && i % 2 == 0;
    writer.write(is_b ? *b : a, static_cast<std::uint64_t>(i) * 1'000'000'000, bytes);
    all.push_back({is_b ? "/b" : "/a", bytes, i * 1'000'000'000LL});
  }
  return all;
}

TEST(McapWriter, RoundTrips) {
  const TemporaryFolder folder;
  McapWriter writer(folder / "x.mcap");
  const auto all = write(writer);
  writer.finish();
  const auto recording = open_mcap(folder / "x.mcap");
  ASSERT_EQ(recording->topics().size(), 2u);
  EXPECT_EQ(recording->topics()[0].type, "x.A");
  EXPECT_EQ(recording->topics()[0].messages, 30u);  // from the summary
  EXPECT_EQ(recording->topics()[1].messages, 10u);
  EXPECT_TRUE(read(*recording) == all);
  EXPECT_FALSE(recording->ended_early());
}

TEST(McapWriter, KeepsCompleteChunksWithoutEnd) {
  const TemporaryFolder folder;
  std::vector<Read> all;
  {
    McapWriter writer(folder / "x.mcap");
    all = write(writer);
  }
  const auto recording = open_mcap(folder / "x.mcap");
  const auto some = read(*recording);
  EXPECT_GT(some.size(), 20u);
  EXPECT_LT(some.size(), all.size());
  EXPECT_TRUE(std::equal(some.begin(), some.end(), all.begin()));
  EXPECT_NE(recording->ended_early().value_or("").find("was never finished"), std::string::npos);
}

TEST(McapWriter, WritesEmptyFile) {
  const TemporaryFolder folder;
  McapWriter(folder / "x.mcap").finish();
  EXPECT_TRUE(open_mcap(folder / "x.mcap")->topics().empty());
}

TEST(McapWriter, ReportsWriteError) {
  const TemporaryFolder folder;
  const std::string error = error_of([&] { McapWriter(folder / "none" / "x.mcap"); });
  EXPECT_NE(error.find("none/x.mcap: No such file or directory: make the folder first"), std::string::npos) << error;
}

}  // namespace
}  // namespace cairn
