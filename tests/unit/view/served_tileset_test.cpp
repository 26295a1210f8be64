// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/served_tileset.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/json_text.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Files = std::map<std::string, Served>;

/// Response to a page's request for a tileset.
std::string made(const Served& served) {
  return std::get<std::shared_ptr<const Text>>(std::get<Make>(served.body).make())->bytes();
}

std::string tileset(const std::string& uris) { return R"({"root":{"children":[)" + uris + "]}}"; }
std::string tile(const std::string& uri) { return R"({"content":{"uri":")" + uri + R"("}})"; }

std::vector<std::string> names(const Files& files) {
  std::vector<std::string> names;
  for (const auto& [name, file] : files) names.push_back(name);
  return names;
}

class ServedTileset : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(home / "tiles/1, 2/x");
    write_text(home / "tiles/1, 2/x/a.glb", "a");
    write_text(home / "tiles/1, 2/tileset.json", tileset(tile("x/a.glb")));
    write_text(home / "plan.json", "{}");
    write_text(folder / "secret.glb", "s");
  }
  Files served() {
    return served_tileset(home / "tileset.json", [this](Files&& files) { added = std::move(files); });
  }
  TemporaryFolder folder;
  fs::path home = folder / "home";
  Files added;
};

TEST_F(ServedTileset, ServesReferencedFilesOnRequest) {
  write_text(home / "tileset.json", tileset(tile(as_uri("tiles/1, 2/tileset.json") + "?v=1")));
  const Files files = served();
  EXPECT_EQ(names(files), (std::vector<std::string>{"data.json", "tileset/tileset.json"}));
  const auto data = nlohmann::json::parse(std::get<std::string>(files.at("data.json").body));
  EXPECT_EQ(data["tileset"], "tileset/tileset.json");
  EXPECT_EQ(data["name"], "home");
  EXPECT_TRUE(added.empty());
  EXPECT_NE(made(files.at("tileset/tileset.json")).find("%2C"), std::string::npos);
  const std::string nested = "tileset/tiles/1%2C%202/tileset.json";
  ASSERT_EQ(names(added), std::vector<std::string>{nested});
  (void)made(Files(added).at(nested));
  const std::string content = "tileset/tiles/1%2C%202/x/a.glb";
  ASSERT_EQ(names(added), std::vector<std::string>{content});
  EXPECT_EQ(std::get<fs::path>(added.at(content).body), fs::canonical(home) / "tiles/1, 2/x/a.glb");
}

TEST_F(ServedTileset, ServesNothingOutsideOfItsFolder) {
  write_text(home / "notes.txt", "private");
  fs::create_symlink(folder / "secret.glb", home / "link.glb");
  fs::create_symlink(home / "notes.txt", home / "notes.glb");
  std::string uris;
  for (const char* uri : {"../secret.glb", "%2e%2e/secret.glb", "tiles/../../secret.glb", "https://example.com/x.glb",
                          "link.glb", "notes.glb", "notes.txt", "notes.txt%00.glb", "missing.glb", "", "."})
    uris += tile(uri) + ",";
  const std::string absolute = tile((folder / "secret.glb").string());
  write_text(home / "tileset.json", tileset(uris + absolute));
  (void)made(served().at("tileset/tileset.json"));
  EXPECT_EQ(names(added), std::vector<std::string>{});
}

TEST_F(ServedTileset, ReportsMissingPartsOfAPlan) {
  write_text(home / "tileset.json", tileset(tile("missing.glb")));
  write_text(home / "plan.json", R"({"kind": "cairn plan", "format": 1, "frames_per_part": 10, "overlap": 0,
    "recordings": [{"name": "/a<b>", "frames": 10}, {"name": "/c", "frames": 10}],
    "parts": [{"name": "000", "recording": 0, "begin": 0, "end": 10}, {"name": "001", "recording": 1, "begin": 0, "end": 10}]})");
  const auto verdict = [&] {
    return nlohmann::json::parse(std::get<std::string>(served().at("data.json").body)).at("verdict");
  };
  EXPECT_TRUE(verdict().is_null());
  const std::string first = R"({"parts": [{"name": "000", "recording": 0, "joined": true})";
  write_text(home / "report.json", first + R"(, {"name": "001", "recording": 1, "joined": true}]})");
  EXPECT_EQ(verdict().at("level"), "good");
  write_text(home / "report.json",
             first + R"(, {"name": "001", "recording": 1, "joined": false, "left_out": "it has no map"}]})");
  EXPECT_EQ(verdict().at("level"), "bad");
  EXPECT_EQ(verdict().at("words"),
            "1 of 2 parts are in the map, with 50 % of the frames; 1 of 2 recordings is partly or entirely missing");
  EXPECT_EQ(verdict().at("reasons").at(0), "part 001 (/c, frames 0 to 9) is not in the map: it has no map");
  write_text(home / "report.json", first + "]}");
  EXPECT_NE(verdict().at("reasons").at(0).get<std::string>().find("it was added after the merge"), std::string::npos);
}

TEST_F(ServedTileset, RejectsPlansWithoutTileset) {
  const auto error_for = [](const fs::path& map) { return error_of([&] { (void)tileset_of(map); }); };
  EXPECT_NE(error_for(home).find("cairn tileset " + home.string()), std::string::npos);
  EXPECT_EQ(tileset_of(folder.path()), std::nullopt);
  EXPECT_EQ(tileset_of(folder / "secret.glb"), std::nullopt);
  for (const char* text : {"solid", "{}", R"({"root":1})", "[]"}) {
    write_text(home / "tileset.json", text);
    EXPECT_NE(error_of([&] { (void)served(); }).find("is not a tileset: "), std::string::npos) << text;
  }
  EXPECT_EQ(tileset_of(home), home / "tileset.json");
}

}  // namespace
}  // namespace cairn
