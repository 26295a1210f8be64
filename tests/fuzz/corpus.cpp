// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Writes small valid inputs, DIR/TARGET/NAME, as seeds of the fuzz targets.
#include <cstring>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "base/gzip.hpp"
#include "base/read_whole.hpp"
#include "cairn/mapping/esdf.hpp"
#include "cairn/mapping/pose_graph.hpp"
#include "cairn/mapping/splats.hpp"
#include "io/camera_file.hpp"
#include "mesh/formats.hpp"
#include "mesh/gltf.hpp"
#include "session/session_files.hpp"
#include "splats/formats.hpp"
#include "support/depth_files.hpp"
#include "support/frame_messages.hpp"
#include "support/ros_files.hpp"
#include "support/zips.hpp"
#include "volume/vdb/brick_file.hpp"
#include "volume/vdb/map_vdb.hpp"
#ifdef CAIRN_VIDEO
#include "support/videos.hpp"
#endif

using namespace cairn;

namespace {

namespace fs = std::filesystem;

fs::path place(const fs::path& folder, const char* target, const std::string& name) {
  fs::create_directories(folder / target);
  return folder / target / name;
}
void put(const fs::path& file, const std::string& text) { std::ofstream(file, std::ios::binary) << text; }

Trajectory path() {
  Trajectory path(3);
  for (int i = 0; i < 3; ++i) {
    auto& [time, pose] = path[static_cast<std::size_t>(i)];
    time = 0.1 * i;
    pose.linear() = Eigen::AngleAxisd(0.3 * i, Eigen::Vector3d::UnitY()).toRotationMatrix();
    pose.translation().x() = 0.1 * i;
  }
  return path;
}

/// A tetrahedron, with colors or a texture.
Mesh mesh(bool textured) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0.5f}, {0, 2, 0}, {0, 0, 3}};
  mesh.normals.assign(4, Eigen::Vector3f::UnitX());
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  if (textured) {
    mesh.texture_coordinates = {{0, 0}, {1, 0}, {0, 1}, {1, 1}};
    mesh.texture = {8, 8, std::vector<std::array<std::uint8_t, 3>>(64, {10, 120, 200})};
  } else {
    mesh.colors = {{0, 1, 2, 255}, {100, 150, 200, 255}, {255, 254, 128, 255}, {7, 77, 177, 255}};
    mesh.sigmas = {0.001f, 0.002f, 0.003f, 0.004f};
  }
  return mesh;
}

