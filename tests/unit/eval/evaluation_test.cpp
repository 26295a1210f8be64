// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/eval/evaluation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "cairn/io/source.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// Sphere as a grid of latitude and longitude.
Mesh sphere(float radius, const Eigen::Vector3f& center) {
  Mesh mesh;
  constexpr int kRows = 120, kColumns = 240;
  for (int j = 0; j <= kRows; ++j)
    for (int i = 0; i <= kColumns; ++i) {
      const float polar = static_cast<float>(M_PI) * static_cast<float>(j) / kRows,
                  a = 2 * static_cast<float>(M_PI) * static_cast<float>(i) / kColumns;
      mesh.positions.emplace_back(center + radius * Eigen::Vector3f(std::sin(polar) * std::cos(a), std::cos(polar),
                                                                    std::sin(polar) * std::sin(a)));
    }
  const auto at = [](int i, int j) { return static_cast<std::uint32_t>(j * (kColumns + 1) + i); };
  for (int j = 0; j < kRows; ++j)
    for (int i = 0; i < kColumns; ++i) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return mesh;
}

struct Reference {
  const char *estimate, *truth;
  double ate, rpe_translation, rpe_rotation;
  int matched;
};

// Computed once with a separate numpy program that follows the benchmark's evaluate_ate and evaluate_rpe line by line.
constexpr Reference kReferences[] = {
    {"tum_fr1_xyz_rgbdslam_estimate.txt", "tum_fr1_xyz_groundtruth.txt", 0.013473498, 0.021217487, 0.016309823, 786},
    {"tum_fr2_desk_orb_estimate.txt", "tum_fr2_desk_groundtruth.txt", 0.008143967, 0.007161112, 0.007941343, 2223},
};

TEST(EvaluateTrajectory, AgreesWithTheTumBenchmarkTools) {
  CAIRN_REQUIRE_DATA("trajectories");
  constexpr double kMeters = 1e-4;  // the project's promise; the actual difference is below 1e-9
  for (const auto& r : kReferences) {
    const auto folder = data_folder() / "trajectories";
    const auto e = evaluate_trajectory(read_trajectory(folder / r.estimate), read_trajectory(folder / r.truth));
    EXPECT_NEAR(e.ate.rmse, r.ate, kMeters);
    EXPECT_NEAR(e.rpe_translation.rmse, r.rpe_translation, kMeters);
    EXPECT_NEAR(e.rpe_rotation.rmse, r.rpe_rotation, 1e-4);
    EXPECT_EQ(e.matched_poses, r.matched);
  }
}

TEST(EvaluateTrajectory, IsInvariantToRigidTransforms) {
  Trajectory truth, estimate;
  const Eigen::Isometry3d moved =
      Eigen::Translation3d(4, 5, 6) * Eigen::AngleAxisd(1.0, Eigen::Vector3d(1, 1, 0).normalized());
  for (int i = 0; i < 90; ++i) {
    Eigen::Isometry3d pose(Eigen::AngleAxisd(0.02 * i, Eigen::Vector3d::UnitY()));
    pose.translation() = Eigen::Vector3d(std::sin(0.1 * i), 0.01 * i, std::cos(0.07 * i));
    truth.push_back({i / 30.0, pose});
    estimate.push_back({i / 30.0, moved * pose});
  }
  const auto e = evaluate_trajectory(estimate, truth);
  EXPECT_LT(e.ate.max, 1e-9);
  EXPECT_LT(e.rpe_translation.max, 1e-9);
  EXPECT_LT(e.rpe_rotation.max, 1e-7);
}

TEST(EvaluateTrajectory, RefusesTrajectoriesOfDifferentClocks) {
  const Trajectory a(5, StampedPose{}), b(5, StampedPose{.timestamp = 1e9});
  EXPECT_NE(error_of([&] { (void)evaluate_trajectory(a, b); }).find("same clock"), std::string::npos);
}

