// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <variant>

#include "cairn/mapping/mesh.hpp"
#include "net/file_below.hpp"
#include "support/files.hpp"
#include "support/meshes.hpp"
#include "view/finished_map.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> names(const std::map<std::string, Served>& files) {
  std::vector<std::string> names;
  for (const auto& [name, file] : files) names.push_back(name);
  return names;
}

class ServedFile : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(home / "textures");
    fs::create_directories(folder / "elsewhere");
    write_text(folder / "secret.bin", "secret");
    write_text(folder / "elsewhere" / "secret.bin", "secret");
  }
  /// Writes a glTF with these buffers and images.
  fs::path gltf(const std::vector<std::string>& buffers, const std::vector<std::string>& images = {}) {
    nlohmann::json json{{"asset", {{"version", "2.0"}}}};
    for (const auto& uri : buffers) json["buffers"].push_back({{"uri", uri}});
    for (const auto& uri : images) json["images"].push_back({{"uri", uri}});
    write_text(home / "m.gltf", json.dump());
    return home / "m.gltf";
  }
  TemporaryFolder folder;
  fs::path home = folder / "home";
};

TEST_F(ServedFile, ServesTheBuffersAndImagesOfAGltf) {
  for (const char* name : {"m.bin", "textures/my image.png", "a.jpg", "b.jpeg", "c.webp", "d.ktx2"})
    write_text(home / name, "x");
  const auto files = served_file(gltf({"m.bin"}, {"textures/my%20image.png", "a.jpg", "b.jpeg", "c.webp", "d.ktx2"}));
  EXPECT_EQ(names(files),
            (std::vector<std::string>{"a.jpg", "b.jpeg", "c.webp", "d.ktx2", "data.json", "files/file.gltf", "m.bin",
                                      "mesh.gltf", "textures/my%20image.png"}));
  EXPECT_EQ(files.at("c.webp").content_type, "image/webp");
  EXPECT_EQ(std::get<fs::path>(files.at("textures/my%20image.png").body),
            fs::canonical(home) / "textures/my image.png");
}

TEST_F(ServedFile, ServesNothingElseOfAGltf) {
  for (const char* name : {"page.html", "x.svg", "x.js", "image.bin", "buffer.png", "notes"})
    write_text(home / name, "<script>");
  fs::create_symlink(folder / "secret.bin", home / "link.bin");
  fs::create_directory_symlink(folder / "elsewhere", home / "sub");
  ASSERT_EQ(mkfifo((home / "pipe.bin").c_str(), 0600), 0);
  fs::create_directory(home / "folder.bin");
  const auto files = served_file(
      gltf({"link.bin", "sub/secret.bin", "pipe.bin", "folder.bin", "../secret.bin", "%2e%2e/secret.bin", "page.html",
            "textures/../../secret.bin", (folder / "secret.bin").string(), "buffer.png", "missing.bin", "x.bin%00.html",
            "", ".", "http://evil.example/x.bin", "file:///etc/passwd", "m.gltf", "data.json"},
           {"x.svg", "x.js", "page.html", "image.bin", "notes"}));
  EXPECT_EQ(names(files), (std::vector<std::string>{"data.json", "files/file.gltf", "mesh.gltf"}));
}

TEST_F(ServedFile, MayBeALinkThatTheUserNames) {
  write_text(home / "m.bin", "x");
  fs::create_symlink(gltf({"m.bin"}), folder / "other.gltf");
  const auto files = served_file(folder / "other.gltf");
  EXPECT_EQ(nlohmann::json::parse(std::get<std::string>(files.at("data.json").body)).at("name"), "other.gltf");
  EXPECT_EQ(std::get<fs::path>(files.at("m.bin").body), fs::canonical(home) / "m.bin");
}

TEST_F(ServedFile, HasACoarseMeshFirstIfLarge) {
  const auto data_of = [](const std::map<std::string, Served>& files) {
    return nlohmann::json::parse(std::get<std::string>(files.at("data.json").body));
  };
  write_mesh(home / "m.glb", noisy_grid(20, 8));
  EXPECT_FALSE(data_of(served_file(home / "m.glb")).contains("first"));
  write_mesh(home / "m.glb", noisy_grid(400, 8));
  const auto files = served_file(home / "m.glb");
  EXPECT_EQ(data_of(files)["mesh_bytes"], fs::file_size(home / "m.glb"));
  const Content first = std::get<Make>(files.at(data_of(files)["first"]).body).make();
  write_text(home / "first.glb", std::get<std::shared_ptr<const Text>>(first)->bytes());
  EXPECT_LT(read_mesh(home / "first.glb").triangles.size(), 400u * 400u);
}

TEST_F(ServedFile, ServesNoLinksInAMapFolder) {
  write_text(home / "report.json", R"({"mesh": {}, "frames": {}})");
  write_text(folder / "mesh.glb", "secret");
  fs::create_symlink(folder / "mesh.glb", home / "mesh.glb");
  fs::create_symlink(folder / "secret.bin", home / "report.html");
  ASSERT_EQ(mkfifo((home / "map.vdb").c_str(), 0600), 0);
  ASSERT_EQ(mkfifo((home / "trajectory.txt").c_str(), 0600), 0);
  EXPECT_EQ(names(FinishedMap(home).served()), (std::vector<std::string>{"data.json", "files/report.json"}));
  EXPECT_EQ(FinishedMap(home).inlined(1 << 20).rest, "");
  fs::remove(home / "report.json");
  ASSERT_EQ(mkfifo((home / "report.json").c_str(), 0600), 0);
  EXPECT_NE(error_of([&] { FinishedMap map(home); }).find("is a pipe or a device"), std::string::npos);
}

TEST(FileBelow, ReadsNoMoreThanIsAllowed) {
  const TemporaryFolder folder;
  write_text(folder / "a", "12345");
  EXPECT_EQ(FileBelow(folder.path(), "a").read(5), "12345");
  EXPECT_NE(error_of([&] { (void)FileBelow(folder.path(), "a").read(4); }).find("has 5 bytes, more than 4"),
            std::string::npos);
}

}  // namespace
}  // namespace cairn
