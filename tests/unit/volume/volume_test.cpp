// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "volume/volume.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <bit>
#include <csignal>
#include <map>
#include <set>

#include "cairn/mapping/mapper.hpp"
#include "preprocess/preprocess.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"
#include "support/twins.hpp"
#include "support/volumes.hpp"
#include "volume/integrate.hpp"
#include "volume/polygonize.hpp"
#include "volume/raycast.hpp"
#include "volume/vdb/brick_file.hpp"
#include "volume/vdb/map_vdb.hpp"

namespace cairn {
namespace {

constexpr std::uint64_t kPool = 96 << 20;  // bytes, page table included

FuseOptions fuse_options(float voxel = 0.02f) {
  return {.voxel_size = voxel, .truncation = 4 * voxel, .device_memory = kPool};
}

float sphere(const Eigen::Vector3f& p) { return (p - Eigen::Vector3f(0.1f, -0.05f, 0.02f)).norm() - 0.5f; }

void expect_closed(const Mesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const auto& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) ++edges[{t[k], t[(k + 1) % 3]}];
  for (const auto& [edge, count] : edges) {
    ASSERT_EQ(count, 1);
    ASSERT_TRUE(edges.contains({edge.second, edge.first}));
  }
  const auto euler = static_cast<long>(mesh.positions.size()) - static_cast<long>(edges.size() / 2) +
                     static_cast<long>(mesh.triangles.size());
  EXPECT_EQ(euler, 2);
}

TEST(Polygonize, MakesAClosedSphereAcrossBricksWithoutDuplicateVertices) {
  Volume volume(test_device(), fuse_options(), 5.0f);
  fill(volume, {-0.6f, -0.7f, -0.6f}, {0.8f, 0.6f, 0.7f}, sphere);
  const Mesh mesh = Polygonizer(test_device()).polygonize(volume);
  ASSERT_GT(mesh.triangles.size(), 5000u);
  expect_closed(mesh);
  // Linear interpolation along an edge of 2 cm misses a sphere of 50 cm by at most h^2 / 8r = 0.1 mm; 16 bits add 1 um.
  constexpr float kInterpolation = 1.2e-4f;
  std::map<std::tuple<float, float, float>, int> places;
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const auto& p = mesh.positions[i];
    ASSERT_NEAR(sphere(p), 0, kInterpolation);
    ASSERT_GT(mesh.normals[i].dot((p - Eigen::Vector3f(0.1f, -0.05f, 0.02f)).normalized()), 0.999f);
    ASSERT_EQ(mesh.colors[i], (std::array<std::uint8_t, 4>{0x40, 0x60, 0x80, 255}));
    ASSERT_EQ(++places[std::tuple(p.x(), p.y(), p.z())], 1);
  }
  for (const auto& t : mesh.triangles) {
    const auto &a = mesh.positions[t[0]], &b = mesh.positions[t[1]], &c = mesh.positions[t[2]];
    ASSERT_GT((b - a).cross(c - a).dot(mesh.normals[t[0]]), 0) << "counter-clockwise seen from outside";
  }
}

TEST(Polygonize, EqualsItsPlainTwin) {
  // Irregularly observed voxels: cells with unknown corners, and all cases of the table that occur in three rough
  // waves.
  FuseOptions options = fuse_options();
  Volume volume(test_device(), options, 5.0f);
  fill(volume, {-0.3f, -0.3f, -0.3f}, {0.5f, 0.4f, 0.3f}, [](const Eigen::Vector3f& p) {
    return 0.04f * (std::sin(90 * p.x()) + std::sin(83 * p.y() + 1) + std::sin(97 * p.z() + 2));
  });
  BrickTree tree;
  for (const Brick& b : volume.on_host().bricks()) {
    BrickVoxels voxels;
    std::copy_n(volume.on_host().find(b), 512, voxels.begin());
    for (std::uint32_t i = 0; i < 512; ++i)
      if ((i * 2654435761u >> 13) % 40 == 0) voxels[i] &= ~0xffff0000ull;
    if (b != Brick(1, 0, 0)) tree.put(b, voxels);
  }
  const std::vector<Eigen::Vector3f> expected = twin::polygonize(tree, options);
  volume.adopt(std::move(tree));
  const Mesh mesh = Polygonizer(test_device()).polygonize(volume);
  ASSERT_GT(expected.size(), 30000u);
  ASSERT_EQ(3 * mesh.triangles.size(), expected.size());
  // The order of triangles differs; each has a unique position.
  const auto sorted = [](const auto& corners) {
    std::vector<std::array<float, 3>> middles;
    for (std::size_t i = 0; i < corners.size(); i += 3) {
      const Eigen::Vector3f m = (corners[i] + corners[i + 1] + corners[i + 2]) / 3;
      middles.push_back({m.x(), m.y(), m.z()});
    }
    // Rounding may swap close sums: compare on a grid.
    for (auto& m : middles)
      for (float& v : m) v = std::round(v * 2e4f);
    std::sort(middles.begin(), middles.end());
    return middles;
  };
  std::vector<Eigen::Vector3f> corners;
  for (const auto& t : mesh.triangles)
    for (const std::uint32_t v : t) corners.push_back(mesh.positions[v]);
  const auto a = sorted(corners), b = sorted(expected);
  std::vector<std::array<float, 3>> only_one;
  std::set_symmetric_difference(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(only_one));
  EXPECT_LT(only_one.size(), a.size() / 50) << "a place on the grid's border may round to either side";
}

