// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Small crafted files with requests for far more memory, time or stack than valid files.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <opencv2/imgcodecs.hpp>

#include "base/depth_image.hpp"
#include "base/image_file.hpp"
#include "cairn/building/project.hpp"
#include "cairn/io/source.hpp"
#include "cairn/mapping/esdf.hpp"
#include "cairn/mapping/mesh.hpp"
#include "cairn/mapping/options.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "io/camera_file.hpp"
#include "io/intrinsics.hpp"
#include "io/recording_segment.hpp"
#include "io/ros/ros_compression.hpp"
#include "io/ros/ros_recording.hpp"
#include "mesh/formats.hpp"
#include "mesh/gltf.hpp"
#include "mesh/tiles.hpp"
#include "support/cost.hpp"
#include "support/crafted.hpp"
#include "support/files.hpp"
#include "support/ros_files.hpp"
#include "view/finished_map.hpp"
#include "view/served_tileset.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
constexpr double kLongest = 10;     // seconds
constexpr double kFewMb = 40;       // of memory, above an idle process
constexpr int kYamlLevels = 60000;  // in 120 KB, within the limit of a YAML file

std::span<const std::uint8_t> span_of(const std::string& bytes) {
  return {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()};
}

/// Expects a single-line error with `what`, within limits of time and memory.
void expect_refused(const std::function<void()>& call, const std::string& what) {
  const double nothing = cost_of([] {}).peak_mb;
  const Cost cost = cost_of(call);
  EXPECT_TRUE(cost.ended) << "crashed, or took too long";
  EXPECT_NE(cost.error.find(what), std::string::npos) << "'" << cost.error << "'";
  EXPECT_EQ(cost.error.find('\n'), std::string::npos) << cost.error;
  EXPECT_LT(cost.seconds, kLongest);
  EXPECT_LT(cost.peak_mb, nothing + kFewMb);
}

