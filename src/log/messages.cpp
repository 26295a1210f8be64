// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "log/messages.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <vector>

#include "base/image_file.hpp"

namespace cairn {
namespace {

constexpr int kPointStride = 4;          // pixels between logged points
constexpr double kUnitsPerMeter = 1000;  // of depth images, as in ROS
constexpr JpegEffort kColor{.quality = 85};

ProtoMessage at(LogTime time) {
  constexpr LogTime kSecond = 1'000'000'000;
  return ProtoMessage("google.protobuf.Timestamp").put("seconds", time / kSecond).put("nanos", time % kSecond);
}

template <class Vector>
ProtoMessage xyz(std::string_view schema, const Vector& v) {
  return ProtoMessage(schema)
      .put("x", static_cast<double>(v.x()))
      .put("y", static_cast<double>(v.y()))
      .put("z", static_cast<double>(v.z()));
}

ProtoMessage quaternion(const Eigen::Isometry3d& pose) {
  const Eigen::Quaterniond q(pose.linear());
  return xyz("foxglove.Quaternion", q).put("w", q.w());
}

ProtoMessage pose_message(const Eigen::Isometry3d& pose) {
  return ProtoMessage("foxglove.Pose")
      .put("position", xyz("foxglove.Vector3", pose.translation()))
      .put("orientation", quaternion(pose));
}

template <class T>
std::string_view bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

ProtoMessage color_message(const std::array<std::uint8_t, 4>& c) {
  return ProtoMessage("foxglove.Color")
      .put("r", c[0] / 255.0)
      .put("g", c[1] / 255.0)
      .put("b", c[2] / 255.0)
      .put("a", 1.0);
}

std::string entity_of(const SurfaceBlock& part) {
  return fmt::format("{} {} {} {}", part.submap, part.cell.x(), part.cell.y(), part.cell.z());
}

ProtoMessage entity_message(LogTime time, const SurfaceBlock& part) {
  const Mesh& mesh = part.mesh;
  ProtoMessage triangles("foxglove.TriangleListPrimitive");
  triangles.put("pose", pose_message(Eigen::Isometry3d::Identity()));
  for (const auto& p : mesh.positions) triangles.put("points", xyz("foxglove.Point3", p));
  for (const auto& c : mesh.colors) triangles.put("colors", color_message(c));
  std::vector<std::uint32_t> indices;
  indices.reserve(3 * mesh.triangles.size());
  for (const auto& t : mesh.triangles) indices.insert(indices.end(), t.begin(), t.end());
  triangles.put("indices", std::span<const std::uint32_t>(indices));
  ProtoMessage entity("foxglove.SceneEntity");
  entity.put("timestamp", at(time)).put("frame_id", submap_frame(part.submap)).put("id", entity_of(part));
  return entity.put("frame_locked", true).put("triangles", triangles);
}

/// Rounds to a quarter of a millimeter: point clouds then compress to two thirds of the size.
float rounded(double meters) {
  constexpr double kSteps = 4096;
  return static_cast<float>(std::round(meters * kSteps) / kSteps);
}

/// Color of a point in the depth camera's frame, if visible to the color camera; pixels are R, G, B, 255.
std::optional<std::uint32_t> color_of(const Eigen::Vector3d& point, const ColorCamera& color, const Frame& frame) {
  const Eigen::Vector3d p = color.color_from_depth * point;
  if (p.z() <= 0) return std::nullopt;
  const Camera& camera = color.camera;
  const Eigen::Vector2d ray = camera.distort(p.head<2>() / p.z());
  const auto u = static_cast<int>(std::lround(camera.fx * ray.x() + camera.cx)),
             v = static_cast<int>(std::lround(camera.fy * ray.y() + camera.cy));
  if (u < 0 || v < 0 || u >= camera.width || v >= camera.height) return std::nullopt;
  return frame
      .color[static_cast<std::size_t>(v) * static_cast<std::size_t>(camera.width) + static_cast<std::size_t>(u)];
}

}  // namespace

std::string submap_frame(int submap) { return fmt::format("submap_{}", submap); }

ProtoMessage transforms_message(LogTime time, std::span<const NamedTransform> transforms) {
  ProtoMessage all("foxglove.FrameTransforms");
  for (const NamedTransform& t : transforms)
    all.put("transforms", ProtoMessage("foxglove.FrameTransform")
                              .put("timestamp", at(time))
                              .put("parent_frame_id", t.parent)
                              .put("child_frame_id", t.child)
                              .put("translation", xyz("foxglove.Vector3", t.parent_from_child.translation()))
                              .put("rotation", quaternion(t.parent_from_child)));
  return all;
}

ProtoMessage poses_message(LogTime time, std::string_view frame, const Trajectory& poses) {
  ProtoMessage message("foxglove.PosesInFrame");
  message.put("timestamp", at(time)).put("frame_id", frame);
  for (const StampedPose& pose : poses) message.put("poses", pose_message(pose.world_from_camera));
  return message;
}

ProtoMessage calibration_message(LogTime time, std::string_view frame, const Camera& c) {
  const bool is_fisheye = c.lens == Lens::fisheye;
  const std::array<double, 9> k{c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1}, r{1, 0, 0, 0, 1, 0, 0, 0, 1};
  const std::array<double, 12> p{c.fx, 0, c.cx, 0, 0, c.fy, c.cy, 0, 0, 0, 1, 0};
  return ProtoMessage("foxglove.CameraCalibration")
      .put("timestamp", at(time))
      .put("frame_id", frame)
      .put("width", c.width)
      .put("height", c.height)
      .put("distortion_model", is_fisheye ? "kannala_brandt" : "rational_polynomial")
      .put("D", std::span<const double>(c.distortion.data(), is_fisheye ? 4 : 8))
      .put("K", std::span<const double>(k))
      .put("R", std::span<const double>(r))
      .put("P", std::span<const double>(p));
}

ProtoMessage color_image_message(LogTime time, std::string_view frame, const Frame& of, const Camera& camera) {
  const cv::Mat pixels(camera.height, camera.width, CV_8UC4, const_cast<std::uint32_t*>(of.color.data()));
  return ProtoMessage("foxglove.CompressedImage")
      .put("timestamp", at(time))
      .put("frame_id", frame)
      .put("data", bytes_of(encode_jpeg(pixels, kColor)))
      .put("format", "jpeg");
}

ProtoMessage depth_image_message(LogTime time, std::string_view frame, const Frame& of, const Camera& camera) {
  return ProtoMessage("foxglove.RawImage")
      .put("timestamp", at(time))
      .put("frame_id", frame)
      .put("width", camera.width)
      .put("height", camera.height)
      .put("encoding", "16UC1")
      .put("step", 2 * camera.width)
      .put("data", bytes_of(depth_units(of.depth, kUnitsPerMeter)));
}

ProtoMessage points_message(LogTime time, std::string_view frame, const Frame& of, const Rig& rig) {
  enum NumericType { kUint8 = 1, kFloat32 = 7 };
  struct Point {
    float x, y, z;
    std::uint32_t color;
  };
  const ColorCamera color = rig.color.value_or(ColorCamera{.camera = rig.depth});
  std::vector<Point> points;
  for (int v = 0; v < rig.depth.height; v += kPointStride)
    for (int u = 0; u < rig.depth.width; u += kPointStride) {
      const auto z = static_cast<double>(of.depth[static_cast<std::size_t>(v * rig.depth.width + u)]);
      if (z <= 0) continue;
      const Eigen::Vector2d ray = rig.depth.undistorted_ray(u, v);
      const Eigen::Vector3d p(ray.x() * z, ray.y() * z, z);
      constexpr std::uint32_t kGray = 0xffa0a0a0;
      const std::uint32_t seen = of.color.empty() ? kGray : color_of(p, color, of).value_or(kGray);
      points.push_back({rounded(p.x()), rounded(p.y()), rounded(z), seen});
    }
  ProtoMessage message("foxglove.PointCloud");
  message.put("timestamp", at(time)).put("frame_id", frame).put("pose", pose_message(Eigen::Isometry3d::Identity()));
  message.put("point_stride", sizeof(Point));
  const auto add = [&](const char* name, std::size_t offset, NumericType type) {
    message.put("fields",
                ProtoMessage("foxglove.PackedElementField").put("name", name).put("offset", offset).put("type", type));
  };
  add("x", offsetof(Point, x), kFloat32);
  add("y", offsetof(Point, y), kFloat32);
  add("z", offsetof(Point, z), kFloat32);
  for (std::size_t i = 0; const char* name : {"red", "green", "blue", "alpha"})
    add(name, offsetof(Point, color) + i++, kUint8);
  return message.put("data", bytes_of(points));
}

ProtoMessage surface_message(LogTime time, std::span<const SurfaceBlock> parts) {
  ProtoMessage scene("foxglove.SceneUpdate");
  for (const SurfaceBlock& part : parts)
    if (part.mesh.triangles.empty())
      scene.put("deletions", ProtoMessage("foxglove.SceneEntityDeletion")
                                 .put("timestamp", at(time))
                                 .put("type", 0)
                                 .put("id", entity_of(part)));
    else
      scene.put("entities", entity_message(time, part));
  return scene;
}

ProtoMessage no_surface_message(LogTime time) {
  return ProtoMessage("foxglove.SceneUpdate")
      .put("deletions", ProtoMessage("foxglove.SceneEntityDeletion").put("timestamp", at(time)).put("type", 1));
}

ProtoMessage text_message(LogTime time, LogLevel level, std::string_view text) {
  return ProtoMessage("foxglove.Log")
      .put("timestamp", at(time))
      .put("level", level)
      .put("message", text)
      .put("name", "cairn");
}

ProtoMessage report_message(LogTime time, const FrameReport& report) {
  ProtoMessage message("cairn.Frame");
  message.put("timestamp", at(time)).put("index", report.index).put("state", report.state);
  message.put("reason", report.reason);
  message.put("inlier_share", report.fit.inlier_share).put("overlap", report.fit.overlap).put("rmse", report.fit.rmse);
  message.put("photometric_rmse", report.fit.photometric_rmse).put("iterations", report.fit.iterations);
  message.put("degenerate_directions", report.fit.degenerate_directions).put("moving", report.moving);
  message.put("touched_bricks", report.touched_bricks).put("new_bricks", report.new_bricks);
  double all = 0;
  for (const auto& [stage, ms] : report.stage_ms) {
    all += ms;
    message.put("stages", ProtoMessage("cairn.Stage").put("name", stage).put("ms", ms));
  }
  return message.put("ms", all);
}

}  // namespace cairn
