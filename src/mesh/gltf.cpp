// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// glTF 2.0 through tinygltf. glTF is y-up and right-handed; the world is y-down: a half turn about x leads from one to
// the other, so that z forward becomes -z, as glTF's own cameras look.
#include <tiny_gltf.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>

#include "io/atomic_file.hpp"
#include "mesh/formats.hpp"

namespace cairn {
namespace {

Eigen::Vector3f turned(const Eigen::Vector3f& v) { return {v.x(), -v.y(), -v.z()}; }

/// glTF's vertex colours are linear, ours sRGB (IEC 61966-2-1).
std::uint16_t linear(std::uint8_t srgb) {
  const double c = srgb / 255.0;
  return static_cast<std::uint16_t>(
      std::lround(65535.0 * (c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4))));
}
std::uint8_t srgb(double value) {
  const double c = std::clamp(value, 0.0, 1.0);
  return static_cast<std::uint8_t>(
      std::lround(255.0 * (c <= 0.0031308 ? 12.92 * c : 1.055 * std::pow(c, 1 / 2.4) - 0.055)));
}

/// Appends to the model's one buffer; returns the accessor.
template <class T>
int add_accessor(tinygltf::Model& model, const std::vector<T>& data, int component, int type, std::size_t count,
                 int target, bool normalized = false) {
  auto& bytes = model.buffers[0].data;
  tinygltf::BufferView view;
  view.buffer = 0;
  view.byteOffset = bytes.size();
  view.byteLength = data.size() * sizeof(T);
  view.target = target;
  bytes.resize(bytes.size() + view.byteLength);
  std::memcpy(bytes.data() + view.byteOffset, data.data(), view.byteLength);
  bytes.resize((bytes.size() + 3) & ~std::size_t{3});
  model.bufferViews.push_back(view);
  tinygltf::Accessor accessor;
  accessor.bufferView = static_cast<int>(model.bufferViews.size()) - 1;
  accessor.componentType = component;
  accessor.type = type;
  accessor.count = count;
  accessor.normalized = normalized;
  model.accessors.push_back(accessor);
  return static_cast<int>(model.accessors.size()) - 1;
}

std::vector<float> flat(const std::vector<Eigen::Vector3f>& vectors) {
  std::vector<float> values;
  values.reserve(3 * vectors.size());
  for (const auto& v : vectors)
    for (const float f : turned(v)) values.push_back(f);
  return values;
}

tinygltf::Model to_model(const Mesh& mesh) {
  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = "cairn";
  tinygltf::Value::Object extras;
  extras["up_axis"] = tinygltf::Value(std::string("y"));
  extras["unit"] = tinygltf::Value(std::string("metre"));
  extras["gltf_from_world"] = tinygltf::Value(std::string("half turn about x: (x, -y, -z)"));
  model.asset.extras = tinygltf::Value(extras);
  tinygltf::Scene scene;
  scene.name = "map";
  model.defaultScene = 0;
  if (mesh.triangles.empty()) {  // glTF has no empty meshes
    model.scenes.push_back(scene);
    return model;
  }

  model.buffers.emplace_back();
  tinygltf::Primitive primitive;
  primitive.mode = TINYGLTF_MODE_TRIANGLES;
  primitive.material = 0;
  primitive.attributes["POSITION"] =
      add_accessor(model, flat(mesh.positions), TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC3,
                   mesh.positions.size(), TINYGLTF_TARGET_ARRAY_BUFFER);
  Eigen::Vector3f low = Eigen::Vector3f::Constant(std::numeric_limits<float>::max()), high = -low;
  for (const auto& p : mesh.positions) low = low.cwiseMin(turned(p)), high = high.cwiseMax(turned(p));
  model.accessors.back().minValues = {low.x(), low.y(), low.z()};
  model.accessors.back().maxValues = {high.x(), high.y(), high.z()};
  if (!mesh.normals.empty())
    primitive.attributes["NORMAL"] =
        add_accessor(model, flat(mesh.normals), TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC3, mesh.normals.size(),
                     TINYGLTF_TARGET_ARRAY_BUFFER);
  if (!mesh.colours.empty()) {
    std::array<std::uint16_t, 256> table{};
    for (std::size_t i = 0; i < table.size(); ++i) table[i] = linear(static_cast<std::uint8_t>(i));
    std::vector<std::uint16_t> colours;
    colours.reserve(4 * mesh.colours.size());
    for (const auto& c : mesh.colours) colours.insert(colours.end(), {table[c[0]], table[c[1]], table[c[2]], 65535});
    primitive.attributes["COLOR_0"] =
        add_accessor(model, colours, TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, TINYGLTF_TYPE_VEC4, mesh.colours.size(),
                     TINYGLTF_TARGET_ARRAY_BUFFER, true);
  }
  std::vector<std::uint32_t> indices;
  indices.reserve(3 * mesh.triangles.size());
  for (const auto& t : mesh.triangles) indices.insert(indices.end(), t.begin(), t.end());
  primitive.indices = add_accessor(model, indices, TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, TINYGLTF_TYPE_SCALAR,
                                   indices.size(), TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);

  tinygltf::Material material;
  material.name = "surface";
  material.pbrMetallicRoughness.metallicFactor = 0.0;
  material.pbrMetallicRoughness.roughnessFactor = 1.0;
  material.doubleSided = true;
  model.materials.push_back(material);
  tinygltf::Mesh gltf_mesh;
  gltf_mesh.name = "surface";
  gltf_mesh.primitives.push_back(primitive);
  model.meshes.push_back(gltf_mesh);
  tinygltf::Node node;
  node.name = "map";
  node.mesh = 0;
  model.nodes.push_back(node);
  scene.nodes.push_back(0);
  model.scenes.push_back(scene);
  return model;
}

/// Calls `take(index, components)` for each element of an accessor, as numbers; normalized integers become 0..1.
template <class Take>
void read_accessor(const tinygltf::Model& model, int index, const Take& take) {
  const auto& accessor = model.accessors.at(static_cast<std::size_t>(index));
  if (accessor.bufferView < 0 || accessor.sparse.isSparse) throw std::runtime_error("sparse accessors are not read");
  const auto& view = model.bufferViews.at(static_cast<std::size_t>(accessor.bufferView));
  const auto& bytes = model.buffers.at(static_cast<std::size_t>(view.buffer)).data;
  const int components = tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(accessor.type));
  const int size = tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(accessor.componentType));
  const auto stride = static_cast<std::size_t>(accessor.ByteStride(view));
  const std::size_t start = view.byteOffset + accessor.byteOffset;
  if (components > 4 || size < 0 ||
      (accessor.count > 0 &&
       start + stride * (accessor.count - 1) + static_cast<std::size_t>(components * size) > bytes.size()))
    throw std::runtime_error("an accessor reaches beyond its buffer");
  for (std::size_t i = 0; i < accessor.count; ++i) {
    std::array<double, 4> v{};
    for (int c = 0; c < components; ++c) {
      const unsigned char* at = bytes.data() + start + i * stride + static_cast<std::size_t>(c * size);
      const auto as = [&]<class T>(T value) {
        std::memcpy(&value, at, sizeof(T));
        const double scale = accessor.normalized ? static_cast<double>(std::numeric_limits<T>::max()) : 1.0;
        return static_cast<double>(value) / scale;
      };
      double& out = v[static_cast<std::size_t>(c)];
      switch (accessor.componentType) {
        case TINYGLTF_COMPONENT_TYPE_FLOAT: {
          float f;
          std::memcpy(&f, at, 4);
          out = f;
          break;
        }
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
          out = as(std::uint8_t{});
          break;
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
          out = as(std::uint16_t{});
          break;
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
          out = as(std::uint32_t{});
          break;
        default:
          throw std::runtime_error("an accessor has a component type that is not read");
      }
    }
    take(i, v);
  }
}

