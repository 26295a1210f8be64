// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/path_kind.hpp"

#include <gtest/gtest.h>

#include "cairn/io/source.hpp"
#include "cairn/mapping/map.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Kind = PathKind::Kind;

void put(const fs::path& file) {
  fs::create_directories(file.parent_path());
  write_text(file, "x");
}

TEST(PathKind, DescribesEachKind) {
  const TemporaryFolder folder;
  for (const char* name : {"rec/depth.txt", "rec/depth/0.png", "rec/rgb/0.png", "map/report.json", "map/trajectory.txt",
                           "plan/plan.json", "plan/parts/000/part.json", "tiles/tileset.json", "odd/b.xyz", "odd/a.xyz",
                           "mesh.glb", "map.vdb", "poses.txt", "a.bag"})
    put(folder / name);
  fs::create_directories(folder / "empty");
  const std::pair<const char*, Kind> all[] = {{"rec", Kind::recording},
                                              {"rec/depth", Kind::images_of_recording},
                                              {"rec/rgb/", Kind::images_of_recording},
                                              {"map", Kind::map},
                                              {"plan", Kind::plan},
                                              {"plan/parts/000", Kind::part},
                                              {"tiles", Kind::tiles},
                                              {"empty", Kind::empty},
                                              {"odd", Kind::other},
                                              {"mesh.glb", Kind::mesh},
                                              {"map.vdb", Kind::voxels},
                                              {"poses.txt", Kind::trajectory},
                                              {"a.bag", Kind::recording},
                                              {"gone", Kind::other}};
  for (const auto& [name, kind] : all) EXPECT_EQ(kind_of_path(folder / name).kind, kind) << name;
  EXPECT_EQ(kind_of_path(folder / "odd").words, "is a folder with a.xyz, b.xyz");
}

TEST(PathKind, IsReportedWhenARecordingIsExpected) {
  const TemporaryFolder folder;
  for (const char* name : {"map/report.json", "map/trajectory.txt", "plan/plan.json", "mesh.glb", "map.vdb",
                           "rec/depth.txt", "rec/rgb/0.png"})
    put(folder / name);
  const auto error_for = [&](const char* name) {
    const std::string error = error_of([&] { (void)open_source((folder / name).string()); });
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
    return error;
  };
  EXPECT_NE(error_for("mesh.glb").find("is a mesh, not a recording: `cairn view"), std::string::npos);
  EXPECT_NE(error_for("map.vdb").find("is the voxel grid of a map, not a recording"), std::string::npos);
  EXPECT_NE(error_for("map").find("is a map made by cairn, not a recording"), std::string::npos);
  EXPECT_NE(error_for("plan").find("is a plan of several recordings, not a recording"), std::string::npos);
  EXPECT_NE(error_for("rec/rgb").find("is a subfolder of a recording"), std::string::npos);
}

TEST(PathKind, IsReportedWhenAMapIsExpected) {
  const TemporaryFolder folder;
  for (const char* name : {"rec/depth.txt", "plan/plan.json", "mesh.glb", "odd/a.xyz"}) put(folder / name);
  const auto error_for = [&](const char* name) { return error_of([&] { (void)Map::open(folder / name); }); };
  EXPECT_NE(error_for("mesh.glb").find("is a mesh, not a map"), std::string::npos);
  EXPECT_NE(error_for("rec").find("is a recording, not a map with voxels: `cairn reconstruct"), std::string::npos);
  EXPECT_NE(error_for("plan").find("is a plan of several recordings, not a map"), std::string::npos);
  EXPECT_NE(error_for("odd").find("is a folder with a.xyz, not a map"), std::string::npos);
}

}  // namespace
}  // namespace cairn
