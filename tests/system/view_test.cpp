// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Data served to pages of a finished map, and messages of `cairn view`. In a browser: tests/system/browser.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <variant>

#include "cairn/mapping/mesh.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "cairn/mapping/viewer.hpp"
#include "support/files.hpp"
#include "view/finished_map.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

/// Map of a room, made once.
class ViewedMap : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder = std::make_unique<TemporaryFolder>();
    ASSERT_EQ(
        run_cairn({"reconstruct", "synthetic:room", "-o", map().string(), "--frames", "0:60:2", "--voxel-size", "0.04"})
            .exit_code,
        0);
  }
  static void TearDownTestSuite() { folder.reset(); }
  static fs::path map() { return *folder / "map"; }

  using Files = std::map<std::string, Served>;
  /// Bytes served under a name.
  static std::string given(const Files& files, const std::string& name) {
    const Served& served = files.at(name);
    if (const auto* text = std::get_if<std::string>(&served.body)) return *text;
    if (const auto* file = std::get_if<fs::path>(&served.body)) return read_bytes(*file);
    const Content made = std::get<Make>(served.body).make();
    if (const auto* file = std::get_if<fs::path>(&made)) return read_bytes(*file);
    return std::get<std::shared_ptr<const Text>>(made)->bytes();
  }
  static Json data_of(const Files& files) { return Json::parse(given(files, "data.json")); }
  static cv::Mat picture(const std::string& bytes) {
    return cv::imdecode(std::vector<char>(bytes.begin(), bytes.end()), cv::IMREAD_COLOR);
  }
  static fs::path kept(const std::string& name, const std::string& bytes) {
    write_text(*folder / name, bytes);
    return *folder / name;
  }
  /// Runs `cairn view` for a few seconds.
  static Ran view(const std::vector<std::string>& arguments, const std::string& environment = "") {
    std::vector<std::string> all{"view", "--port", "0"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    return run_cairn(all, "timeout --foreground -s INT 5 env " + environment);
  }

  inline static std::unique_ptr<TemporaryFolder> folder;
};

TEST_F(ViewedMap, ServesKeyframePictures) {
  const Files files = FinishedMap(map()).served();
  const Json keyframes = data_of(files)["keyframes"];
  ASSERT_GT(keyframes.size(), 2u);
  const Trajectory path = read_trajectory(map() / "trajectory.txt");
  double before = -1;
  for (const Json& keyframe : keyframes) {
    const double time = keyframe["time"];
    EXPECT_GT(time, before);
    before = time;
    EXPECT_TRUE(std::any_of(path.begin(), path.end(), [&](const StampedPose& p) { return p.timestamp == time; }));
    const cv::Mat image = picture(given(files, keyframe["picture"]));
    EXPECT_EQ(image.cols, 640);
    EXPECT_GT(cv::mean(image)[1], 20);
  }
}

TEST_F(ViewedMap, ServesVoxelFields) {
  const Files files = FinishedMap(map()).served();
  const std::string bytes = given(files, data_of(files)["fields"]);
  std::uint32_t size[3];
  ASSERT_GT(bytes.size(), 40u);
  std::memcpy(size, bytes.data() + 8, sizeof size);
  const std::size_t cells = std::size_t{size[0]} * size[1] * size[2];
  EXPECT_LE(cells, 1'000'000u);
  ASSERT_EQ(bytes.size(), 40 + 3 * cells);
  const auto filled = [&](std::size_t field) {
    const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(40 + field * cells);
    return std::count_if(begin, begin + static_cast<std::ptrdiff_t>(cells), [](char c) { return c != 0; });
  };
  EXPECT_GT(filled(0), 1000);
  EXPECT_GT(filled(1), 1000);
  EXPECT_GT(filled(2), 300);
  EXPECT_LT(filled(2), filled(1));
}