Eigen::Affine3d local_transform(const tinygltf::Node& node) {
  Eigen::Affine3d t = Eigen::Affine3d::Identity();
  if (node.matrix.size() == 16) t.matrix() = Eigen::Map<const Eigen::Matrix4d>(node.matrix.data());
  if (node.translation.size() == 3) t.translate(Eigen::Map<const Eigen::Vector3d>(node.translation.data()));
  if (node.rotation.size() == 4)
    t.rotate(Eigen::Quaterniond(node.rotation[3], node.rotation[0], node.rotation[1], node.rotation[2]));
  if (node.scale.size() == 3) t.scale(Eigen::Map<const Eigen::Vector3d>(node.scale.data()));
  return t;
}

void append(const tinygltf::Model& model, int node_index, const Eigen::Affine3d& parent, Mesh& mesh, int depth) {
  if (depth > 64) throw std::runtime_error("its nodes are nested too deeply");
  const auto& node = model.nodes.at(static_cast<std::size_t>(node_index));
  const Eigen::Affine3d transform = parent * local_transform(node);
  const Eigen::Matrix3d normal_transform = transform.linear().inverse().transpose();
  if (node.mesh >= 0) {
    for (const auto& primitive : model.meshes.at(static_cast<std::size_t>(node.mesh)).primitives) {
      const auto position = primitive.attributes.find("POSITION");
      if (primitive.mode != TINYGLTF_MODE_TRIANGLES || position == primitive.attributes.end()) continue;
      const std::size_t first = mesh.positions.size();
      read_accessor(model, position->second, [&](std::size_t, const auto& v) {
        mesh.positions.push_back(turned((transform * Eigen::Vector3d(v[0], v[1], v[2])).template cast<float>()));
      });
      const std::size_t count = mesh.positions.size() - first;
      if (const auto it = primitive.attributes.find("NORMAL"); it != primitive.attributes.end())
        read_accessor(model, it->second, [&](std::size_t, const auto& v) {
          mesh.normals.push_back(
              turned((normal_transform * Eigen::Vector3d(v[0], v[1], v[2])).normalized().template cast<float>()));
        });
      if (const auto it = primitive.attributes.find("COLOR_0"); it != primitive.attributes.end())
        read_accessor(model, it->second, [&](std::size_t, const auto& v) {
          mesh.colours.push_back({srgb(v[0]), srgb(v[1]), srgb(v[2]), 255});
        });
      std::vector<std::uint32_t> indices;
      if (primitive.indices >= 0)
        read_accessor(model, primitive.indices,
                      [&](std::size_t, const auto& v) { indices.push_back(static_cast<std::uint32_t>(v[0])); });
      else
        for (std::size_t i = 0; i < count; ++i) indices.push_back(static_cast<std::uint32_t>(i));
      for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
        std::array<std::uint32_t, 3> t{};
        for (std::size_t k = 0; k < 3; ++k) {
          if (indices[i + k] >= count) throw std::runtime_error("an index reaches beyond the vertices");
          t[k] = indices[i + k] + static_cast<std::uint32_t>(first);
        }
        mesh.triangles.push_back(t);
      }
    }
  }
  for (const int child : node.children) append(model, child, transform, mesh, depth + 1);
}

}  // namespace