void write_text_inputs(const fs::path& folder) {
  write_trajectory(place(folder, "trajectory", "path"), path());
  put(place(folder, "trajectory", "csv"), "#t,x,y,z,qx,qy,qz,qw\r\n1,0,0,0,0,0,0,1\r\n2, 1e-3, +2, -3, 0, 0, 0.7, 0.7");
  PoseGraph graph;
  for (const auto& [time, pose] : path()) graph.world_from_node.push_back(pose);
  graph.edges = {{.i = 0, .j = 1}, {.i = 1, .j = 2}, {.i = 0, .j = 2}};
  graph.edges[1].information(3, 3) = -5;
  write_g2o(place(folder, "g2o", "graph"), graph);
  put(place(folder, "options", "all"),
      "fuse:\n  voxel_size: 0.02\n  truncation: 0.08\ntrack: {levels: 4, photometric: true}\n# more\nmap:\n  loops: "
      "0\n");
  const std::string camera = camera_file_text(
      {.rig = Camera{.width = 16, .height = 16, .fx = 16, .fy = 16, .cx = 8, .cy = 8}, .depth_scale = 5000});
  put(place(folder, "camera", "plain"), camera);
  put(place(folder, "camera", "color"),
      camera +
          "color: {width: 32, height: 32, fx: 30, fy: 30, cx: 16, cy: 16, translation: [0.1, 0, 0], rotation: [0, "
          "0, 0, 1]}\n");
  put(place(folder, "query", "points"), "x,y,z\n0,0,0\n1.5, -2e-3 ,nan\r\n\n+1,inf,3");
  put(place(folder, "recording", "tum"),
      "@depth.txt\n# time file\n0.0 depth/1.png\n0.1 depth/2.png\n@rgb.txt\n0.01 rgb/1.png\n0.11 "
      "rgb/2.png\n@camera.yaml\n" +
          camera +
          "@accelerometer.txt\n0.0 0 9.8 0\n0.1 0.1 9.7 0\n@groundtruth.txt\n0 0 0 0 0 0 0 1\n0.2 1 0 0 0 0 0 1\n");
  put(place(folder, "recording", "icl"),
      "@associations.txt\n1 depth/1.png 1 rgb/1.png\n2 depth/2.png 2 rgb/2.png\n@groundtruth.txt\n1 0 0 0 0 0 0 1\n");
  put(place(folder, "recording", "seven"), "@frame-000000.pose.txt\n1 0 0 0.5\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
  put(place(folder, "recording", "intrinsics"),
      "@intrinsics.json\n{\"width\": 16, \"height\": 16, \"fx\": 16, \"fy\": 16, \"cx\": 8, \"cy\": 8, "
      "\"depth_scale\": "
      "1000, \"frame_rate\": 30, \"distortion\": [0.1, 0, 0, 0, 0]}\n");
}

void write_layouts(const fs::path& folder) {
  const std::string row = "1 0 0 0.5 0 1 0 0 0 0 1 0 0 0 0 1\n";
  put(place(folder, "recording", "eth3d"),
      "@depth.txt\n0.0 depth/1.png\n0.1 depth/2.png\n@rgb.txt\n0.01 rgb/1.png\n@calibration.txt\n16 16 8 8\n");
  put(place(folder, "recording", "replica"), "@traj.txt\n" + row + row +
                                                 R"(@cam_params.json
{"camera": {"w": 16, "h": 16, "fx": 16, "fy": 16, "cx": 8, "cy": 8, "scale": 6553.5}}
)");
  put(place(folder, "recording", "open3d"), R"(@intrinsic.json
{"width": 16, "height": 16, "intrinsic_matrix": [16, 0, 0, 0, 16, 0, 8, 8, 1], "depth_scale": 1000}
)");
  for (const auto& [name, text] : {std::pair{"matrix", "@intrinsics.txt\n[[16 0 8]\n [0 16 8]\n [0 0 1]]\n"},
                                   {"named", "@intrinsics.txt\nfx: 16\nfy = 16\ncx 8, cy 8\n"},
                                   {"camera_info",
                                    "@calib.yaml\n{width: 16, height: 16, K: [16, 0, 8, 0, 16, 8, 0, 0, 1], "
                                    "D: [0.1, 0, 0, 0, 0], distortion_model: plumb_bob}\n"}})
    put(place(folder, "recording", name), text);
  put(place(folder, "recording", "rtabmap"), R"(@calibration.yaml
%YAML:1.0
---
image_width: 16
image_height: 16
camera_matrix:
   rows: 3
   cols: 3
   data: [ 16., 0., 8., 0., 16., 8., 0., 0., 1. ]
distortion_coefficients:
   data: [ 0.1, 0., 0., 0., 0. ]
distortion_model: plumb_bob
local_transform:
   data: [ 0., 0., 1., 0., -1., 0., 0., 0., 0., -1., 0., 0. ]
@poses.txt
1 0 0 0 0 0 0 1 7
2 1 0 0 0 0 0 1 8
)");
  put(place(folder, "recording", "nerfstudio"), R"(@transforms.json
{"fl_x": 16, "fl_y": 16, "cx": 8, "cy": 8, "w": 16, "h": 16, "k1": 0.1, "camera_model": "OPENCV", "frames": [
{"file_path": "rgb/1.png", "depth_file_path": "depth/1.png", "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]},
{"depth_file_path": "depth/2.png", "fl_x": 16, "transform_matrix": [[1,0,0,1],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]}
)");
}

void write_images(const fs::path& folder) {
  cv::Mat depth(16, 16, CV_16U), color(16, 16, CV_8UC3);
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 16; ++x) {
      depth.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(1000 + 97 * x + 31 * y);
      color.at<cv::Vec3b>(y, x) = cv::Vec3b::all(static_cast<std::uint8_t>(15 * x + y));
    }
  for (const char* target : {"image", "keyframe"}) {
    cv::imwrite(place(folder, target, "depth.png"), depth);
    cv::imwrite(place(folder, target, "color.png"), color);
    cv::imwrite(place(folder, target, "colour.jpg"), color);
    cv::imwrite(place(folder, target, "progressive.jpg"), color, {cv::IMWRITE_JPEG_PROGRESSIVE, 1});
  }
  cv::imwrite(place(folder, "depth_image", "depth.png"), depth);
  cv::imwrite(place(folder, "depth_image", "depth.tiff"), depth);
  cv::imwrite(place(folder, "depth_image", "deflated.tiff"), depth, {cv::IMWRITE_TIFF_COMPRESSION, 8});
  cv::imwrite(place(folder, "depth_image", "depth.pgm"), depth);
  cv::Mat meters;
  depth.convertTo(meters, CV_32F, 1e-3);
  cv::imwrite(place(folder, "depth_image", "meters.tiff"), meters, {cv::IMWRITE_TIFF_COMPRESSION, 1});
  put(place(folder, "depth_image", "meters.exr"), exr({{"R", meters}}));
  for (const auto& [kind, image] : {std::pair{"u2", depth}, {"f4", meters}}) {
    std::string header = std::string("{'descr': '<") + kind + "', 'fortran_order': False, 'shape': (16, 16), }";
    header.resize(117, ' ');
    put(place(folder, "depth_image", std::string(kind) + ".npy"),
        std::string("\x93NUMPY\1\0\x76\0", 10) + header + '\n' +
            std::string(reinterpret_cast<const char*>(image.data), image.total() * image.elemSize()));
  }
  put(place(folder, "keyframe", "corners"), '\1' + std::string(2 * 72, '\0'));
}

void write_splat_files(const fs::path& folder) {
  Splats splats;
  splats.positions.assign(3, {1, 2, 3});
  splats.log_scales.assign(3, {-3, -4, -5});
  splats.rotations.assign(3, {1, 0, 0, 0});
  splats.opacities.assign(3, 1);
  splats.colors.assign(3, {0, 1, 2});
  splats.degree = 1;
  splats.harmonics.assign(9, {0, 0, 0.5f});
  const std::string spz = spz_of(splats);
  const auto content = gunzip({reinterpret_cast<const std::uint8_t*>(spz.data()), spz.size()}, 1 << 16);
  put(place(folder, "splat", "spz"), '\1' + spz);
  put(place(folder, "splat", "content"), '\2' + std::string(content.begin(), content.end()));
  const fs::path ply = place(folder, "splat", "a.ply");
  write_splats(ply, splats);
  const auto bytes = read_whole(ply);
  put(place(folder, "splat", "ply"), '\0' + std::string(bytes.begin(), bytes.end()));
  fs::remove(ply);
}

void write_meshes(const fs::path& folder) {
  write_ply(place(folder, "ply", "binary"), mesh(false));
  put(place(folder, "ply", "ascii"),
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty double y\nproperty int z\nproperty uchar "
      "red\nproperty uchar green\nproperty uchar blue\nelement face 1\nproperty list uchar int "
      "vertex_indices\nend_header\n"
      "0 0 0 1 2 3\n1 0 0 1 2 3\n0 1e0 0 1 2 3\n3 0 1 2\n");
  int number = 0;
  for (const Compression compression :
       {Compression::none, Compression::quantized, Compression::meshopt, Compression::draco}) {
    GltfWriter writer({.compression = compression, .png = number % 2 == 0});
    writer.add("a", mesh(true));
    writer.add("b", mesh(false));
    writer.add_cameras({}, path(), {Eigen::Isometry3d::Identity()});
    std::ostringstream glb;
    writer.put(glb);
    put(place(folder, "glb", std::to_string(number++)), glb.str());
  }
  put(place(folder, "gltf", "embedded"), R"({"asset": {"version": "2.0"}, "buffers": [{"byteLength": 36,
 "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}],
 "bufferViews": [{"buffer": 0, "byteLength": 36, "byteStride": 12}],
 "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
 "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 0}, "material": 0}]}],
 "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}], "textures": [{"source": 0}],
 "images": [{"bufferView": 0, "mimeType": "image/png"}],
 "nodes": [{"mesh": 0, "children": [1], "rotation": [0, 0, 0, 1]}, {"mesh": 0, "translation": [1, 2, 3], "scale": [2, 2, 2]}],
 "scene": 0, "scenes": [{"nodes": [0]}]})");
}

/// Files of a finished map, of a map in segments, of tiles, and of a camera beside images.
void write_json_files(const fs::path& folder) {
  put(place(folder, "report", "map"),
      R"({"cairn": "1.0", "frames": {"total": 2, "fused": 2}, "loops": [], "searched": [[0.1, 1], [0.2, 0]],
 "clock_offset": 0.01, "mesh": {"triangles": 4}, "submaps": {"components": 1}, "verdict": {"level": "good", "words": "good",
 "reasons": []}, "options": {"voxel_size": 0.02}, "upright": {"known": true}, "warnings": []})");
  put(place(folder, "plan", "two"),
      R"({"kind": "cairn plan", "format": 1, "frames_per_part": 20, "overlap": 5, "recordings": [{"name": "/a", "frames": 30}],
 "parts": [{"name": "000", "recording": 0, "begin": 0, "end": 20}, {"name": "001", "recording": 0, "begin": 15, "end": 30}]})");
  put(place(folder, "part", "one"),
      R"({"kind": "cairn part", "format": 1, "name": "000", "recording": "/a", "begin": 0, "end": 20, "camera": "camera.yaml"})");
  put(place(folder, "tileset", "two"),
      R"({"asset": {"version": "1.1"}, "geometricError": 1, "root": {"boundingVolume": {"box": [0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1]},
 "geometricError": 0.5, "refine": "REPLACE", "content": {"uri": "a.glb"}, "children": [
 {"boundingVolume": {"box": [0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1]}, "geometricError": 0, "contents": [{"uri": "tileset.json"}]}]}})");
  const auto intrinsics = [&](const char* name, char kind, const std::string& text) {
    put(place(folder, "intrinsics", name), kind + text);
  };
  intrinsics("plain", '\0',
             R"({"width": 16, "height": 16, "fx": 16, "fy": 16, "cx": 8, "cy": 8, "depth_scale": 1000, "frame_rate": 30,
 "distortion": [0.1, 0, 0, 0, 0]})");
  intrinsics("matrix", '\0', R"({"K": [[16, 0, 8], [0, 16, 8], [0, 0, 1]], "coeffs": [0, 0, 0, 0, 0]})");
  intrinsics("open3d", '\0', R"({"width": 16, "height": 16, "intrinsic_matrix": [16, 0, 0, 0, 16, 0, 8, 8, 1]})");
  intrinsics("words", '\1', "fx: 16\nfy = 16\ncx 8, cy 8\n");
  intrinsics("rows", '\1', "[[16 0 8]\n [0 16 8]\n [0 0 1]]\n");
  intrinsics("camera_info", '\2',
             "{width: 16, height: 16, K: [16, 0, 8, 0, 16, 8, 0, 0, 1], D: [0.1, 0, 0, 0, 0], "
             "distortion_model: plumb_bob}\n");
}