TEST(Polygonize, MeshesAMapLargerThanTheDeviceIdentically) {
  FuseOptions small = fuse_options(0.01f);
  Volume large(test_device(), small, 2.0f);
  fill(large, {-0.6f, -0.7f, -0.6f}, {0.8f, 0.6f, 0.7f}, sphere);
  Polygonizer polygonizer(test_device());
  const Mesh all = polygonizer.polygonize(large);
  small.device_memory = 10 << 20;  // 2,290 bricks of the map's 5,500
  Volume paged(test_device(), small, 2.0f);
  fill(paged, {-0.6f, -0.7f, -0.6f}, {0.8f, 0.6f, 0.7f}, sphere);
  ASSERT_GT(paged.bricks().size(), paged.capacity());
  const Mesh parts = polygonizer.polygonize(paged);
  EXPECT_EQ(all.triangles, parts.triangles);
  EXPECT_EQ(all.positions, parts.positions);
  EXPECT_EQ(all.normals, parts.normals);
}

TEST(Polygonize, PagesADenseMapThroughTheSmallestPool) {
  FuseOptions small = fuse_options(0.01f);
  small.device_memory = 10 << 20;
  Volume volume(test_device(), small, 2.0f);
  // All bricks of a block of 20 a side exist: no part may need more than the pool's capacity.
  fill(volume, {-0.79f, -0.79f, -0.79f}, {0.79f, 0.79f, 0.79f}, sphere);
  ASSERT_GE(volume.bricks().size(), 8000u);
  expect_closed(Polygonizer(test_device()).polygonize(volume));
}

TEST(Polygonize, MeshesSomeBricksAsInTheCompleteMesh) {
  Volume volume(test_device(), fuse_options(), 5.0f);
  fill(volume, {-0.6f, -0.7f, -0.6f}, {0.8f, 0.6f, 0.7f}, sphere);
  Polygonizer polygonizer(test_device());
  std::vector<Brick> right, left;
  for (const Brick& b : volume.bricks()) (b.x() > 0 ? right : left).push_back(b);
  const Mesh complete = polygonizer.polygonize(volume), a = polygonizer.on_device(volume, right),
             b = polygonizer.on_device(volume, left);
  EXPECT_EQ(a.triangles.size() + b.triangles.size(), complete.triangles.size());
  const auto has_all_places_of = [&](const Mesh& part) {
    std::set<std::array<float, 6>> places;
    for (std::size_t i = 0; i < complete.positions.size(); ++i)
      places.insert({complete.positions[i].x(), complete.positions[i].y(), complete.positions[i].z(),
                     complete.normals[i].x(), complete.normals[i].y(), complete.normals[i].z()});
    for (std::size_t i = 0; i < part.positions.size(); ++i)
      if (!places.contains({part.positions[i].x(), part.positions[i].y(), part.positions[i].z(), part.normals[i].x(),
                            part.normals[i].y(), part.normals[i].z()}))
        return false;
    return true;
  };
  EXPECT_TRUE(has_all_places_of(a));
  EXPECT_TRUE(has_all_places_of(b));
  EXPECT_GT(a.triangles.size(), 1000u);
  EXPECT_GT(b.triangles.size(), 1000u);
}