TEST_F(ViewedMap, ServesItsFilesAndConversions) {
  const Files files = FinishedMap(map()).served();
  std::map<std::string, Json> offered;
  const Json data = data_of(files);
  for (const Json& file : data["files"]) offered[file["name"]] = file;
  for (const char* name : {"mesh.glb", "map.vdb", "trajectory.txt", "graph.g2o", "report.json", "report.html"}) {
    ASSERT_TRUE(offered.count(name)) << name;
    EXPECT_EQ(offered[name]["bytes"], fs::file_size(map() / name));
    EXPECT_EQ(files.at(offered[name]["url"]).download, name);
  }
  const Mesh mesh = read_mesh(map() / "mesh.glb");
  const Mesh ply = read_mesh(kept("made.ply", given(files, offered["mesh.ply"]["url"])));
  EXPECT_EQ(ply.triangles, mesh.triangles);
  EXPECT_EQ(ply.colors.size(), ply.positions.size());
  const Mesh points = read_mesh(kept("points.ply", given(files, offered["points.ply"]["url"])));
  EXPECT_GT(points.positions.size(), 10'000u);
  EXPECT_EQ(points.colors.size(), points.positions.size());
  const std::string zip = given(files, offered["mesh-obj.zip"]["url"]);
  EXPECT_EQ(zip.substr(0, 4), "PK\3\4");
  EXPECT_NE(zip.find("mesh.obj"), std::string::npos);
}

TEST_F(ViewedMap, InlinedPageHasTheSameDataButSmaller) {
  const PageContent content = FinishedMap(map()).inlined(kMaxReportPage);
  const std::string mark = "id=\"data\">";
  const std::size_t begin = content.first.find(mark) + mark.size();
  const Json data = Json::parse(content.first.substr(begin, content.first.find("</script>", begin) - begin));
  EXPECT_EQ(data["mesh"], "#mesh");
  EXPECT_EQ(data["fields"], "#fields");
  const std::size_t fields = content.rest.find("data-of=\"fields\"");
  ASSERT_NE(fields, std::string::npos);
  EXPECT_LE(content.rest.size() - fields, (3 * 300'000 + 40) * 4 / 3 + 2000u);  // with tags
  std::size_t bytes = 0;
  for (const Json& keyframe : data["keyframes"]) {
    const std::string picture = keyframe["picture"];
    EXPECT_EQ(picture.substr(0, 23), "data:image/jpeg;base64,");
    bytes += picture.size();
  }
  EXPECT_GT(bytes, 1000u);
  EXPECT_LT(bytes, 620'000u);
  for (const Json& file : data["files"]) EXPECT_TRUE(fs::exists(map() / file["url"].get<std::string>())) << file;
}

TEST_F(ViewedMap, DoesNotShowThePicturesOfAnotherRun) {
  const fs::path other = *folder / "other";
  fs::create_directories(other);
  fs::copy(map() / "session", other / "session", fs::copy_options::recursive);
  Json report = Json::parse(read_bytes(map() / "report.json"));
  report["searched"][0][0] = 1234.5;
  write_text(other / "report.json", report.dump());
  fs::copy(map() / "trajectory.txt", other / "trajectory.txt");
  EXPECT_TRUE(data_of(FinishedMap(other).served())["keyframes"].empty());
  fs::remove_all(other / "session");
  EXPECT_TRUE(data_of(FinishedMap(other).served())["keyframes"].empty());
}

TEST_F(ViewedMap, CanBeASingleFile) {
  const Mesh mesh = read_mesh(map() / "mesh.glb");
  write_mesh(*folder / "x.PLY", mesh);
  write_mesh(*folder / "x.gltf", mesh);
  for (const fs::path& file : {map() / "mesh.glb", *folder / "x.PLY", *folder / "x.gltf", map() / "map.vdb"}) {
    const Files files = served_file(file);
    const Json data = data_of(files);
    EXPECT_EQ(data["mode"], "finished");
    EXPECT_TRUE(data["report"].is_null());
    EXPECT_EQ(data["name"], file.filename().string());
    EXPECT_EQ(data.contains("fields"), file.extension() == ".vdb");
    const std::string shown = data["mesh"];
    if (file.extension() == ".gltf") {
      EXPECT_TRUE(files.count("x.bin"));
      continue;
    }
    EXPECT_GT(read_mesh(kept("shown.glb", given(files, shown))).triangles.size(), mesh.triangles.size() / 2) << file;
    EXPECT_EQ(given(files, data["files"][0]["url"]) == read_bytes(file), true);
  }
  write_text(*folder / "ok.bin", "a buffer");
  write_text(*folder / "evil.gltf",
             R"({"buffers":[{"uri":"../secret.bin"},{"uri":"/etc/passwd"},{"uri":"%2e%2e/a.bin"},{"uri":"ok.bin"}]})");
  const Files evil = served_file(*folder / "evil.gltf");
  EXPECT_EQ(evil.size(), 4u);  // data.json, mesh.gltf, the download, and the next file
  EXPECT_TRUE(evil.count("ok.bin"));
}

TEST_F(ViewedMap, RefusesOtherFiles) {
  write_text(*folder / "broken.ply", "ply\nformat ascii 1.0\nelement vertex 3\n");
  const auto message_of = [](const fs::path& file) { return error_of([&] { (void)served_file(file); }); };
  EXPECT_NE(message_of(*folder / "broken.ply").find("broken.ply"), std::string::npos);
  for (const char* name : {"x.stl", "X.OBJ"}) {
    write_text(*folder / name, "solid");
    const fs::path glb = (*folder / name).replace_extension(".glb");
    EXPECT_NE(message_of(*folder / name).find("cannot be shown; write the same map as .glb"), std::string::npos)
        << name;
    EXPECT_NE(message_of(*folder / name).find("cairn export MAP -o " + glb.string()), std::string::npos) << name;
  }
  write_text(*folder / "x.fbx", "solid");
  EXPECT_NE(message_of(*folder / "x.fbx").find("give an output folder of cairn, a .glb"), std::string::npos);
  const fs::path killed = *folder / "killed";
  fs::create_directories(killed / "session");
  write_text(killed / "session" / "state.cbor", "");
  expect_one_line(view({killed.string()}), 1, "--resume");
}

TEST_F(ViewedMap, IsOpenedInTheUsersBrowser) {
  const fs::path seen = *folder / "seen", script = *folder / "browser";
  const fs::path runtime = *folder / "runtime";
  fs::create_directory(runtime);
  fs::permissions(runtime, fs::perms::owner_all);
  write_text(script, "#!/bin/sh\nfile=${1#file://}\ncp \"$file\" " + seen.string() +
                         "\nstat -c '%a %U' \"$file\" \"${file%/*}\" > " + seen.string() + ".modes\nid -un >> " +
                         seen.string() + ".modes\ncat /proc/*/cmdline 2>/dev/null | tr '\\0' '\\n' > " + seen.string() +
                         ".lines\n");
  fs::permissions(script, fs::perms::owner_all);
  const Ran ran =
      view({map().string(), "--open"}, "XDG_RUNTIME_DIR=" + runtime.string() + " BROWSER=" + script.string());
  EXPECT_NE(ran.out.find("http://127.0.0.1:"), std::string::npos) << ran.err;
  const std::string url = ran.out.substr(0, ran.out.find('\n')), token = url.substr(url.find('/', 7));
  EXPECT_NE(read_bytes(seen).find("url=" + url + "\""), std::string::npos) << read_bytes(seen);
  EXPECT_NE(read_bytes(seen).find("no-referrer"), std::string::npos);
  const std::string lines = read_bytes(seen.string() + ".lines"), modes = read_bytes(seen.string() + ".modes");
  EXPECT_NE(lines.find("file://" + runtime.string() + "/cairn-open-"), std::string::npos) << lines;
  EXPECT_EQ(lines.find(token), std::string::npos);  // command lines are readable for all users of the machine
  const std::string user = modes.substr(modes.rfind('\n', modes.size() - 2) + 1);
  EXPECT_EQ(modes, "600 " + user + "700 " + user + user);
  EXPECT_TRUE(fs::is_empty(runtime));  // removed at exit
  const Ran none = view({map().string(), "--open"}, "BROWSER=/nowhere/browser PATH=/nowhere");
  EXPECT_NE(none.err.find("no browser could be opened"), std::string::npos) << none.err;
  const Ran nowhere = view({map().string(), "--open"}, "XDG_RUNTIME_DIR= TMPDIR=/nowhere BROWSER=" + script.string());
  EXPECT_NE(nowhere.err.find("no browser is opened: "), std::string::npos) << nowhere.err;
}

TEST_F(ViewedMap, IsServedToOtherDevicesWithAWarning) {
  const Ran ran = view({map().string(), "--host", "0.0.0.0"}, "XDG_STATE_HOME=" + (*folder / "state").string());
  EXPECT_NE(ran.out.find("https://"), std::string::npos) << ran.err;
  EXPECT_NE(ran.err.find("anyone in this network with this address can see the map"), std::string::npos) << ran.err;
  EXPECT_TRUE(fs::exists(*folder / "state" / "cairn" / "view-0.0.0.0.pem"));
  EXPECT_EQ(ran.err.find("█"), std::string::npos);  // only for terminals
  expect_one_line(view({map().string(), "--host", "192.0.2.7"}), 1, "address 192.0.2.7 cannot be used");
}

}  // namespace
}  // namespace cairn