/// Input of distances_fuzz: nearby blocks, and two blocks at the limits of the index range.
void write_distance_fields(const fs::path& folder) {
  const auto field = [&](const char* name, std::int32_t far) {
    std::string bytes;
    const auto add = [&](auto value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); };
    for (const float value : {0.02f, 1.0f, 0.0f, 0.0f, 0.0f}) add(value);
    add(std::int8_t{0}), add(std::int8_t{0}), add(std::uint8_t{2});
    for (const std::int32_t at : {0, far}) {
      for (int axis = 0; axis < 3; ++axis) add(at);
      add(std::uint8_t{0}), add(std::uint16_t{7}), add(0.5f);
    }
    put(place(folder, "distances", name), bytes);
  };
  field("near", 1);
  field("far", (1 << 27) - 1);
}

void write_sessions(const fs::path& folder, const fs::path& work) {
  SessionState session;
  session.rig = Camera{.width = 16, .height = 16, .fx = 16, .fy = 16, .cx = 8, .cy = 8};
  session.number = 1;
  session.note = "a note";
  session.last_fused = 0.2;
  Atlas& atlas = session.back_end.atlas;
  for (const auto& [time, pose] : path()) {
    atlas.keyframes.push_back({.timestamp = time, .acceleration = Eigen::Vector3d::UnitY()});
    atlas.world_from_camera.push_back(pose);
    atlas.frames.push_back({.timestamp = time, .keyframe = static_cast<std::uint32_t>(atlas.keyframes.size() - 1)});
    session.back_end.tracked_from_camera.emplace_back(pose);
    session.tracker.state.last.push_back({.timestamp = time, .submap_from_camera = pose});
  }
  session.tracker.state.last.resize(2);
  atlas.loops.push_back({.edge = {.i = 0, .j = 2}, .feature_inliers = 20});
  atlas.recordings = {2};
  atlas.surface_sigma.add({0.1, 0.2, 0.3}, 0.002);
  session.back_end.submaps = {true};
  session.tracker.reference.levels = {{1, 2, 3, 4}, {5}};
  session.residency.on_device = {Brick(1, 2, 3)};
  session.residency.device_last_seen = {1};
  BrickVoxels voxels{};
  for (std::size_t i = 0; i < 512; ++i) voxels[i] = (i << 32) | 0x0100'0000u | (i * 7);
  BrickTree tree;
  tree.mark_free({1, 2, 4});
  const BrickList list{.bricks = {{1, 2, 3}}, .voxels = {voxels}, .free = tree.copy_free()};
  tree.put({1, 2, 3}, voxels);
  SessionWriter(work / "session").write(session, list);
  fs::rename(work / "session" / "state.cbor", place(folder, "session", "state"));
  write_bricks(place(folder, "vdb", "bricks"), list);
  auto block = std::make_shared<DistanceField::Block>();
  block->fill(0.25f);
  const DistanceField distances(0.02f, Eigen::Vector3f::Zero(), 1.0f, {{Eigen::Vector3i(0, 1, 2), block}});
  GridInfo info{.voxel_size = 0.01f, .truncation = 0.04f};
  info.sigma = atlas.surface_sigma;
  write_grids(place(folder, "vdb", "map"), tree, info, &distances);
}