TEST(MarchingCubesTable, MatchesOnEveryFace) {
  // For each case and face, the directed segments on the face; the neighbor across the face has them reversed.
  const auto table = marching_cubes_table();
  const auto segments = [&](std::uint32_t inside, std::uint32_t axis, std::uint32_t side) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> found;
    const std::uint32_t* row = &table[inside * 16];
    const auto on_face = [&](std::uint32_t edge) { return edge >> 3 != axis && ((edge >> axis) & 1) == side; };
    for (std::uint32_t i = 0; i < row[0]; ++i)
      for (std::uint32_t k = 0; k < 3; ++k) {
        const std::uint32_t a = row[1 + 3 * i + k], b = row[1 + 3 * i + (k + 1) % 3];
        if (!on_face(a) || !on_face(b)) continue;
        const std::uint32_t bit = ~(1u << axis);
        ++found[{a & bit, b & bit}];
      }
    // A polygon's diagonal on the face is traversed in both directions and is not a border.
    for (auto& [segment, count] : found)
      if (const auto back = found.find({segment.second, segment.first}); back != found.end()) {
        const int both = std::min(count, back->second);
        count -= both;
        back->second -= both;
      }
    std::erase_if(found, [](const auto& s) { return s.second == 0; });
    return found;
  };
  for (std::uint32_t axis = 0; axis < 3; ++axis)
    for (std::uint32_t low = 0; low < 256; ++low)
      for (std::uint32_t high = 0; high < 256; ++high) {
        bool fits = true;  // the upper face of `low` is the lower face of `high`
        for (std::uint32_t c = 0; c < 8; ++c)
          if ((c >> axis & 1) == 0) fits = fits && (high >> c & 1) == (low >> (c | 1u << axis) & 1);
        if (!fits) continue;
        const auto up = segments(low, axis, 1);
        const auto down = segments(high, axis, 0);
        ASSERT_EQ(up.size(), down.size());
        for (const auto& [segment, count] : up) {
          const auto back = down.find({segment.second, segment.first});
          ASSERT_TRUE(back != down.end() && back->second == count) << low << ' ' << high << ' ' << axis;
        }
      }
}

TEST(Raycast, RendersTheExactSphere) {
  Volume volume(test_device(), fuse_options(0.01f), 5.0f);
  const auto far_sphere = [](const Eigen::Vector3f& p) { return (p - Eigen::Vector3f(0, 0, 1.5f)).norm() - 0.4f; };
  fill(volume, {-0.5f, -0.5f, 1.0f}, {0.5f, 0.5f, 2.0f}, far_sphere);
  volume.page_in(volume.bricks());
  const Camera camera = small_camera();
  Raycaster raycaster(test_device(), camera, {}, 2, 0);
  const SurfacePrediction view = raycaster.raycast(volume, Eigen::Isometry3d::Identity());
  const auto points =
      download<shader::uvec2>(view.levels[0]->points, static_cast<std::size_t>(camera.width * camera.height));
  // A trilinear field deviates by h^2 / 8r over a cell of 1 cm; Newton's steps end within a tenth of this error.
  constexpr double kCell = 1e-4, kNormal = 0.998;
  int hits = 0, misses = 0;
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector3d ray = camera.ray(x, y);
      const double b = ray.z() * 1.5, root = b * b - ray.squaredNorm() * (1.5 * 1.5 - 0.16);
      const auto& p = points[static_cast<std::size_t>(y * camera.width + x)];
      const float z = std::bit_cast<float>(p.x);
      if (root < 0) {
        if (root / ray.squaredNorm() > -0.01) continue;  // passes the sphere within about a voxel
        ASSERT_EQ(z, 0.0f);
        continue;
      }
      const double expected = (b - std::sqrt(root)) / ray.squaredNorm();
      const Eigen::Vector3d normal = (ray * expected - Eigen::Vector3d(0, 0, 1.5)) / 0.4;
      if (-normal.dot(ray.normalized()) < 0.3) continue;  // the rim: rays leave the band before they reach the surface
      if (z == 0) {
        ++misses;
        continue;
      }
      ++hits;
      ASSERT_NEAR(z, expected, 4 * kCell) << x << ' ' << y;
      ASSERT_GT(twin::unpack_normal(p.y).cast<double>().dot(normal), kNormal) << x << ' ' << y;
    }
  EXPECT_GT(hits, 10000);
  EXPECT_LT(misses, hits / 1000);
}

