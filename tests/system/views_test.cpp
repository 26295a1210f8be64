// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// `cairn export --for`: images with poses, depth and points, for programs that learn a scene from images.
#include "export/views.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "cairn/eval/evaluation.hpp"
#include "cairn/io/source.hpp"
#include "cairn/mapping/mesh.hpp"
#include "cairn/synthetic/synthetic.hpp"
#include "support/files.hpp"
#include "support/shared.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

fs::path room() { return shared_recording({"room", "--frames", "60"}); }
fs::path map_of_room() { return shared_map(room(), {"--voxel-size", "0.02"}); }

Json exported(const fs::path& map, const fs::path& folder, std::vector<std::string> options) {
  options.insert(options.begin(), {"export", map.string(), "-o", folder.string(), "--json"});
  const Ran ran = run_cairn(options);
  EXPECT_EQ(ran.exit_code, 0) << ran.err;
  return ran.exit_code == 0 ? Json::parse(ran.out) : Json{};
}

std::vector<Frame> read(const fs::path& folder) {
  std::vector<Frame> frames;
  const auto source = open_source(folder);
  while (auto frame = source->next()) frames.push_back(*std::move(frame));
  return frames;
}

/// Share of a view's visible points that agree with its depth.
double agreeing(const std::vector<Eigen::Vector3f>& points, const Camera& camera, const Eigen::Isometry3d& pose,
                const std::function<double(int x, int y)>& depth) {
  constexpr double kNear = 0.03;  // meters: voxels and noise
  int seen = 0, right = 0;
  for (const auto& point : points) {
    const Eigen::Vector3d p = pose.inverse() * point.cast<double>();
    if (p.z() < 0.3) continue;
    const Eigen::Vector2d pixel = camera.project(p);
    const auto x = static_cast<int>(std::lround(pixel.x())), y = static_cast<int>(std::lround(pixel.y()));
    if (x < 0 || y < 0 || x >= camera.width || y >= camera.height) continue;
    const double there = depth(x, y);
    if (there == 0 || p.z() > there + kNear) continue;  // hidden
    ++seen;
    right += std::abs(p.z() - there) <= kNear;
  }
  EXPECT_GT(seen, 500);
  return static_cast<double>(right) / std::max(seen, 1);
}

TEST(Views, ForNerfstudioAreReadBackAsTheKeyframes) {
  const TemporaryFolder folder;
  const Json told = exported(map_of_room(), folder / "views", {"--for", "nerfstudio"});
  const auto views = read(folder / "views");
  ASSERT_EQ(views.size(), told["images"]);
  ASSERT_EQ(views.size(), told["keyframes"]);
  ASSERT_GT(views.size(), 5u);
  const auto source = open_source(room());
  EXPECT_EQ(open_source(folder / "views")->rig(), Rig(source->rig().depth));
  const auto poses = recorded_truth(folder / "views");
  const auto trajectory = read_trajectory(map_of_room() / "trajectory.txt");
  ASSERT_EQ(trajectory.size(), 60u);
  std::size_t next = 0;
  for (std::size_t i = 0; const auto frame = source->next(); ++i) {
    if (next == views.size()) break;
    float most = 0;
    for (std::size_t p = 0; p < frame->depth.size() && most < 0.01f; ++p)
      most = std::max(most, std::abs(frame->depth[p] - views[next].depth[p]));
    if (most > 0.0006f) continue;  // no keyframe; the unit is a millimeter, and keyframes have 0.2 mm
    const Eigen::Isometry3d difference = trajectory[i].world_from_camera.inverse() * poses[next].world_from_camera;
    EXPECT_LT(difference.translation().norm(), 0.002) << i;  // between the clocks of depth and color
    EXPECT_FALSE(views[next].color.empty());
    ++next;
  }
  EXPECT_EQ(next, views.size());
  const Json all = Json::parse(read_bytes(folder / "views/transforms.json"));
  const Mesh points = read_mesh(folder / "views" / all["ply_file_path"].get<std::string>());
  EXPECT_EQ(points.positions.size(), told["points"]);
  const Camera& camera = source->rig().depth;
  const auto depth = [&](int x, int y) {
    return static_cast<double>(views[0].depth[static_cast<std::size_t>(y * camera.width + x)]);
  };
  EXPECT_GT(agreeing(points.positions, camera, poses[0].world_from_camera, depth), 0.9);
}

