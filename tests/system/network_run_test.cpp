// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// The program with frames over TCP and WebSockets.
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "support/files.hpp"
#include "support/network_client.hpp"
#include "support/recordings.hpp"
#include "support/running.hpp"

namespace cairn {
namespace {

using Json = nlohmann::json;

class NetworkRun : public testing::Test {
 protected:
  NetworkRun() { write_small_recording(folder / "recording", {.frames = kFrames}); }
  [[nodiscard]] std::string out(const std::string& name) const { return (folder / name).string(); }
  [[nodiscard]] std::vector<std::string> options(std::vector<std::string> words, const std::string& output) const {
    for (const char* word : {"--no-texture", "--quality", "fast", "--config"}) words.emplace_back(word);
    words.insert(words.end(), {out("recording.yaml"), "-o", out(output)});
    return words;
  }
  static Json hello() {
    return {{"cairn", 1},
            {"camera",
             {{"width", 160},
              {"height", 120},
              {"fx", 131.25},
              {"fy", 131.25},
              {"cx", 79.5},
              {"cy", 59.5},
              {"depth_scale", 5000}}}};
  }
  /// Sends the stored images of the recording, without waiting for the answers, and returns the last answer.
  [[nodiscard]] Json send_all(NetworkClient& client) const {
    std::ifstream depths(folder / "recording" / "depth.txt"), colors(folder / "recording" / "rgb.txt");
    std::string time, depth, color, ignored;
    int frames = 0;
    while (next_line(depths, time, depth) && next_line(colors, ignored, color)) {
      const std::string z = read_bytes(folder / "recording" / depth), rgb = read_bytes(folder / "recording" / color);
      const Json header{{"frame", frames++},
                        {"time", std::stod(time)},
                        {"depth", {{"format", "png"}, {"bytes", z.size()}}},
                        {"color", {{"format", color.ends_with("png") ? "png" : "jpeg"}, {"bytes", rgb.size()}}}};
      client.send(message_of(header, z + rgb));
    }
    EXPECT_EQ(frames, kFrames);
    Json answer;
    for (int i = 0; i < frames; ++i) answer = client.answer();
    return answer;
  }
  static bool next_line(std::istream& lines, std::string& time, std::string& file) {
    std::string line;
    while (std::getline(lines, line))
      if (!line.empty() && line[0] != '#') return static_cast<bool>(std::istringstream(line) >> time >> file);
    return false;
  }

  static constexpr int kFrames = 20;
  TemporaryFolder folder;
};

TEST_F(NetworkRun, MapEqualsTheMapOfTheRecording) {
  ASSERT_EQ(run_cairn(options({"reconstruct", out("recording")}, "reconstructed")).exit_code, 0);
  for (const std::string scheme : {"tcp", "ws"}) {
    SCOPED_TRACE(scheme);
    const std::string input = scheme + ":" + std::to_string(free_port());
    Running program(options({"live", input, "--as-fast-as-possible"}, scheme), folder.path());
    NetworkClient client(input);
    ASSERT_TRUE(client.ask(message_of(hello())).contains("cairn"));
    const Json last = send_all(client);
    EXPECT_EQ(last["frame"], kFrames - 1);
    EXPECT_EQ(last["dropped"], 0);
    EXPECT_EQ(client.ask(message_of(Json{{"end", true}})), (Json{{"end", true}}));
    const Ran ran = program.end();
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    for (const char* file : {"map.vdb", "trajectory.txt"})
      EXPECT_TRUE(read_bytes(folder / scheme / file) == read_bytes(folder / "reconstructed" / file)) << file;
  }
}

TEST_F(NetworkRun, AnswersTheTrackingState) {
  const std::string input = "tcp:" + std::to_string(free_port());
  Running program(options({"live", input}, "live"), folder.path());
  NetworkClient client(input);
  ASSERT_TRUE(client.ask(message_of(hello())).contains("cairn"));
  Json answer = Json::object();
  std::string depth;  // a wall at 1.8 to 2.1 m
  for (std::uint32_t i = 0; i < 160 * 120; ++i) depth += little_endian(9000 + 10 * (i % 160)).substr(0, 2);
  for (int i = 0; i < 100 && answer["state"] != "tracking"; ++i) {
    const Json header{{"frame", i}, {"time", 0.1 * i}, {"depth", {{"format", "uint16"}, {"bytes", depth.size()}}}};
    answer = client.ask(message_of(header, depth));
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  EXPECT_EQ(answer["state"], "tracking");
  EXPECT_TRUE(client.ask(message_of(Json{{"end", true}})).contains("end"));
  const Ran ran = program.end();
  EXPECT_NE(ran.err.find("waiting for a client at tcp://127.0.0.1:"), std::string::npos) << ran.err;
}

TEST_F(NetworkRun, RecordsAClientThatConnectsAgain) {
  const std::string input = "ws:" + std::to_string(free_port());
  Running program({"record", input, "-o", out("recorded"), "--color", "png", "--json"}, folder.path());
  for (int i = 0; i < 2; ++i) {
    NetworkClient client(input);
    ASSERT_TRUE(client.ask(message_of(hello())).contains("cairn"));
    EXPECT_EQ(send_all(client)["state"], "received");
    if (i == 1) {
      EXPECT_TRUE(client.ask(message_of(Json{{"end", true}})).contains("end"));
    }
  }
  const Ran ran = program.end();
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  EXPECT_EQ(Json::parse(ran.out)["frames"], 2 * kFrames);
  EXPECT_NE(ran.err.find(input + ": a client is connected again"), std::string::npos) << ran.err;
}

TEST_F(NetworkRun, EndsAtCtrlCBeforeTheFirstClient) {
  const std::string input = "tcp:" + std::to_string(free_port());
  Running program(options({"live", input}, "live"), folder.path());
  ASSERT_TRUE(program.wait_until([&] { return program.err().find("waiting for a client") != std::string::npos; }));
  program.send(SIGINT);
  EXPECT_EQ(program.end().exit_code, 130);
  EXPECT_FALSE(std::filesystem::exists(folder / "live"));
}

TEST_F(NetworkRun, PortInUseIsReportedInOneLine) {
  const std::string input = "tcp:" + std::to_string(free_port());
  Running program(options({"live", input}, "live"), folder.path());
  ASSERT_TRUE(program.wait_until([&] { return program.err().find("waiting for a client") != std::string::npos; }));
  expect_one_line(run_cairn(options({"live", input}, "other")), 1, "cannot be used");
  expect_one_line(run_cairn(options({"live", "tcp:x"}, "other")), 1, "tcp:x: use tcp:PORT or tcp:HOST:PORT");
}

}  // namespace
}  // namespace cairn