TEST(Raycast, ReadsAPoolLargerThanTheDevicesTexelsByAddress) {
  const Camera camera = small_camera();
  const Scene scene = synthetic_scene("room");
  Preprocessor preprocessor(test_device(), camera, {}, 1, 0);
  Integrator integrator(test_device(), camera, {});
  Raycaster raycaster(test_device(), camera, {}, 2, 0);
  FuseOptions large = fuse_options();
  large.device_memory = 8 * test_device().max_texels() + (std::uint64_t{64} << 20);
  if (large.device_memory > test_device().max_allocation()) GTEST_SKIP() << "the device has no buffer of that size";
  const auto seen = [&](const FuseOptions& options, bool as_texels) {
    Volume volume(test_device(), options, 5.0f);
    EXPECT_EQ(volume.is_read_as_texels(), as_texels);
    Eigen::Isometry3d pose;
    for (int i = 0; i < 3; ++i) {
      const Frame frame = scene_frame(scene, camera, i);
      pose = *frame.world_from_camera;
      (void)integrator.integrate(preprocessor.preprocess(frame), pose, volume, static_cast<std::uint32_t>(i + 1));
    }
    const SurfacePrediction view = raycaster.raycast(volume, pose);
    return download<std::uint64_t>(view.levels[0]->points, static_cast<std::size_t>(camera.width * camera.height));
  };
  const auto by_address = seen(large, false);
  EXPECT_EQ(by_address, seen(fuse_options(), true));
  EXPECT_GT(std::count_if(by_address.begin(), by_address.end(), [](std::uint64_t p) { return p != 0; }), 1000);
}

TEST(Raycast, HalvesTheViewLikeItsPlainTwin) {
  const Camera camera = small_camera();
  const Frame frame = scene_frame(synthetic_scene("room"), camera, 0);
  Preprocessor preprocessor(test_device(), camera, {}, 1, 0);
  Volume volume(test_device(), fuse_options(0.02f), 5.0f);
  (void)Integrator(test_device(), camera, {})
      .integrate(preprocessor.preprocess(frame), *frame.world_from_camera, volume, 1);
  Raycaster raycaster(test_device(), camera, {}, 2, 0);
  const SurfacePrediction view = raycaster.raycast(volume, *frame.world_from_camera);
  const auto depth_of = [](const VertexNormalMap& image) {
    const auto points =
        download<shader::uvec2>(image.points, static_cast<std::size_t>(image.camera.width * image.camera.height));
    std::vector<float> depth(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) depth[i] = std::bit_cast<float>(points[i].x);
    return depth;
  };
  const auto expected = twin::half(depth_of(*view.levels[0]), camera), half = depth_of(*view.levels[1]);
  ASSERT_EQ(half.size(), expected.size());
  for (std::size_t i = 0; i < half.size(); ++i) ASSERT_NEAR(half[i], expected[i], 1e-5f) << i;
}

TEST(Integrate, EqualsItsPlainTwin) {
  const Camera camera = small_camera();
  const Scene scene = synthetic_scene("room");
  Preprocessor preprocessor(test_device(), camera, {}, 1, 0);
  Volume volume(test_device(), fuse_options(0.02f), 5.0f);
  Integrator integrator(test_device(), camera, {});
  std::vector<std::pair<Eigen::Isometry3d, std::vector<shader::uvec2>>> fused;
  for (int i = 0; i < 3; ++i) {
    const Frame frame = scene_frame(scene, camera, 5 * i);
    const FramePyramid surface = preprocessor.preprocess(frame);
    const IntegrationResult result =
        integrator.integrate(surface, *frame.world_from_camera, volume, static_cast<std::uint32_t>(i + 1));
    EXPECT_GT(result.touched, 100);
    fused.emplace_back(*frame.world_from_camera, download<shader::uvec2>(*surface.fusion, frame.depth.size()));
  }
  const BrickTree& tree = volume.on_host();
  int compared = 0, different = 0;
  for (const Brick& brick : tree.bricks()) {
    const std::uint64_t* voxels = tree.find(brick);
    for (int i = 0; i < 512; i += 7) {
      const Eigen::Vector3d p = 0.02 * (8 * brick + Brick(i >> 6, i >> 3 & 7, i & 7)).cast<double>();
      twin::Voxel expected;
      for (const auto& [pose, image] : fused) {
        std::vector<float> depth(image.size());
        std::vector<std::uint32_t> color(image.size());
        const Eigen::Vector3d q = pose.inverse() * p;
        // Only the pixel at the voxel's projection matters.
        if (q.z() <= 0) continue;
        const Eigen::Vector2d pixel = camera.project(q).array() + 0.5;
        if (pixel.minCoeff() < 0 || pixel.x() >= camera.width || pixel.y() >= camera.height) continue;
        const auto at =
            static_cast<std::size_t>(static_cast<int>(pixel.y()) * camera.width + static_cast<int>(pixel.x()));
        depth[at] = std::bit_cast<float>(image[at].x);
        color[at] = image[at].y;
        twin::integrate(expected, q, depth, color, camera, volume.options());
      }
      const std::uint64_t v = voxels[i];
      const float distance = shader::voxel_distance(v), weight = shader::voxel_weight(v);
      ++compared;
      // A voxel projected onto a pixel's border may use the neighbor; a brick behind all surfaces is skipped.
      const bool same = std::abs(weight - expected.weight) < 0.01f && std::abs(distance - expected.distance) < 1e-3f &&
                        std::abs(static_cast<float>(v >> 32 & 0xff) - expected.color.x()) <= 1.5f;
      different += !same;
    }
    if (compared > 4000) break;
  }
  EXPECT_GT(compared, 2000);
  EXPECT_LT(different, compared / 100);
}