/// Writes a node with a property of each kind, a frame, a seek table and the end.
void write_oni(const fs::path& folder) {
  const auto number = [](auto value) { return std::string(reinterpret_cast<const char*>(&value), sizeof value); };
  const auto text = [&](const std::string& t) { return number(static_cast<std::uint32_t>(t.size() + 1)) + t + '\0'; };
  const auto record = [&](std::uint32_t kind, const std::string& fields, const std::string& payload = "") {
    return number(0x0052494eu) + number(kind) + number(1u) + number(static_cast<std::uint32_t>(28 + fields.size())) +
           number(static_cast<std::uint32_t>(payload.size())) + number(std::uint64_t{0}) + fields + payload;
  };
  const std::string eight = number(8u) + number(std::uint64_t{1});
  put(place(folder, "oni", "depth"),
      std::string("NI10") + number(0x00010001u) + number(0u) + number(std::uint64_t{1000}) + number(1u) +
          record(13, text("Depth1") + number(2u) + number(0x547a3631u) + number(1u) + std::string(24, '\0')) +
          record(3, text("xnIsGenerating") + eight) + record(4, text("xnFov") + eight) +
          record(5, text("ID") + text("0")) +
          record(6, text("xnMapOutputMode") + number(12u) + number(640u) + number(480u) + number(30u)) + record(9, "") +
          record(8, number(1u) + number(std::uint64_t{0})) +
          record(10, number(std::uint64_t{33}) + number(1u), "depth") + record(7, "") +
          record(14, "", std::string(12, '\0') + number(std::uint64_t{24})) + record(11, ""));
}