void write_gltf(const std::filesystem::path& file, const Mesh& mesh) {
  tinygltf::Model model = to_model(mesh);
  const bool binary = file.extension() == ".glb";
  if (!binary && !model.buffers.empty()) {
    // The .bin first: a .gltf that can be seen is complete.
    std::filesystem::path bin = file;
    bin.replace_extension(".bin");
    write_whole(bin, model.buffers[0].data);
    model.buffers[0].uri = bin.filename().string();
  }
  write_whole(file, [&](const std::filesystem::path& temporary) {
    tinygltf::TinyGLTF writer;
    std::ofstream out(temporary, std::ios::binary);
    if (binary) {
      if (!writer.WriteGltfSceneToStream(&model, out, false, true)) throw std::runtime_error("tinygltf failed");
    } else {
      // tinygltf would write the buffer a second time, as text or under the temporary name: the JSON gets the .bin's
      // name.
      std::ostringstream json;
      writer.WriteGltfSceneToStream(&model, json, true, false);
      nlohmann::json j = nlohmann::json::parse(json.str());
      if (!model.buffers.empty())
        j["buffers"][0] = {{"byteLength", model.buffers[0].data.size()}, {"uri", model.buffers[0].uri}};
      out << j.dump(1) << '\n';
    }
    if (!out.flush()) throw std::runtime_error("the disk is full");
  });
}

Mesh read_gltf(const std::filesystem::path& file) {
  tinygltf::Model model;
  tinygltf::TinyGLTF loader;
  std::string error, warning;
  const bool loaded = file.extension() == ".glb" ? loader.LoadBinaryFromFile(&model, &error, &warning, file.string())
                                                 : loader.LoadASCIIFromFile(&model, &error, &warning, file.string());
  if (!loaded)
    throw std::runtime_error(file.string() + ": cannot be read as glTF: " + error.substr(0, error.find('\n')));
  Mesh mesh;
  try {
    const std::size_t scene = model.defaultScene < 0 ? 0 : static_cast<std::size_t>(model.defaultScene);
    if (scene < model.scenes.size())
      for (const int node : model.scenes[scene].nodes) append(model, node, Eigen::Affine3d::Identity(), mesh, 0);
  } catch (const std::exception& problem) {
    throw std::runtime_error(file.string() + ": " + problem.what());
  }
  // Parts with and without an attribute cannot be told apart in one mesh.
  if (mesh.normals.size() != mesh.positions.size()) mesh.normals.clear();
  if (mesh.colours.size() != mesh.positions.size()) mesh.colours.clear();
  return mesh;
}

}  // namespace cairn