TEST(Integrate, AllocatesTheBricksOfItsPlainTwin) {
  const Camera camera = small_camera();
  const Frame frame = scene_frame(synthetic_scene("room"), camera, 0);
  Preprocessor preprocessor(test_device(), camera, {}, 1, 0);
  const FuseOptions options = fuse_options(0.01f);
  Volume volume(test_device(), options, 5.0f);
  const FramePyramid surface = preprocessor.preprocess(frame);
  // Half a brick at 5 m is 2.1 pixels: every second pixel, from phase 1 on (fused_count 1) in x, 0 in y.
  (void)Integrator(test_device(), camera, {}).integrate(surface, *frame.world_from_camera, volume, 1);
  const auto image = download<shader::uvec2>(*surface.fusion, frame.depth.size());
  std::vector<float> depth(image.size());
  for (std::size_t i = 0; i < image.size(); ++i) depth[i] = std::bit_cast<float>(image[i].x);
  const auto expected = twin::bands(depth, camera, *frame.world_from_camera, options, 2, 1, 0);
  std::vector<Brick> only_one;
  const auto allocated = volume.bricks();
  std::set_symmetric_difference(allocated.begin(), allocated.end(), expected.begin(), expected.end(),
                                std::back_inserter(only_one), [](const Brick& a, const Brick& b) {
                                  return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
                                });
  EXPECT_GT(allocated.size(), 1000u);
  EXPECT_LT(only_one.size(), allocated.size() / 200) << "a sample on a brick's border may fall to either side";
}

TEST(Integrate, AllocatesAnyNumberOfNewBricks) {
  const Camera camera = small_camera();
  const FuseOptions options{.voxel_size = 0.004f, .truncation = 0.016f, .device_memory = std::uint64_t{224} << 20};
  const Frame frame{.depth = std::vector<float>(static_cast<std::size_t>(camera.width * camera.height), 3.0f)};
  Preprocessor preprocessor(test_device(), camera, {}, 1, 0);
  Volume volume(test_device(), options, 5.0f);
  const IntegrationResult fused =
      Integrator(test_device(), camera, {})
          .integrate(preprocessor.preprocess(frame), Eigen::Isometry3d::Identity(), volume, 2);
  // More bricks than one pass can list: all must be allocated in this frame, else the selection would depend on thread
  // order.
  const auto expected = twin::bands(frame.depth, camera, Eigen::Isometry3d::Identity(), options, 1, 0, 0);
  ASSERT_GT(expected.size(), 17000u);
  EXPECT_NEAR(fused.new_bricks, static_cast<double>(expected.size()), static_cast<double>(expected.size() / 200));
  EXPECT_EQ(volume.bricks().size(), static_cast<std::size_t>(fused.new_bricks));
}

TEST(Integrate, PutsTheZeroCrossingOnThePlane) {
  const Camera camera = small_camera();
  const Scene scene = synthetic_scene("plane");  // z = 2 m
  Preprocessor preprocessor(test_device(), camera, {}, 1, 0);
  Volume volume(test_device(), fuse_options(0.02f), 5.0f);
  Integrator integrator(test_device(), camera, {});
  for (int i = 0; i < 3; ++i) {
    const Frame frame = scene_frame(scene, camera, 10 * i);
    integrator.integrate(preprocessor.preprocess(frame), *frame.world_from_camera, volume,
                         static_cast<std::uint32_t>(i + 1));
  }
  const Mesh mesh = Polygonizer(test_device()).polygonize(volume);
  ASSERT_GT(mesh.positions.size(), 1000u);
  // Projective distances of oblique views disagree away from the surface, not on it; a pixel is up to 4 mm wide here.
  constexpr float kPixel = 2e-3f;
  for (const auto& p : mesh.positions) ASSERT_NEAR(p.z(), 2.0f, kPixel);
}

