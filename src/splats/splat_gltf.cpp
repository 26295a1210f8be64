// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// glTF 2.0 in a .glb file, with KHR_gaussian_splatting (Khronos, ratified): a primitive of points with the splats'
// parameters as attributes, linear scales and opacities, and COLOR_0 for viewers without the extension.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "base/json_text.hpp"
#include "splats/formats.hpp"

namespace cairn {
namespace {

using Json = nlohmann::json;

constexpr std::uint32_t kMagic = 0x46546c67, kVersion = 2, kJsonChunk = 0x4e4f534a, kBinaryChunk = 0x004e4942;
constexpr int kFloat = 5126, kUnsignedShort = 5123, kArrayBuffer = 34962, kPoints = 0;  // of glTF
constexpr std::size_t kMaxFile = 0xffffffff;                                            // bytes, of the container
constexpr double kHarmonic0 = 0.28209479177387814;
const std::string kExtension = "KHR_gaussian_splatting";

float opacity_of(float logit) { return 1 / (1 + std::exp(-logit)); }

/// Linear value of an sRGB color, of 65535 (IEC 61966-2-1).
std::uint16_t linear(float srgb) {
  const double c = std::clamp(static_cast<double>(srgb), 0.0, 1.0);
  return static_cast<std::uint16_t>(
      std::lround(65535 * (c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4))));
}

/// Buffer and accessors of a primitive.
struct Primitive {
  std::string bytes;
  Json views = Json::array(), accessors = Json::array(), attributes = Json::object();

  /// Adds an attribute: `put(i)` appends the element of splat i.
  template <class Put>
  void add(const std::string& name, const char* type, std::size_t count, const Put& put, int component = kFloat) {
    const std::size_t start = bytes.size();
    for (std::size_t i = 0; i < count; ++i) put(i);
    views.push_back(
        {{"buffer", 0}, {"byteOffset", start}, {"byteLength", bytes.size() - start}, {"target", kArrayBuffer}});
    Json accessor{{"bufferView", views.size() - 1}, {"componentType", component}, {"count", count}, {"type", type}};
    if (component != kFloat) accessor["normalized"] = true;
    attributes[name] = accessors.size();
    accessors.push_back(std::move(accessor));
  }
  template <class Value>
  void append(const Value& value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof(Value));
  }
  void append(const Eigen::Vector3f& v) { bytes.append(reinterpret_cast<const char*>(v.data()), sizeof(float) * 3); }
  void append(const Eigen::Vector4f& v) { bytes.append(reinterpret_cast<const char*>(v.data()), sizeof(float) * 4); }
};

Eigen::Vector3f y_up(const Eigen::Vector3f& v) { return {v.x(), -v.y(), -v.z()}; }

void add_positions(Primitive& p, const Splats& splats) {
  Eigen::AlignedBox3f box;
  p.add("POSITION", "VEC3", splats.size(), [&](std::size_t i) {
    const Eigen::Vector3f position = y_up(splats.positions[i]);
    box.extend(position);
    p.append(position);
  });
  const auto list = [](const Eigen::Vector3f& v) { return Json::array({v.x(), v.y(), v.z()}); };
  p.accessors.back()["min"] = list(box.min());
  p.accessors.back()["max"] = list(box.max());
}

void add_harmonics(Primitive& p, const Splats& splats) {
  const std::size_t harmonics = harmonics_per_splat(splats.degree);
  std::size_t k = 0;
  for (int degree = 1; degree <= splats.degree; ++degree)
    for (int n = 0; n <= 2 * degree; ++n, ++k)
      p.add(kExtension + ":SH_DEGREE_" + std::to_string(degree) + "_COEF_" + std::to_string(n), "VEC3", splats.size(),
            [&](std::size_t i) {
              p.append(Eigen::Vector3f(kYUpHarmonicSigns[k] * splats.harmonics[i * harmonics + k]));
            });
}

Primitive primitive_of(const Splats& splats) {
  Primitive p;
  const std::size_t count = splats.size();
  add_positions(p, splats);
  p.add(kExtension + ":ROTATION", "VEC4", count, [&](std::size_t i) { p.append(y_up_rotation(splats.rotations[i])); });
  p.add(kExtension + ":SCALE", "VEC3", count,
        [&](std::size_t i) { p.append(Eigen::Vector3f(splats.log_scales[i].array().exp())); });
  p.add(kExtension + ":OPACITY", "SCALAR", count, [&](std::size_t i) { p.append(opacity_of(splats.opacities[i])); });
  p.add(kExtension + ":SH_DEGREE_0_COEF_0", "VEC3", count, [&](std::size_t i) { p.append(splats.colors[i]); });
  add_harmonics(p, splats);
  const auto put_color = [&](std::size_t i) {
    for (const float value : splats.colors[i]) p.append(linear(0.5f + static_cast<float>(kHarmonic0) * value));
    p.append(static_cast<std::uint16_t>(std::lround(65535 * opacity_of(splats.opacities[i]))));
  };
  p.add("COLOR_0", "VEC4", count, put_color, kUnsignedShort);
  return p;
}

void append_word(std::string& bytes, std::size_t value) {
  for (int k = 0; k < 4; ++k) bytes.push_back(static_cast<char>(value >> (8 * k) & 255));
}

}  // namespace

std::string splat_glb_of(const Splats& splats) {
  Primitive p = primitive_of(splats);
  const Json extension{{"kernel", "ellipse"}, {"colorSpace", "srgb_rec709_display"}};
  const Json primitive{{"attributes", p.attributes}, {"mode", kPoints}, {"extensions", {{kExtension, extension}}}};
  const Json gltf{{"asset", {{"version", "2.0"}, {"generator", "cairn"}}},
                  {"extensionsUsed", Json::array({kExtension})},
                  {"scene", 0},
                  {"scenes", Json::array({{{"nodes", Json::array({0})}}})},
                  {"nodes", Json::array({{{"name", "splats"}, {"mesh", 0}}})},
                  {"meshes", Json::array({{{"primitives", Json::array({primitive})}}})},
                  {"accessors", p.accessors},
                  {"bufferViews", p.views},
                  {"buffers", Json::array({{{"byteLength", p.bytes.size()}}})}};
  std::string json = text_of(gltf);
  json.resize((json.size() + 3) / 4 * 4, ' ');
  constexpr std::size_t kHeader = 12, kChunkHeader = 8;
  const std::size_t size = kHeader + 2 * kChunkHeader + json.size() + p.bytes.size();
  if (size > kMaxFile) throw std::runtime_error("the splats exceed the 4 GiB of a .glb file: use .spz");
  std::string file;
  file.reserve(size);
  for (const std::size_t word : {std::size_t{kMagic}, std::size_t{kVersion}, size}) append_word(file, word);
  append_word(file, json.size());
  append_word(file, kJsonChunk);
  file += json;
  append_word(file, p.bytes.size());
  append_word(file, kBinaryChunk);
  return file += p.bytes;
}

}  // namespace cairn