/// Numbers in the lines of a text file except comments and empty lines; a name counts as 0.
std::vector<std::vector<double>> numbers_in(const fs::path& file) {
  std::vector<std::vector<double>> lines;
  std::istringstream in(read_bytes(file));
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    lines.emplace_back();
    for (std::string word; words >> word;) lines.back().push_back(std::atof(word.c_str()));
  }
  return lines;
}

TEST(Views, ForColmapHoldTheSameModel) {
  const TemporaryFolder folder;
  const fs::path out = folder / "views";
  const Json told = exported(map_of_room(), out, {"--for", "colmap", "--points", "0.05"});
  const auto cameras = numbers_in(out / "sparse/0/cameras.txt"), images = numbers_in(out / "sparse/0/images.txt"),
             lines = numbers_in(out / "sparse/0/points3D.txt");
  ASSERT_EQ(cameras.size(), 1u);
  ASSERT_EQ(images.size(), told["images"]);
  ASSERT_EQ(lines.size(), told["points"]);
  std::vector<Eigen::Vector3f> points;
  for (const auto& v : lines) points.push_back(Eigen::Vector3d(v[1], v[2], v[3]).cast<float>());
  const auto& c = cameras[0];  // 1 PINHOLE w h fx fy cx cy
  const Camera camera{static_cast<int>(c[2]), static_cast<int>(c[3]), c[4], c[5], c[6] - 0.5, c[7] - 0.5, {}};
  EXPECT_EQ(camera, open_source(room())->rig().depth);
  for (std::size_t i = 0; i < images.size(); ++i) {
    const auto& v = images[i];
    const std::string name = "frame_0000" + std::to_string(i + 1);
    if (i + 1 > 9) break;
    Eigen::Isometry3d camera_from_world = Eigen::Isometry3d::Identity();
    camera_from_world.linear() = Eigen::Quaterniond(v[1], v[2], v[3], v[4]).toRotationMatrix();
    camera_from_world.translation() = Eigen::Vector3d(v[5], v[6], v[7]);
    const cv::Mat depth = cv::imread((out / "depths" / (name + ".png")).string(), cv::IMREAD_UNCHANGED);
    const cv::Mat color = cv::imread((out / "images" / (name + ".jpg")).string());
    ASSERT_EQ(depth.size(), cv::Size(camera.width, camera.height));
    ASSERT_EQ(color.size(), depth.size());
    EXPECT_GT(agreeing(points, camera, camera_from_world.inverse(),
                       [&](int x, int y) { return 0.001 * depth.at<std::uint16_t>(y, x); }),
              0.9)
        << i;
  }
  if (std::system("command -v colmap >/dev/null") != 0) GTEST_SKIP() << "COLMAP is not installed";
  const std::string command = "QT_QPA_PLATFORM=offscreen colmap model_analyzer --path '" + (out / "sparse/0").string() +
                              "' > '" + (folder / "told.txt").string() + "' 2>&1";
  EXPECT_EQ(std::system(command.c_str()), 0);
  EXPECT_NE(read_bytes(folder / "told.txt").find("Registered images: " + std::to_string(images.size())),
            std::string::npos)
      << read_bytes(folder / "told.txt");
}