#ifdef CAIRN_VIDEO
std::string jpeg(int width, int height) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", cv::Mat(height, width, CV_8UC3, cv::Scalar(10, 120, 200)), bytes);
  return {bytes.begin(), bytes.end()};
}

/// Two frames with truncated depth images, to keep the input small.
void write_videos(const fs::path& folder) {
  const auto camera = [](const std::string& place, const std::string& size) {
    return R"({"Intrinsics": {"ModelParameters": [0.5, 0.5, 0.5, 0.5, 0.1, 0, 0, 0.1, 0, 0, 0, 0, 0, 0], "ModelType":
      "CALIBRATION_LensDistortionModelBrownConrady"}, "Location": "CALIBRATION_CameraLocation)" +
           place + R"(", "Rt": {"Rotation": [1, 0, 0, 0, 1, 0, 0, 0, 1], "Translation": [-0.03, 0, 0]}, )" + size + "}";
  };
  MatroskaFile file;
  file.tracks = {
      {.tags = {{"title", "COLOR"}}, .codec = MatroskaFile::Codec::mjpeg, .width = 64, .height = 48, .rate = 30},
      {.tags = {{"title", "DEPTH"}}, .fourcc = "b16g", .width = 320, .height = 288, .rate = 30},
      {.tags = {{"title", "IMU"}}, .codec = MatroskaFile::Codec::samples}};
  file.tags = {{"K4A_DEPTH_DELAY_NS", "1000000"}};
  file.attachment_name = "calibration.json";
  file.attachment = R"({"CalibrationInformation": {"Cameras": [)" +
                    camera("D0", R"("SensorWidth": 1024, "SensorHeight": 1024)") + "," +
                    camera("PV0", R"("SensorWidth": 4096, "SensorHeight": 3072)") +
                    R"(], "InertialSensors": [{"SensorType": "CALIBRATION_InertialSensorType_Accelerometer",
          "Rt": {"Rotation": [0, 0, 1, -1, 0, 0, 0, -1, 0], "Translation": [0, 0, 0]}}]}})";
  for (const double time : {0.0, 0.033}) {
    file.packets.push_back({0, time, jpeg(64, 48)});
    file.packets.push_back({1, time, std::string(100, '\4')});
    file.packets.push_back({2, time, std::string(40, '\1')});
  }
  file.write(place(folder, "azure_kinect", "two.mkv"));

  const fs::path mp4 = place(folder, "recording", "stray");
  write_mp4(mp4, {2, std::vector<std::uint32_t>(64 * 48, 0xff102030u)}, 64, 48, 30, "libx264");
  std::ostringstream video;
  video << std::ifstream(mp4, std::ios::binary).rdbuf();
  put(mp4,
      "@camera_matrix.csv\n50, 0, 32\n0, 50, 24\n0, 0, 1\n@odometry.csv\ntimestamp, frame, x, y, z, qx, qy, qz, qw\n"
      "1, 000000, 0, 0, 0, 0, 0, 0, 1\n1.1, 000001, 0, 0.5, 0, 0, 0, 0, 1\n"
      "@imu.csv\ntimestamp, a_x, a_y, a_z, alpha_x, alpha_y, alpha_z\n1.05, 0, 0, -9.81, 0.1, 0, 0\n@rgb.mp4\n" +
          video.str());
}
#endif
/// Writes a ScanNet header and a frame of 16x16 raw pixels.
void write_sens(const fs::path& folder) {
  const auto number = [](auto value) { return std::string(reinterpret_cast<const char*>(&value), sizeof value); };
  std::string pose, intrinsic;
  for (int i = 0; i < 16; ++i) {
    pose += number(i % 5 == 0 ? 1.0f : 0.0f);
    intrinsic += number(i == 0 || i == 5 ? 16.0f : i == 2 || i == 6 ? 8.0f : i % 5 == 0 ? 1.0f : 0.0f);
  }
  const auto file = [&](int depth_kind, const std::string& depth) {
    return number(4u) + number(std::uint64_t{4}) + "name" + intrinsic + pose + intrinsic + pose + number(0) +
           number(depth_kind) + number(16u) + number(16u) + number(16u) + number(16u) + number(1000.0f) +
           number(std::uint64_t{1}) + pose + number(std::uint64_t{33'000}) + number(std::uint64_t{33'000}) +
           number(std::uint64_t{768}) + number(std::uint64_t{depth.size()}) + std::string(768, 'c') + depth;
  };
  put(place(folder, "sens", "raw"), file(0, std::string(512, 'd')));
  put(place(folder, "sens", "zlib"),
      file(1, std::string("\x78\x9c\x4b\x49\x19\x05\x23\x19\x00\x00\x71\xb8\xc8\x01", 14)));
}

