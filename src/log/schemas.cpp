// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Schemas of logged messages: Foxglove's, with the published names and numbers
// (https://docs.foxglove.dev/docs/sdk/schemas), the descriptors of Protocol Buffers, and Cairn's own.
#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "log/protobuf.hpp"

namespace cairn {
namespace {

constexpr bool kRepeated = true;  // repeated field
constexpr std::string_view kTime = "google.protobuf.Timestamp";

/// Schemas for times and for schema descriptors.
std::vector<ProtoSchema> times_and_descriptors() {
  using enum ProtoType;
  return {
      {"google.protobuf.Timestamp", {{"seconds", 1, int64}, {"nanos", 2, int32}}},
      {"google.protobuf.Duration", {{"seconds", 1, int64}, {"nanos", 2, int32}}},

      {"google.protobuf.FileDescriptorSet", {{"file", 1, message, "google.protobuf.FileDescriptorProto", kRepeated}}},
      {"google.protobuf.FileDescriptorProto",
       {{"name", 1, text},
        {"package", 2, text},
        {"dependency", 3, text, {}, kRepeated},
        {"message_type", 4, message, "google.protobuf.DescriptorProto", kRepeated},
        {"syntax", 12, text}}},
      {"google.protobuf.DescriptorProto",
       {{"name", 1, text},
        {"field", 2, message, "google.protobuf.FieldDescriptorProto", kRepeated},
        {"enum_type", 4, message, "google.protobuf.EnumDescriptorProto", kRepeated}}},
      {"google.protobuf.FieldDescriptorProto",
       {{"name", 1, text}, {"number", 3, int32}, {"label", 4, int32}, {"type", 5, int32}, {"type_name", 6, text}}},
      {"google.protobuf.EnumDescriptorProto",
       {{"name", 1, text}, {"value", 2, message, "google.protobuf.EnumValueDescriptorProto", kRepeated}}},
      {"google.protobuf.EnumValueDescriptorProto", {{"name", 1, text}, {"number", 2, int32}}},
  };
}

std::vector<ProtoSchema> frames_and_poses() {
  using enum ProtoType;
  return {
      {"foxglove.Vector3", {{"x", 1, float64}, {"y", 2, float64}, {"z", 3, float64}}},
      {"foxglove.Point3", {{"x", 1, float64}, {"y", 2, float64}, {"z", 3, float64}}},
      {"foxglove.Quaternion", {{"x", 1, float64}, {"y", 2, float64}, {"z", 3, float64}, {"w", 4, float64}}},
      {"foxglove.Color", {{"r", 1, float64}, {"g", 2, float64}, {"b", 3, float64}, {"a", 4, float64}}},
      {"foxglove.Pose",
       {{"position", 1, message, "foxglove.Vector3"}, {"orientation", 2, message, "foxglove.Quaternion"}}},
      {"foxglove.FrameTransform",
       {{"timestamp", 1, message, kTime},
        {"parent_frame_id", 2, text},
        {"child_frame_id", 3, text},
        {"translation", 4, message, "foxglove.Vector3"},
        {"rotation", 5, message, "foxglove.Quaternion"}}},
      {"foxglove.FrameTransforms", {{"transforms", 1, message, "foxglove.FrameTransform", kRepeated}}},
      {"foxglove.PosesInFrame",
       {{"timestamp", 1, message, kTime}, {"frame_id", 2, text}, {"poses", 3, message, "foxglove.Pose", kRepeated}}},
  };
}

std::vector<ProtoSchema> sensors_and_texts() {
  using enum ProtoType;
  return {
      {"foxglove.CompressedImage",
       {{"timestamp", 1, message, kTime}, {"frame_id", 4, text}, {"data", 2, bytes}, {"format", 3, text}}},
      {"foxglove.RawImage",
       {{"timestamp", 1, message, kTime},
        {"frame_id", 7, text},
        {"width", 2, fixed32},
        {"height", 3, fixed32},
        {"encoding", 4, text},
        {"step", 5, fixed32},
        {"data", 6, bytes}}},
      {"foxglove.CameraCalibration",
       {{"timestamp", 1, message, kTime},
        {"frame_id", 9, text},
        {"width", 2, fixed32},
        {"height", 3, fixed32},
        {"distortion_model", 4, text},
        {"D", 5, float64, {}, kRepeated},
        {"K", 6, float64, {}, kRepeated},
        {"R", 7, float64, {}, kRepeated},
        {"P", 8, float64, {}, kRepeated}}},
      {"foxglove.PackedElementField",
       {{"name", 1, text}, {"offset", 2, fixed32}, {"type", 3, enumeration, "NumericType"}},
       {{"NumericType", {"UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32", "FLOAT64"}}}},
      {"foxglove.PointCloud",
       {{"timestamp", 1, message, kTime},
        {"frame_id", 2, text},
        {"pose", 3, message, "foxglove.Pose"},
        {"point_stride", 4, fixed32},
        {"fields", 5, message, "foxglove.PackedElementField", kRepeated},
        {"data", 6, bytes}}},
      {"foxglove.Log",
       {{"timestamp", 1, message, kTime},
        {"level", 2, enumeration, "Level"},
        {"message", 3, text},
        {"name", 4, text},
        {"file", 5, text},
        {"line", 6, fixed32}},
       {{"Level", {"UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"}}}},
  };
}

/// Schemas for scene primitives; Cairn fills in triangles only.
std::vector<ProtoSchema> scene_primitives() {
  using enum ProtoType;
  return {
      {"foxglove.KeyValuePair", {{"key", 1, text}, {"value", 2, text}}},
      {"foxglove.ArrowPrimitive",
       {{"pose", 1, message, "foxglove.Pose"},
        {"shaft_length", 2, float64},
        {"shaft_diameter", 3, float64},
        {"head_length", 4, float64},
        {"head_diameter", 5, float64},
        {"color", 6, message, "foxglove.Color"}}},
      {"foxglove.CubePrimitive",
       {{"pose", 1, message, "foxglove.Pose"},
        {"size", 2, message, "foxglove.Vector3"},
        {"color", 3, message, "foxglove.Color"}}},
      {"foxglove.SpherePrimitive",
       {{"pose", 1, message, "foxglove.Pose"},
        {"size", 2, message, "foxglove.Vector3"},
        {"color", 3, message, "foxglove.Color"}}},
      {"foxglove.CylinderPrimitive",
       {{"pose", 1, message, "foxglove.Pose"},
        {"size", 2, message, "foxglove.Vector3"},
        {"bottom_scale", 3, float64},
        {"top_scale", 4, float64},
        {"color", 5, message, "foxglove.Color"}}},
      {"foxglove.LinePrimitive",
       {{"type", 1, enumeration, "Type"},
        {"pose", 2, message, "foxglove.Pose"},
        {"thickness", 3, float64},
        {"scale_invariant", 4, boolean},
        {"points", 5, message, "foxglove.Point3", kRepeated},
        {"color", 6, message, "foxglove.Color"},
        {"colors", 7, message, "foxglove.Color", kRepeated},
        {"indices", 8, fixed32, {}, kRepeated}},
       {{"Type", {"LINE_STRIP", "LINE_LOOP", "LINE_LIST"}}}},
      {"foxglove.TriangleListPrimitive",
       {{"pose", 1, message, "foxglove.Pose"},
        {"points", 2, message, "foxglove.Point3", kRepeated},
        {"color", 3, message, "foxglove.Color"},
        {"colors", 4, message, "foxglove.Color", kRepeated},
        {"indices", 5, fixed32, {}, kRepeated}}},
      {"foxglove.TextPrimitive",
       {{"pose", 1, message, "foxglove.Pose"},
        {"billboard", 2, boolean},
        {"font_size", 3, float64},
        {"scale_invariant", 4, boolean},
        {"color", 5, message, "foxglove.Color"},
        {"text", 6, text}}},
      {"foxglove.ModelPrimitive",
       {{"pose", 1, message, "foxglove.Pose"},
        {"scale", 2, message, "foxglove.Vector3"},
        {"color", 3, message, "foxglove.Color"},
        {"override_color", 4, boolean},
        {"url", 5, text},
        {"media_type", 6, text},
        {"data", 7, bytes}}},
  };
}

std::vector<ProtoSchema> scenes() {
  using enum ProtoType;
  return {
      {"foxglove.SceneEntity",
       {{"timestamp", 1, message, kTime},
        {"frame_id", 2, text},
        {"id", 3, text},
        {"lifetime", 4, message, "google.protobuf.Duration"},
        {"frame_locked", 5, boolean},
        {"metadata", 6, message, "foxglove.KeyValuePair", kRepeated},
        {"arrows", 7, message, "foxglove.ArrowPrimitive", kRepeated},
        {"cubes", 8, message, "foxglove.CubePrimitive", kRepeated},
        {"spheres", 9, message, "foxglove.SpherePrimitive", kRepeated},
        {"cylinders", 10, message, "foxglove.CylinderPrimitive", kRepeated},
        {"lines", 11, message, "foxglove.LinePrimitive", kRepeated},
        {"triangles", 12, message, "foxglove.TriangleListPrimitive", kRepeated},
        {"texts", 13, message, "foxglove.TextPrimitive", kRepeated},
        {"models", 14, message, "foxglove.ModelPrimitive", kRepeated}}},
      {"foxglove.SceneEntityDeletion",
       {{"timestamp", 1, message, kTime}, {"type", 2, enumeration, "Type"}, {"id", 3, text}},
       {{"Type", {"MATCHING_ID", "ALL"}}}},
      {"foxglove.SceneUpdate",
       {{"deletions", 1, message, "foxglove.SceneEntityDeletion", kRepeated},
        {"entities", 2, message, "foxglove.SceneEntity", kRepeated}}},
  };
}

/// Cairn's own schemas.
std::vector<ProtoSchema> frame_reports() {
  using enum ProtoType;
  return {
      {"cairn.Stage", {{"name", 1, text}, {"ms", 2, float64}}},
      {"cairn.Frame",
       {{"timestamp", 1, message, kTime},
        {"index", 2, int32},
        {"state", 3, enumeration, "State"},
        {"reason", 4, text},
        {"inlier_share", 5, float64},
        {"overlap", 6, float64},
        {"rmse", 7, float64},
        {"photometric_rmse", 8, float64},
        {"iterations", 9, int32},
        {"degenerate_directions", 10, int32},
        {"moving", 11, float64},
        {"touched_bricks", 12, int32},
        {"new_bricks", 13, int32},
        {"ms", 14, float64},
        {"stages", 15, message, "cairn.Stage", kRepeated}},
       {{"State", {"FUSED", "LOST", "SKIPPED", "HELD_OUT"}}}},
  };
}

const std::vector<ProtoSchema>& schemas() {
  static const std::vector<ProtoSchema> all = [] {
    std::vector<ProtoSchema> joined;
    for (auto group : {times_and_descriptors(), frames_and_poses(), sensors_and_texts(), scene_primitives(), scenes(),
                       frame_reports()})
      joined.insert(joined.end(), group.begin(), group.end());
    return joined;
  }();
  return all;
}

}  // namespace

const ProtoSchema& schema_of(std::string_view name) {
  const auto& all = schemas();
  const auto it = std::find_if(all.begin(), all.end(), [&](const ProtoSchema& s) { return s.name == name; });
  if (it == all.end()) throw std::logic_error(fmt::format("there is no schema {}", name));
  return *it;
}

}  // namespace cairn