TEST(EvaluateMesh, MeasuresTheGapBetweenSpheres) {
  const auto e = evaluate_mesh(sphere(1.015f, {0, 0, 0}), sphere(1.0f, {0, 0, 0}), 20000);
  constexpr double kFacets = 4e-4;  // the triangles' distance from their sphere
  EXPECT_NEAR(e.accuracy.mean, 0.015, kFacets);
  EXPECT_NEAR(e.completeness.mean, 0.015, kFacets);
  EXPECT_EQ(e.at[0].precision, 0.0);  // all beyond 1 cm
  EXPECT_EQ(e.at[1].f_score, 1.0);    // all within 2 cm
}

/// Square of a meter facing z; the part beyond `step_at` along x is 2 cm higher.
Mesh stepped_square(float step_at) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0},           {step_at, 0, 0}, {step_at, 1, 0}, {0, 1, 0},
                    {step_at, 0, 0.02f}, {1, 0, 0.02f},   {1, 1, 0.02f},   {step_at, 1, 0.02f}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
  return mesh;
}

/// Square of a meter, moved from the origin; faces z or -z.
Mesh square_at(const Eigen::Vector3f& move, bool faces_z = true) {
  Mesh mesh;
  for (const Eigen::Vector3f& corner : {Eigen::Vector3f(0, 0, 0), {1, 0, 0}, {1, 1, 0}, {0, 1, 0}})
    mesh.positions.push_back(corner + move);
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  if (!faces_z)
    for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

TEST(EvaluateSeam, MeasuresOnlyTheOverlap) {
  const Mesh first = square_at({0, 0, 0});
  const ErrorStatistics half = evaluate_seam(first, square_at({0.5f, 0, 0.003f}));
  EXPECT_NEAR(half.count, 10000, 200);  // of 20000; points within 5 cm of the border are excluded
  EXPECT_NEAR(half.mean, 0.003, 1e-6);
  EXPECT_EQ(evaluate_seam(first, square_at({0, 0, -0.02f}, false)).count, 0);  // the other side of a board
  EXPECT_EQ(evaluate_seam(first, square_at({0, 0, 0.06f})).count, 0);          // too far for the same surface
}

TEST(EvaluateMesh, ComputesThe95thPercentile) {
  Mesh flat = stepped_square(1);
  flat.triangles.resize(2);                                                                      // without a step
  constexpr double kRounding = 1e-6;                                                             // meters
  EXPECT_NEAR(evaluate_mesh(stepped_square(0.94f), flat, 20000).accuracy.p95, 0.02, kRounding);  // 6 % are off
  EXPECT_NEAR(evaluate_mesh(stepped_square(0.96f), flat, 20000).accuracy.p95, 0, kRounding);     // 4 % are off
}

TEST(EvaluateMesh, CountsMissingSurface) {
  const Mesh complete = sphere(1.0f, {0, 0, 0});
  Mesh half = complete;
  std::erase_if(half.triangles, [&](const auto& t) { return half.positions[t[0]].y() > 0; });
  const auto e = evaluate_mesh(half, complete, 20000);
  EXPECT_LT(e.accuracy.max, 1e-3);
  EXPECT_NEAR(e.at[0].recall, 0.5, 0.03);
  EXPECT_EQ(e.at[0].precision, 1.0);
}

TEST(EvaluateMesh, RefusesAMeshWithoutSurface) {
  EXPECT_NE(error_of([] { (void)evaluate_mesh(Mesh{}, Mesh{}); }).find("no surface"), std::string::npos);
}

/// Wall across the path, `z` meters before the first camera; `side` meters wide and high.
Mesh wall(float z, float side, bool faces_camera = true) {
  Mesh mesh;
  const float h = side / 2;
  mesh.positions = {{-h, -h, z}, {h, -h, z}, {h, h, z}, {-h, h, z}};
  mesh.colors.assign(4, {100, 100, 100});
  mesh.triangles = {{0, 2, 1}, {0, 3, 2}};
  if (!faces_camera) mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

/// Frames of a wall at 2 m; in the second frame at 4.2 m.
class Wall final : public Source {
 public:
  [[nodiscard]] const Rig& rig() const override { return rig_; }
  [[nodiscard]] std::optional<int> size() const override { return 4 - count_; }
  [[nodiscard]] std::optional<Frame> next() override {
    if (count_ == 4) return std::nullopt;
    Frame frame{.index = count_, .timestamp = 0.1 * count_};
    frame.depth.assign(320 * 240, count_ == 1 ? 4.2f : 2.0f);
    frame.color.assign(320 * 240, 0xff696969);  // 105, 105, 105
    ++count_;
    return frame;
  }

 private:
  Rig rig_ = Camera{320, 240, 262.5, 262.5, 159.5, 119.5, {}};
  int count_ = 0;
};

TEST(EvaluateMap, MeasuresTheDistanceFromMeasuredDepth) {
  Trajectory still;
  for (const double time : {0.0, 0.1, 0.2}) still.push_back({.timestamp = time});  // the last frame has no pose
  Wall recording;
  const MapError e = evaluate_map({wall(2.01f, 10)}, recording, still, {0.0004}, 1);
  EXPECT_EQ(e.frames, 2);  // the first is a keyframe
  ASSERT_EQ(e.ranges.size(), 2u);
  EXPECT_EQ(e.ranges[0].from, 1.5);
  EXPECT_NEAR(e.ranges[0].depth.rmse, 0.01, 1e-5);
  EXPECT_EQ(e.ranges[0].covered, 1);
  EXPECT_EQ(e.ranges[1].from, 3.5);
  EXPECT_EQ(e.ranges[1].elsewhere, 1);
  EXPECT_EQ(e.ranges[1].depth.count, 0);
  EXPECT_NEAR(e.psnr, 20 * std::log10(255.0 / 5), 0.01);
  EXPECT_EQ(e.doubled, 0);
}

TEST(EvaluateMap, UsesOnlyHeldOutFrames) {
  Trajectory still;
  for (const double time : {0.0, 0.1, 0.2, 0.3}) still.push_back({.timestamp = time});
  const auto recording = [] { return hold_out(std::make_unique<Wall>(), {.every = 2}); };
  const MapError e = evaluate_map({wall(2.01f, 10)}, *recording(), still, {}, 1, true);
  EXPECT_EQ(e.frames, 2);  // the second and the last
  ASSERT_EQ(e.ranges.size(), 2u);
  EXPECT_EQ(e.ranges[1].elsewhere, 1);
  EXPECT_EQ(evaluate_map({wall(2.01f, 10)}, *recording(), still, {}, 1).frames, 4);
  Wall unmarked;
  EXPECT_NE(error_of([&] {
              (void)evaluate_map({wall(2, 2)}, unmarked, still, {}, 1, true);
            }).find("no held-out frame has a pose"),
            std::string::npos);
}

TEST(EvaluateMap, FindsDoubledSurface) {
  const auto doubled = [](std::vector<Mesh> parts) {
    Wall recording;
    return evaluate_map(parts, recording, {{.timestamp = 0}}, {}, 1).doubled;
  };
  // A square of 1 m before a square of 2 m: all of the first, and a quarter of the second.
  EXPECT_NEAR(doubled({wall(2, 2), wall(1.98f, 1)}), 0.4, 0.01);
  EXPECT_EQ(doubled({wall(2, 2), wall(1.9f, 1)}), 0);          // another object
  EXPECT_EQ(doubled({wall(2, 2), wall(2.01f, 2, false)}), 0);  // a board from both sides
  EXPECT_EQ(doubled({wall(2, 2), wall(2.002f, 1)}), 0);        // 2 mm: one sheet within tolerance
}

TEST(EvaluateMap, RefusesAnotherRecordingsTrajectory) {
  Wall recording;
  EXPECT_NE(error_of([&] {
              (void)evaluate_map({wall(2, 2)}, recording, {{.timestamp = 1e9}}, {}, 1);
            }).find("was the map made from another recording"),
            std::string::npos);
}

TEST(LoopDrift, IsTheResidualOfLoops) {
  Trajectory path{{.timestamp = 0}, {.timestamp = 1}};
  path[1].world_from_camera.translation().x() = 0.03;
  const LoopDrift drift = evaluate_loop_drift({{.from = 0, .to = 1}, {.from = 0, .to = 7}}, path);
  EXPECT_EQ(drift.shift.count, 1);
  EXPECT_NEAR(drift.shift.median, 0.03, 1e-9);
  EXPECT_NEAR(drift.turn.median, 0, 1e-9);
}

TEST(LoopError, CountsCorrectLoopsAndDetectedRevisits) {
  // Along a line and back, one keyframe a second: the second half revisits the first.
  Trajectory truth;
  std::vector<KeyframeInfo> keyframes;
  for (int i = 0; i < 10; ++i) {
    StampedPose pose{.timestamp = static_cast<double>(i)};
    pose.world_from_camera.translation().x() = i < 5 ? i : 9.2 - i;
    truth.push_back(pose);
    keyframes.push_back({.timestamp = static_cast<double>(i), .searched = i < 5 ? 0 : 5});
  }
  const auto measured = [&](int from, int to, double off) {
    MeasuredLoop loop{.from = static_cast<double>(from), .to = static_cast<double>(to)};
    loop.i_from_j = truth[static_cast<std::size_t>(from)].world_from_camera.inverse() *
                    truth[static_cast<std::size_t>(to)].world_from_camera;
    loop.i_from_j.translation().y() += off;
    return loop;
  };
  const LoopError e =
      evaluate_loops({measured(3, 6, 0.02), measured(2, 7, 0.5), measured(0, 9, 0.01)}, keyframes, truth, 1.5);
  EXPECT_EQ(e.loops, 3);
  EXPECT_EQ(e.right, 2);
  EXPECT_EQ(e.revisits, 5);
  EXPECT_EQ(e.found, 2);
}

TEST(EvaluateCostmap, CountsErrorsByKind) {
  // A wall across z = 2 m, seen from the origin; cells of 10 cm around it, at the camera's height.
  Scene scene;
  scene.solids.push_back({.center = {0, 0, 2.5f}, .half_size = {4, 4, 0.5f}});
  Costmap map{
      .columns = 24, .rows = 1, .resolution = 0.1, .origin = {0, -0.05}, .low = -0.05, .high = 0.05, .cells = {}};
  using Cell = Costmap::Cell;
  for (int i = 0; i < 24; ++i) map.cells.push_back(i < 20 ? Cell::free : i == 20 ? Cell::occupied : Cell::unknown);
  const Trajectory poses(1);
  const CostmapError right = evaluate_costmap(map, scene, synthetic_camera(), poses);
  EXPECT_EQ(right.judged, 21);
  EXPECT_EQ(right.right, 21);
  EXPECT_EQ(right.unseen, 0);
  map.cells[3] = Cell::occupied;
  map.cells[5] = map.cells[6] = Cell::unknown;
  map.cells[21] = Cell::free;  // in the wall
  const CostmapError wrong = evaluate_costmap(map, scene, synthetic_camera(), poses);
  EXPECT_EQ(wrong.judged, 22);
  EXPECT_EQ(wrong.right, 18);
  EXPECT_EQ(wrong.wrongly_occupied, 1);
  EXPECT_EQ(wrong.wrongly_unknown, 2);
  EXPECT_EQ(wrong.wrongly_free, 1);
  // A camera facing away observes no cell: unknown cells are right, and free cells are counted as unseen.
  Trajectory turned(1);
  turned[0].world_from_camera.linear() = Eigen::AngleAxisd(3.1416, Eigen::Vector3d::UnitY()).toRotationMatrix();
  const CostmapError unseen = evaluate_costmap(map, scene, synthetic_camera(), turned);
  EXPECT_EQ(unseen.wrongly_unknown, 0);
  EXPECT_EQ(unseen.unseen, 17);
  EXPECT_EQ(unseen.wrongly_free, 0);
  EXPECT_EQ(unseen.hidden, 1);
  EXPECT_THROW((void)evaluate_costmap(map, scene, synthetic_camera(), {}), std::runtime_error);
}

}  // namespace
}  // namespace cairn