/// Two frames of 16x16 pixels with all message types of a ROS recording, in each container.
void write_ros(const fs::path& folder) {
  const Camera camera{.width = 16, .height = 16, .fx = 16, .fy = 16, .cx = 8, .cy = 8};
  const auto messages = [&](ros::Wire wire) {
    ros::Messages all{
        {"/tf_static", "tf2_msgs/TFMessage", 1,
         ros::tf(wire, {{"d", "c", Eigen::Isometry3d::Identity()}, {"d", "i", Eigen::Isometry3d::Identity()}})},
        {"/d/camera_info", "sensor_msgs/CameraInfo", 1, ros::camera_info(wire, "d", camera, "plumb_bob", {0.1})},
        {"/c/camera_info", "sensor_msgs/CameraInfo", 1, ros::camera_info(wire, "c", camera, "equidistant", {})}};
    for (const std::int64_t time : {1'000'000'000, 1'033'000'000}) {
      all.push_back({"/i", "sensor_msgs/Imu", time, ros::imu(wire, time, "i", {1, 0, 0}, {0, 0, 9.81})});
      all.push_back({"/d/image", "sensor_msgs/Image", time,
                     ros::image(wire, {time, "d", 16, 16, "16UC1", std::string(512, 'd'), 2})});
      all.push_back({"/c/image", "sensor_msgs/Image", time,
                     ros::image(wire, {time, "c", 16, 16, "mono8", std::string(256, 'c'), 1})});
    }
    return all;
  };
  const auto bags = messages(ros::Wire::ros1), others = messages(ros::Wire::little);
  for (const char* packing : {"", "bz2", "lz4"})
    put(place(folder, "ros", std::string("bag") + packing), ros::bag(bags, {.compression = packing, .per_chunk = 20}));
  auto rvl = bags;
  rvl.push_back({"/r", "sensor_msgs/CompressedImage", 1'000'000'000,
                 ros::compressed_image(ros::Wire::ros1, 1'000'000'000, "d", "16UC1; compressedDepth rvl",
                                       ros::rvl(std::vector<std::uint16_t>(256, 1000), 16))});
  put(place(folder, "ros", "bag_rvl"), ros::bag(rvl, {.compression = "", .per_chunk = 20}));
  for (const char* packing : {"", "lz4", "zstd"})
    put(place(folder, "ros", std::string("mcap") + packing), ros::mcap(others, "cdr", {.compression = packing}));
  put(place(folder, "ros", "mcap_big"), ros::mcap(messages(ros::Wire::big), "cdr"));
  for (const char* packing : {"", "zstd"}) {
    fs::remove(folder / "ros" / (std::string("db3") + packing));
    ros::write_db3(place(folder, "ros", std::string("db3") + packing), others,
                   {.compression = packing, .page_size = 512});
  }
}