TEST(Integrate, CarvesRemovedObjects) {
  const Camera camera = small_camera();
  Preprocessor preprocessor(test_device(), camera, {}, 1, 0);
  FuseOptions options = fuse_options(0.02f);
  options.max_weight = 8;
  Volume volume(test_device(), options, 5.0f);
  Integrator integrator(test_device(), camera, {});
  Frame frame{.depth = std::vector<float>(static_cast<std::size_t>(camera.width * camera.height), 3.0f)};
  for (int y = 80; y < 160; ++y)
    for (int x = 120; x < 200; ++x) frame.depth[static_cast<std::size_t>(y * camera.width + x)] = 1.0f;
  integrator.integrate(preprocessor.preprocess(frame), Eigen::Isometry3d::Identity(), volume, 1);
  const auto near = [&] {
    const Mesh mesh = Polygonizer(test_device()).polygonize(volume);
    return std::count_if(mesh.positions.begin(), mesh.positions.end(), [](const auto& p) { return p.z() < 2; });
  };
  EXPECT_GT(near(), 100);
  std::fill(frame.depth.begin(), frame.depth.end(), 3.0f);
  for (std::uint32_t i = 2; i < 30; ++i)
    integrator.integrate(preprocessor.preprocess(frame), Eigen::Isometry3d::Identity(), volume, i);
  EXPECT_EQ(near(), 0);
}

TEST(Volume, PagesBricksOutAndInAsTheWindowMoves) {
  Volume volume(test_device(), fuse_options(0.02f), 2.0f);
  fill(volume, {-0.6f, -0.7f, -0.6f}, {0.8f, 0.6f, 0.7f}, sphere);
  const auto all = volume.bricks();
  volume.page_in(all);
  Polygonizer polygonizer(test_device());
  const Mesh before = polygonizer.polygonize(volume);
  volume.move_window({100, 0, 0});
  for (const Brick& b : all) ASSERT_EQ(volume.slot_of(b), Volume::kNoSlot);
  EXPECT_EQ(volume.counts().paged_out, all.size());
  volume.move_window({0, 0, 0});
  volume.page_in(all);
  EXPECT_NE(volume.slot_of(all[0]), Volume::kNoSlot);
  const Mesh after = polygonizer.polygonize(volume);
  EXPECT_EQ(before.positions, after.positions);
  EXPECT_EQ(before.triangles, after.triangles);
}

TEST(Volume, ListsAllBricksOfItsTree) {
  Volume volume(test_device(), fuse_options(0.02f), 2.0f);
  fill(volume, {-0.6f, -0.7f, -0.6f}, {0.8f, 0.6f, 0.7f}, sphere);
  const auto all = volume.bricks();
  volume.move_window({100, 0, 0});
  volume.move_window({0, 0, 0});
  volume.page_in(std::span(all).first(all.size() / 2));  // the rest stays on the host
  volume.mark_free({.bricks = {{90, 0, -3}, all[0]}, .voxels = {kAllBits, {1, 2}}});
  const TemporaryFolder folder;
  const BrickList list = volume.list();
  EXPECT_EQ(list.bricks.size(), all.size());
  write_bricks(folder / "list.vdb", list);
  const BrickTree read = BrickFile(folder / "list.vdb").read();
  const BrickTree& tree = volume.on_host();
  ASSERT_EQ(read.bricks(), all);
  for (const Brick& brick : all) EXPECT_TRUE(std::equal(tree.find(brick), tree.find(brick) + 512, read.find(brick)));
  ASSERT_EQ(read.free_bricks(), tree.free_bricks());
  for (const Brick& brick : tree.free_bricks()) EXPECT_EQ(read.free_voxels(brick), tree.free_voxels(brick));
}

TEST(Volume, SplitReturnsSeenBricksAndKeepsNearOnes) {
  Volume volume(test_device(), fuse_options(), 2.0f);
  const std::vector<Brick> old = {{0, 0, 0}, {1, 0, 0}}, seen = {{2, 0, 0}, {3, 0, 0}, {9, 0, 0}};
  volume.make_resident(old, 1);
  volume.make_resident(seen, 5);
  const BrickTree submap = tree_of(volume.split(2, Eigen::Vector3d::Zero(), 1.0f));
  EXPECT_EQ(submap.bricks(), seen);
  // Bricks are 16 cm wide: the last is 1.5 m away.
  EXPECT_EQ(volume.bricks(), (std::vector<Brick>{{2, 0, 0}, {3, 0, 0}}));
  // Kept bricks do not count as observed by the next submap.
  EXPECT_EQ(volume.split(6, Eigen::Vector3d::Zero(), 1.0f).bricks.size(), 0u);
}