TEST(Views, AreWhatTheColorCameraWouldSeeWithoutItsLens) {
  const TemporaryFolder folder;
  Rig rig({320, 240, 262.5, 262.5, 159.5, 119.5, {}},
          ColorCamera{.camera = {.width = 640,
                                 .height = 360,
                                 .fx = 460,
                                 .fy = 460,
                                 .cx = 319.5,
                                 .cy = 179.5,
                                 .distortion = {0.08, -0.05, 0.001, -0.001, 0.002}}});
  rig.color->color_from_depth = Eigen::Translation3d(-0.05, 0, 0) * Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitY());
  write_rig(folder / "rig.yaml", rig);
  const fs::path recording = folder / "recording", map = folder / "map";
  ASSERT_EQ(run_cairn({"synth", "room", "-o", recording.string(), "--frames", "20", "--noise", "none", "--camera",
                       (folder / "rig.yaml").string()})
                .exit_code,
            0);
  ASSERT_EQ(run_cairn({"reconstruct", "--no-texture", recording.string(), "-o", map.string(), "--voxel-size", "0.02"})
                .exit_code,
            0);
  exported(map, folder / "views", {"--for", "nerfstudio"});
  const auto views = read(folder / "views");
  const auto poses = recorded_truth(folder / "views");
  const Camera camera = open_source(folder / "views")->rig().depth;
  EXPECT_FALSE(camera.distorted());
  EXPECT_EQ(Eigen::Vector2i(camera.width, camera.height), Eigen::Vector2i(640, 360));
  EXPECT_LT(camera.fx, 1.15 * 460);
  const Eigen::Isometry3d map_from_scene =
      estimate_from_truth(read_trajectory(map / "trajectory.txt"), recorded_truth(recording));
  SceneCamera scene(synthetic_scene("room"), camera);
  for (std::size_t i = 0; i < views.size(); ++i) {
    const SceneImages truth = scene.render(map_from_scene.inverse() * poses[i].world_from_camera);
    double color = 0;
    std::size_t known = 0, right = 0;
    for (std::size_t p = 0; p < truth.depth.size(); ++p) {
      color += std::abs(static_cast<int>(truth.color[p] & 255u) - static_cast<int>(views[i].color[p] & 255u));
      if (views[i].depth[p] == 0) continue;
      ++known;
      right += std::abs(views[i].depth[p] - truth.depth[p]) < 0.02f;
    }
    EXPECT_LT(color / static_cast<double>(truth.depth.size()), 8) << i;  // of 255
    EXPECT_GT(static_cast<double>(known), 0.8 * static_cast<double>(truth.depth.size())) << i;
    EXPECT_GT(static_cast<double>(right), 0.95 * static_cast<double>(known)) << i;
  }
}

TEST(Views, AreTheSharpestOfTheirStretches) {
  const TemporaryFolder folder;
  const Camera camera{64, 48, 60, 60, 31.5, 23.5, {}};
  const std::size_t sharp[] = {1, 4, 8};  // of ten, in groups of three, three and four
  ViewsInput input{.rig = camera};
  for (std::size_t k = 0; k < 10; ++k) input.keyframes.push_back({.image = k});
  input.get_image = [&](std::size_t k) {
    Frame frame{.depth = std::vector<float>(64 * 48, 1 + 0.1f * static_cast<float>(k))};
    const bool is_sharp = std::find(std::begin(sharp), std::end(sharp), k) != std::end(sharp);
    for (std::uint32_t p = 0; p < 64 * 48; ++p)
      frame.color.push_back(0xff000000u | 0x10101u * (is_sharp ? p / 4 % 2 * 200 : p % 64));
    return frame;
  };
  EXPECT_EQ(write_views(input, folder.path(), {.images = 3}, {}), 3);
  const auto views = read(folder.path());
  ASSERT_EQ(views.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(views[i].depth[0], 1 + 0.1 * static_cast<double>(sharp[i]), 1e-4);
}

TEST(Views, AreRefusedInOneLineAndLeaveNothing) {
  const TemporaryFolder folder;
  const auto refused = [&](const fs::path& map, const fs::path& out, std::vector<std::string> options,
                           const std::string& told, int exit_code = 1) {
    options.insert(options.begin(), {"export", map.string(), "-o", out.string()});
    expect_last_line(run_cairn(options), exit_code, told);
  };
  refused(map_of_room() / "map.vdb", folder / "a", {"--for", "colmap"}, "has no keyframes, which --for needs");
  refused(map_of_room(), folder / "a", {"--for", "colmap", "--points", "20"}, "--points 20: number expected", 2);
  refused(map_of_room(), folder / "a", {"--for", "colmap", "--images", "-3"}, "--images -3: whole number expected", 2);
  EXPECT_TRUE(fs::is_empty(folder.path()));
  write_text(folder / "notes.txt", "mine");
  refused(map_of_room(), folder.path(), {"--for", "nerfstudio"}, "has other content");
  EXPECT_EQ(run_cairn({"export", map_of_room().string(), "-o", "x", "--for", "other"}).exit_code, 2);
  EXPECT_EQ(run_cairn({"export", map_of_room().string(), "-o", "x.glb", "--images", "3"}).exit_code, 2);
}

}  // namespace
}  // namespace cairn