void write_zips(const fs::path& folder) {
  write_zip(place(folder, "zip", "scan"),
            {{"scan/", ""}, {"scan/rgb.txt", std::string(200, 'x')}, {"scan/depth/1.png", "png", true}});
  write_zip(place(folder, "zip", "refused"), {{"../a", "b", false, true}});
}

void write_requests(const fs::path& folder) {
  put(place(folder, "http", "page"), "GET /TOKEN/ HTTP/1.1\r\nHost: HOST\r\n\r\n");
  put(place(folder, "http", "two"),
      "HEAD /TOKEN/file?x=1 HTTP/1.1\r\nHost: HOST\r\nOrigin: http://HOST\r\n\r\n"
      "GET /TOKEN/gone HTTP/1.0\r\nHost: HOST\r\n\r\n");
  put(place(folder, "http", "refused"), "POST /TOKEN/ HTTP/1.1\r\nHost: HOST\r\nContent-Length: 3\r\n\r\nabc");
  put(place(folder, "http", "live"),
      "GET /TOKEN/live HTTP/1.1\r\nHost: HOST\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: "
      "13\r\n"
      "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n" +
          std::string("\x81\x82\1\2\3\4zc\x88\x80\1\2\3\4", 15));
}

}  // namespace

namespace {

void write_frame_messages(const fs::path& folder) {
  const auto both = [&](const std::string& name, const nlohmann::json& hello, const nlohmann::json& header,
                        const std::string& data) {
    const std::string first = message_of(hello);
    put(place(folder, "frame_message", name),
        little_endian(static_cast<std::uint32_t>(first.size())).substr(0, 2) + first + message_of(header, data));
  };
  nlohmann::json hello = small_hello(), frame = small_frame(4);
  both("depth", hello, frame, small_depth());
  both("end", hello, {{"end", true}}, "");
  frame["pose"] = {1, 2, 3, 0, 0, 0, 1};
  frame["gyro"] = frame["accel"] = {{0.1, 1, 2, 3}, {0.11, 1, 2, 3}};
  frame["color"] = {{"format", "rgb8"}, {"bytes", 768}, {"delay", 0.01}};
  frame["confidence"] = {{"format", "uint8"}, {"bytes", 256}};
  hello["poses"] = "opengl,mm";
  hello["name"] = "phone";
  both("all", hello, frame, small_depth() + std::string(1024, '\7'));
  const cv::Mat gray(16, 16, CV_16UC1, cv::Scalar(1000)), colors(16, 16, CV_8UC3, cv::Scalar(10, 20, 30));
  std::vector<std::uint8_t> depth, color;
  cv::imencode(".png", gray, depth);
  cv::imencode(".jpg", colors, color);
  frame = small_frame(4);
  frame["depth"] = {{"format", "png"}, {"bytes", depth.size()}};
  frame["color"] = {{"format", "jpeg"}, {"bytes", color.size()}};
  hello["camera"]["color"] = tiny_camera();
  hello["camera"]["color"]["translation"] = {0.1, 0, 0};
  hello["camera"]["color"]["rotation"] = {0, 0, 0, 1};
  both("images", hello, frame, std::string(depth.begin(), depth.end()) + std::string(color.begin(), color.end()));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: cairn_fuzz_corpus DIR\n");
    return 2;
  }
  const fs::path folder = argv[1], work = folder / ".work";
  fs::create_directories(work);
  write_text_inputs(folder);
  write_layouts(folder);
  write_images(folder);
  write_meshes(folder);
  write_splat_files(folder);
  write_json_files(folder);
  write_distance_fields(folder);
  write_sessions(folder, work);
  write_oni(folder);
  write_sens(folder);
  write_ros(folder);
  write_zips(folder);
  write_requests(folder);
  write_frame_messages(folder);
#ifdef CAIRN_VIDEO
  write_videos(folder);
#endif
  fs::remove_all(work);
}