TEST(Volume, SplitTreatsHostAndDeviceBricksEqually) {
  Volume volume(test_device(), fuse_options(), 2.0f);
  const std::vector<Brick> near = {{0, 0, 0}, {1, 0, 0}, {9, 0, 0}};
  volume.make_resident(near, 5);
  volume.move_window({30, 0, 0});  // moves them to the host
  ASSERT_EQ(volume.slot_of(near[0]), Volume::kNoSlot);
  volume.move_window(Eigen::Vector3d::Zero());
  const std::vector<Brick> here = {{2, 0, 0}};
  volume.make_resident(here, 5);
  const BrickTree submap = tree_of(volume.split(2, Eigen::Vector3d::Zero(), 1.0f));
  EXPECT_EQ(submap.bricks(), (std::vector<Brick>{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {9, 0, 0}}));
  EXPECT_EQ(volume.bricks(), (std::vector<Brick>{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}));
  // A removed brick leaves no pending entry.
  const std::vector<Brick> again = {{9, 0, 0}};
  volume.make_resident(again, 6);
  EXPECT_EQ(tree_of(volume.split(6, Eigen::Vector3d::Zero(), 1.0f)).bricks(), again);
}

TEST(Volume, SplitReturnsFreeSpaceInsideAndOutsideOfBricks) {
  Volume volume(test_device(), fuse_options(), 2.0f);
  const BrickBits some{1, 0, 0xff00};
  const std::vector<Brick> free = {{-2, 0, 0}, {0, 0, 0}, {1, 0, 0}, {9, 0, 0}}, filled = {{1, 0, 0}};
  EXPECT_EQ(volume.mark_free({free, {some, kAllBits, kAllBits, some}}), free);
  EXPECT_TRUE(volume.mark_free({{free[0], free[1]}, {some, some}}).empty());  // known
  volume.make_resident(filled, 1);
  const BrickTree submap = tree_of(volume.split(2, Eigen::Vector3d::Zero(), 1.0f));
  EXPECT_EQ(submap.free_bricks(), free);
  EXPECT_EQ(submap.free_voxels(free[0]), some);
  // Bricks are 16 cm wide: the last is 1.5 m away.
  EXPECT_EQ(volume.host().free_bricks(), (std::vector<Brick>{free[0], free[1], free[2]}));
  EXPECT_TRUE(volume.host().is_free(free[1]));
  EXPECT_FALSE(volume.host().is_free(free[0]));  // partially
}

TEST(Volume, RestoresWithAnotherReachOrLessMemory) {
  Volume volume(test_device(), fuse_options(), 5.0f);
  std::vector<Brick> all;  // the last are 4.8 m away
  for (int x = -30; x < 30; ++x)
    for (int y = -25; y < 25; ++y) all.emplace_back(x, y, 0);
  volume.make_resident(all, 5);
  const Volume::SavedState saved = volume.save();
  const BrickTree tree = volume.on_host().copy();
  FuseOptions small = fuse_options();
  small.device_memory = 10 << 20;  // 2500 bricks
  for (const auto& [options, reach] : {std::pair(fuse_options(), 2.0f), {fuse_options(), 9.0f}, {small, 5.0f}}) {
    Volume other(test_device(), options, reach);
    other.restore(tree.copy(), saved);
    EXPECT_EQ(other.bricks(), all);
    EXPECT_EQ(tree_of(other.split(5, Eigen::Vector3d::Zero(), 1.0f)).bricks(), all);
  }
}

TEST(Volume, RejectsTooLittleDeviceMemory) {
  FuseOptions options = fuse_options();
  options.device_memory = 1 << 20;
  EXPECT_NE(
      error_of([&] { Volume(test_device(), options, 5.0f); }).find("FuseOptions::device_memory of 1 MiB is too little"),
      std::string::npos);
}