TEST(CraftedFiles, RejectDeeplyNestedJson) {
  const TemporaryFolder folder;
  const auto file = [&](const std::string& name, const std::string& text) {
    fs::create_directories((folder / name).parent_path());
    write_text(folder / name, text);
    return folder / name;
  };
  const std::string deep = nested();
  const std::string kJson = "nested deeper than 64 levels";
  file("map/report.json", R"({"a":)" + deep + "}");
  expect_refused([&] { (void)FinishedMap(folder / "map"); }, kJson);
  const auto tileset = file("tiles/tileset.json", R"({"asset":{"version":"1.1"},"root":{"a":)" + deep + "}}");
  expect_refused([&] { (void)read_tileset_file(tileset); }, kJson);
  expect_refused([&] { (void)served_tileset(tileset, [](const auto&) {}); }, kJson);
  file("plan/plan.json", R"({"kind":)" + deep + "}");
  expect_refused([&] { (void)read_plan(folder / "plan"); }, "plan.json: is damaged");
  file("part/part.json", R"({"kind":)" + deep + "}");
  expect_refused([&] { (void)read_segment(folder / "part"); }, "part.json: is damaged");
  const auto intrinsics = file("intrinsics.json", R"({"K":)" + nested(32'000) + "}");
  expect_refused([&] { (void)read_intrinsics(intrinsics); }, kJson);
  file("nerf/transforms.json", R"({"frames":[{"transform_matrix":)" + deep + R"(,"w":4}]})");
  expect_refused([&] { (void)open_source(folder / "nerf"); }, kJson);
  const auto gltf = file("mesh.gltf", R"({"asset":{"version":"2.0"},"extras":)" + deep + "}");
  expect_refused([&] { (void)read_mesh_parts(gltf); }, kJson);
  expect_refused([&] { (void)served_file(gltf); }, "is damaged, or not a glTF file");
  const auto yaml = file("camera.yaml", "width: " + nested(kYamlLevels));
  expect_refused([&] { (void)read_intrinsics(yaml); }, "camera.yaml:1: ");
  std::string dashes;
  for (int i = 0; i < kYamlLevels; ++i) dashes += "- ";
  const auto sequences = file("sequences.yaml", dashes);
  expect_refused([&] { (void)read_intrinsics(sequences); }, "sequences.yaml:1: ");
}

TEST(CraftedFiles, RejectOversizedImageBeforeDecoding) {
  const std::string bomb = black_png(20'000, 20'000), other = black_png(4000, 4000, 8, 2);
  EXPECT_LT(bomb.size(), 60'000u);
  const ImageBound camera{.size = {640, 480}};
  for (const Pixels pixels : {Pixels::as_stored, Pixels::rgb, Pixels::rgba})
    expect_refused([&] { (void)decode_image(span_of(bomb), pixels); },
                   "has 20000 x 20000 pixels, allowed: 1 to 4096 per side");
  expect_refused([&] { (void)decode_image(span_of(other), Pixels::rgba, camera); }, "is 4000x4000, the camera 640x480");
  expect_refused([&] { (void)decode_depth(span_of(other), camera); }, "is 4000x4000, the camera 640x480");
  const std::string message = ros::compressed_image(ros::Wire::ros1, 1, "d", "png", bomb);
  EXPECT_NO_THROW((void)decode_image(span_of(black_png(640, 480)), Pixels::rgba, camera));
}

TEST(CraftedFiles, RejectOversizedCompressedDepth) {
  std::string npy = "\x93NUMPY";
  npy += std::string("\1\0\x76\0", 4);
  std::string header = "{'descr': '<f8', 'fortran_order': False, 'shape': (4000000000, 4000000000), }";
  header.resize(117, ' ');
  npy += header + "\n";
  expect_refused([&] { (void)decode_depth(span_of(npy)); }, "allowed: 1 to 4096 per side");
  expect_refused([] { (void)decode_depth(span_of("P5 4000000000 4000000000 65535\n")); }, "per side");
}

TEST(CraftedFiles, RejectTextThatExpands) {
  const TemporaryFolder folder;
  const auto file = [&](const std::string& name, const std::string& text) {
    write_text(folder / name, text);
    return folder / name;
  };
  std::string list = "[", zeros = "0";
  for (int i = 0; i < 2'000'000; ++i) list += "[],", zeros += " 0";
  list += "[]]";
  const auto yaml = file("camera.yaml", "a: " + list.substr(0, 1 << 20) + "]");
  expect_refused([&] { (void)read_camera_file(yaml); }, "has 1024 KiB, allowed: at most 128 KiB");
  expect_refused(
      [&] {
        Options options;
        read_options(yaml, options);
      },
      "has 1024 KiB, allowed: at most 128 KiB");
  file("metadata.yaml", "a: " + list.substr(0, 1 << 20) + "]");
  expect_refused([&] { (void)open_rosbag2_folder(folder.path()); }, "has 1024 KiB, allowed: at most 128 KiB");
  const auto json = file("transforms.json", "{\"frames\": " + list + "}");
  fs::remove(folder / "metadata.yaml");
  fs::remove(folder / "camera.yaml");
  expect_refused([&] { (void)open_source(folder.path().string()); }, "transforms.json: has more than 1000000 values");
  const auto poses = file("poses.txt", zeros + "\n");
  expect_refused([&] { (void)read_trajectory(poses); }, "poses.txt:1: is a line of more than 65536 characters");
  const auto second = file("more.txt", "0 0 0 0 0 0 0 1\n" + zeros);
  expect_refused([&] { (void)read_trajectory(second); }, "more.txt:2: is a line of more than 65536 characters");
}

TEST(CraftedFiles, DistanceFieldAllocatesOnlyItsBlocks) {
  const TemporaryFolder folder;
  const auto block = [](float distance) {
    auto made = std::make_shared<DistanceField::Block>();
    made->fill(distance);
    return made;
  };
  constexpr int kEnd = (1 << 27) - 1;
  const double nothing = cost_of([] {}).peak_mb;
  for (const Eigen::Vector3i& far :
       {Eigen::Vector3i(kEnd, kEnd, kEnd), Eigen::Vector3i(65'536, 65'536, 1), Eigen::Vector3i(-kEnd - 1, kEnd, 3)}) {
    SCOPED_TRACE(far.transpose());
    write_distances(folder / "far.vdb", DistanceField(0.02f, Eigen::Vector3f::Zero(), 1.0f,
                                                      {{Eigen::Vector3i::Zero(), block(0.25f)}, {far, block(0.5f)}}));
    EXPECT_LT(fs::file_size(folder / "far.vdb"), 100'000u);
    const Cost cost = cost_of([&] {
      const DistanceField field = DistanceField::read(folder / "far.vdb");
      const auto at = [&](const Eigen::Vector3f& point) { return field.query(point); };
      if (field.blocks().size() != 2 || at({0.1f, 0.1f, 0.1f}).distance != 0.25f || at({3, 3, 3}).known ||
          at({-1, 0, 0}).known)
        throw std::runtime_error("the field answers other than its blocks");
      if (std::abs(far.maxCoeff()) < 1 << 20 && at(field.point((16 * far).cast<float>().array() + 8)).distance != 0.5f)
        throw std::runtime_error("the far block is lost");
      if (field.bounds().isEmpty()) throw std::runtime_error("no bounds");
    });
    EXPECT_TRUE(cost.ended) << "crashed";
    EXPECT_EQ(cost.error, "");
    EXPECT_LT(cost.peak_mb, nothing + kFewMb);
  }
  EXPECT_THROW(DistanceField(0.02f, Eigen::Vector3f::Zero(), 1.0f, {{Eigen::Vector3i(1 << 27, 0, 0), block(1)}}),
               std::invalid_argument);
}

TEST(CraftedFiles, SparseDistanceFieldMatchesDense) {
  // The same blocks together with blocks filling the box, and alone.
  const auto block = [](int seed) {
    auto made = std::make_shared<DistanceField::Block>();
    for (std::size_t i = 0; i < made->size(); ++i)
      (*made)[i] = static_cast<float>((seed * 31 + static_cast<int>(i)) % 97) / 97;
    return made;
  };
  DistanceField::Blocks near;
  for (int i = 0; i < 8; ++i) near.push_back({Eigen::Vector3i(i >> 2, i >> 1 & 1, i & 1), block(i)});
  DistanceField::Blocks with_far = near;
  with_far.push_back({Eigen::Vector3i(5000, -5000, 5000), block(8)});
  const DistanceField dense(0.02f, Eigen::Vector3f::Zero(), 1.0f, near),
      sparse(0.02f, Eigen::Vector3f::Zero(), 1.0f, with_far);
  for (int i = -5; i < 40; ++i)
    for (int k = -5; k < 40; k += 3) {
      const Eigen::Vector3f point = 0.02f * Eigen::Vector3f(i + 0.3f, k + 0.6f, (i + k) / 2 + 0.1f);
      const auto a = dense.query(point), b = sparse.query(point);
      EXPECT_EQ(a.known, b.known);
      EXPECT_EQ(a.distance, b.distance);
      EXPECT_EQ(a.gradient, b.gradient);
    }
}

TEST(CraftedFiles, RejectJpegWithManyScans) {
  const std::string few = jpeg_of_scans(512, 512, 2), many = jpeg_of_scans(4096, 4096, 20'000);
  EXPECT_EQ(decode_image(span_of(few), Pixels::as_stored).size(), cv::Size(512, 512));
  const Cost cost = cost_of([&] { (void)decode_image(span_of(many), Pixels::as_stored); });
  EXPECT_TRUE(cost.ended);
  EXPECT_EQ(cost.error, "is not a readable image");
  EXPECT_LT(cost.seconds, kLongest);
}

TEST(CraftedFiles, RejectDecompressionBombs) {
  const std::string zeros(std::size_t{200} << 20, '\0');
  const auto packed = compress_zstd(span_of(zeros));
  EXPECT_LT(packed.size(), 30'000u);
  const double nothing = cost_of([] {}).peak_mb;
  const Cost cost = cost_of([&] { (void)unpacked("zstd", packed, std::nullopt); });
  EXPECT_NE(cost.error.find("bytes when decompressed"), std::string::npos) << cost.error;
  EXPECT_LT(cost.peak_mb, nothing + 150);
  const std::string image(std::size_t{30} << 20, '\0');  // a black 4K image
  EXPECT_EQ(unpacked("zstd", compress_zstd(span_of(image)), image.size()).size(), image.size());
}

/// Creates a rosbag2 database from SQL statements.
fs::path database(const fs::path& file, const std::vector<std::string>& statements) {
  fs::remove(file);
  sqlite3* opened = nullptr;
  sqlite3_open(file.c_str(), &opened);
  for (const auto& statement : statements)
    EXPECT_EQ(sqlite3_exec(opened, statement.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(opened);
  sqlite3_close(opened);
  return file;
}

const std::string kTopics =
    "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, "
    "offered_qos_profiles TEXT); INSERT INTO topics VALUES (1, '/d', 'sensor_msgs/msg/Image', 'cdr', '')";
const std::string kMessages =
    "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)";
const std::string kEndless = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT ";

TEST(CraftedFiles, DatabaseReadsOnlyTables) {
  const TemporaryFolder folder;
  const fs::path file = folder / "x.db3";
  const auto expect = [&](const std::vector<std::string>& statements, const std::string& what) {
    database(file, statements);
    SCOPED_TRACE(statements.back());
    expect_refused([&] { (void)open_rosbag2_db3(file); }, "x.db3: is not a rosbag2 file: " + what);
  };
  expect(
      {kTopics, "CREATE VIEW messages AS " + kEndless + "x AS id, 1 AS topic_id, x AS timestamp, x'00' AS data FROM c"},
      "its `messages` is not a table");
  expect({kMessages, "CREATE VIEW topics AS " + kEndless +
                         "x AS id, '/d' AS name, '' AS type, '' AS "
                         "serialization_format FROM c"},
         "its `topics` is not a table");
  expect({kTopics, "CREATE VIRTUAL TABLE messages USING fts5(topic_id, timestamp, data)"},
         "its `messages` is not a table");
  expect({kTopics,
          "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB AS "
          "(zeroblob(200000000)))"},
         "its `messages` has computed columns");
  expect({kTopics}, "no such table: messages");
}

TEST(CraftedFiles, DatabaseWithPlainTablesIsRead) {
  const TemporaryFolder folder;
  std::vector<std::string> statements{kTopics, kMessages,
                                      "CREATE TRIGGER t AFTER INSERT ON messages BEGIN SELECT 1; END", "BEGIN"};
  for (int i = 0; i < 2000; ++i)
    statements.push_back(fmt::format("INSERT INTO messages VALUES ({0}, 1, {0}, x'00')", i));
  statements.emplace_back("COMMIT");
  const auto recording = open_rosbag2_db3(database(folder / "x.db3", statements));
  int messages = 0;
  while (recording->next()) ++messages;
  EXPECT_EQ(messages, 2000);
  EXPECT_FALSE(recording->ended_early());
}

TEST(CraftedFiles, RejectMeshThatReusesVertices) {
  const TemporaryFolder folder;
  // 3 MB of positions, instanced once by each of 2000 nodes: 6 GB.
  constexpr int kVertices = 250'000, kNodes = 2000;
  std::string nodes, roots;
  for (int i = 0; i < kNodes; ++i)
    nodes += i > 0 ? R"(,{"mesh":0})" : R"({"mesh":0})", roots += (i > 0 ? "," : "") + std::to_string(i);
  write_text(folder / "mesh.bin", std::string(std::size_t{12} * kVertices, '\0'));
  write_text(folder / "mesh.gltf",
             fmt::format(R"({{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{0},"uri":"mesh.bin"}}],
"bufferViews":[{{"buffer":0,"byteLength":{0}}}],"accessors":[{{"bufferView":0,"componentType":5126,"count":{1},"type":"VEC3"}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],"nodes":[{2}],"scenes":[{{"nodes":[{3}]}}],"scene":0}})",
                         12 * kVertices, kVertices, nodes, roots));
  const double nothing = cost_of([] {}).peak_mb;
  const Cost cost = cost_of([&] { (void)read_mesh_parts(folder / "mesh.gltf"); });
  EXPECT_NE(cost.error.find("larger than the file"), std::string::npos) << cost.error;
  EXPECT_TRUE(cost.ended);
  EXPECT_LT(cost.peak_mb, nothing + 1000);
}

}  // namespace
}  // namespace cairn