TEST(Grids, RoundTripThroughAFile) {
  const TemporaryFolder folder;
  BrickTree tree;
  for (int i = 0; i < 20; ++i) {
    BrickVoxels voxels{};
    for (std::uint32_t k = 0; k < 512; ++k)
      if ((k + static_cast<std::uint32_t>(i)) % 3 != 0)
        voxels[k] = (k * 128u - 30000u) % 65536u | static_cast<std::uint64_t>(k + 1) << 16 |
                    static_cast<std::uint64_t>((k * 2654435761u) % 0xffffffu | 5u << 24) << 32;
    // -32768 is not a valid distance
    for (auto& v : voxels)
      if ((v & 0xffff) == 0x8000) v = 0;
    tree.put({i - 10, 3 * i, -i}, voxels);
  }
  write_grids(folder / "map.vdb", tree, {.voxel_size = 0.01f, .truncation = 0.04f});
  const ReadGrids read = read_grids(folder / "map.vdb");
  EXPECT_FLOAT_EQ(read.info.voxel_size, 0.01f);
  EXPECT_FLOAT_EQ(read.info.truncation, 0.04f);
  ASSERT_EQ(read.tree.bricks(), tree.bricks());
  for (const Brick& b : tree.bricks())
    for (std::size_t k = 0; k < 512; ++k) ASSERT_EQ(read.tree.find(b)[k], tree.find(b)[k]) << k;
}

TEST(Grids, WrittenInPartsAreByteIdentical) {
  const TemporaryFolder folder;
  const GridInfo info{.voxel_size = 0.01f, .truncation = 0.04f};
  std::vector<Brick> bricks;  // of several nodes of every level
  for (int i = -700; i < 700; i += 7) bricks.emplace_back(i, (37 * i) % 50, -(i % 600));
  std::sort(bricks.begin(), bricks.end(), before_in_grid);
  BrickTree complete;
  GridsWriter writer(folder / "parts.vdb", info);
  for (std::size_t begin = 0; begin < bricks.size(); begin += 30) {
    BrickTree part;
    for (const Brick& brick : std::span(bricks).subspan(begin, std::min<std::size_t>(30, bricks.size() - begin))) {
      BrickVoxels voxels{};
      for (std::uint64_t k = 0; k < 512; k += 2) voxels[k] = k | (k + 1) << 16 | (k * 12345) << 32;
      part.put(brick, voxels);
      complete.put(brick, voxels);
    }
    writer.add(part);
  }
  BrickTree free;
  for (const Brick& brick : {Brick(0, 0, 1), Brick(4, 4, 4), Brick(-800, 0, 0), bricks[3]}) free.mark_free(brick);
  free.mark_free({4, 4, 5}, {7, 0, 1});
  for (const Brick& brick : free.free_bricks()) complete.mark_free(brick, free.free_voxels(brick));
  writer.write(free, nullptr);
  write_grids(folder / "complete.vdb", complete, info);
  EXPECT_TRUE(read_bytes(folder / "parts.vdb") == read_bytes(folder / "complete.vdb"));
  const ReadGrids read = read_grids(folder / "parts.vdb");
  EXPECT_EQ(read.tree.bricks(), complete.bricks());
  EXPECT_EQ(read.tree.free_bricks(), complete.free_bricks());
  // No other file is left in the folder.
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 2);
}

TEST(Grids, AreNotReplacedByAnIncompleteFile) {
  const TemporaryFolder folder;
  write_text(folder / "map.vdb", "the old map");
  BrickTree tree;
  for (std::uint32_t i = 0; i < 500; ++i) {
    BrickVoxels voxels;
    for (std::uint32_t k = 0; k < 512; ++k) voxels[k] = (k * 2654435761u + i * 40503u) | 1u << 16;
    tree.put({static_cast<int>(i), 0, 0}, voxels);
  }
  // A file size limit acts as a full disk.
  const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit old_limit{}, limit{};
  getrlimit(RLIMIT_FSIZE, &old_limit);
  limit = {.rlim_cur = 100000, .rlim_max = old_limit.rlim_max};
  setrlimit(RLIMIT_FSIZE, &limit);
  const std::string error =
      error_of([&] { write_grids(folder / "map.vdb", tree, {.voxel_size = 0.01f, .truncation = 0.04f}); });
  setrlimit(RLIMIT_FSIZE, &old_limit);
  std::signal(SIGXFSZ, old_handler);
  EXPECT_NE(error.find("cannot write"), std::string::npos) << error;
  EXPECT_TRUE(read_bytes(folder / "map.vdb") == "the old map");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST(Grids, RejectAFileThatIsNoMap) {
  const TemporaryFolder folder;
  write_text(folder / "map.vdb", "nothing of the kind");
  EXPECT_NE(error_of([&] { (void)read_grids(folder / "map.vdb"); }).find("map.vdb"), std::string::npos);
}

}  // namespace
}  // namespace cairn
