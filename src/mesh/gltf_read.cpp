// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <tiny_gltf.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>
#include <span>
#include <stdexcept>

#include "base/checked_count.hpp"
#include "base/file_name.hpp"
#include "base/image_file.hpp"
#include "base/read_whole.hpp"
#include "base/words.hpp"
#include "geometry/axes.hpp"
#include "mesh/formats.hpp"
#include "mesh/gltf.hpp"

namespace cairn {
namespace {

Eigen::Vector3f turned(const Eigen::Vector3f& v) { return to_world(v, Axes::y_up); }

std::uint8_t srgb(double value) {  // IEC 61966-2-1
  const double c = std::clamp(value, 0.0, 1.0);
  return static_cast<std::uint8_t>(
      std::lround(255.0 * (c <= 0.0031308 ? 12.92 * c : 1.055 * std::pow(c, 1 / 2.4) - 0.055)));
}

template <class T>
const T& item(const std::vector<T>& list, int index, const char* what) {
  if (index < 0 || static_cast<std::size_t>(index) >= list.size())
    throw std::runtime_error("there is no " + std::string(what) + " " + std::to_string(index));
  return list[static_cast<std::size_t>(index)];
}

/// Limit on the bytes read from a file: its nodes and meshes may refer to the same bytes any number of times.
class Budget {
 public:
  explicit Budget(const tinygltf::Model& model) {
    for (const auto& buffer : model.buffers) left_ += product(kMaxExpansion, buffer.data.size());
    for (const auto& image : model.images) left_ += product(kMaxExpansion, image.image.size());
  }
  void take(std::uint64_t count, std::uint64_t bytes_each) {
    const std::uint64_t bytes = product(count, bytes_each);
    if (bytes > left_)
      throw std::runtime_error(
          "it repeats the same vertices or textures too often: its contents are far larger than the file");
    left_ -= bytes;
  }

 private:
  static constexpr std::uint64_t kMaxExpansion = 64;
  std::uint64_t left_ = 256u << 20;  // base allowance of every file
};

/// Bytes of a buffer view.
std::span<const std::uint8_t> bytes_of(const tinygltf::Model& model, const tinygltf::BufferView& view) {
  const auto& bytes = item(model.buffers, view.buffer, "buffer").data;
  if (view.byteOffset > bytes.size() || view.byteLength > bytes.size() - view.byteOffset)
    throw std::runtime_error("a view reaches beyond its buffer");
  return std::span(bytes).subspan(view.byteOffset, view.byteLength);
}

/// Calls `take(components)` for each element of an accessor, as numbers; normalized integers become 0..1.
template <class Take>
void read_accessor(const tinygltf::Model& model, int index, Budget& budget, const Take& take) {
  const auto& accessor = item(model.accessors, index, "accessor");
  if (accessor.bufferView < 0 || accessor.sparse.isSparse)
    throw std::runtime_error("sparse accessors are not supported");
  const auto& view = item(model.bufferViews, accessor.bufferView, "view");
  const auto bytes = bytes_of(model, view);
  const int components = tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(accessor.type));
  const int size = tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(accessor.componentType));
  const int byte_stride = accessor.ByteStride(view);
  if (components < 1 || components > 4 || size < 1 || byte_stride < 1)
    throw std::runtime_error("an accessor has an unsupported type or stride");
  const auto stride = static_cast<std::size_t>(byte_stride), start = accessor.byteOffset,
             element = static_cast<std::size_t>(components * size);
  // Avoids products and sums of untrusted values, which may overflow.
  if (accessor.count > 0 && (start > bytes.size() || element > bytes.size() - start ||
                             accessor.count - 1 > (bytes.size() - start - element) / stride))
    throw std::runtime_error("an accessor reaches beyond its buffer");
  budget.take(accessor.count, 4 * count_of(components));
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
        case TINYGLTF_COMPONENT_TYPE_BYTE:
          out = as(std::int8_t{});
          break;
        case TINYGLTF_COMPONENT_TYPE_SHORT:
          out = as(std::int16_t{});
          break;
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
          throw std::runtime_error("an accessor has an unsupported component type");
      }
    }
    take(v);
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

Texture texture_of(const tinygltf::Model& model, const tinygltf::Primitive& primitive, Budget& budget) {
  Texture texture;
  if (primitive.material < 0) return texture;
  const int index = item(model.materials, primitive.material, "material").pbrMetallicRoughness.baseColorTexture.index;
  if (index < 0) return texture;
  const int source = item(model.textures, index, "texture").source;
  if (source < 0) return texture;
  const tinygltf::Image& image = item(model.images, source, "image");
  const cv::Mat pixels =
      decode_image(image.bufferView < 0 ? std::span<const std::uint8_t>(image.image)
                                        : bytes_of(model, item(model.bufferViews, image.bufferView, "view")),
                   Pixels::rgb, {.max_side = kMaxTextureSide});
  budget.take(pixels.total(), 3);
  texture.width = pixels.cols;
  texture.height = pixels.rows;
  texture.texels.reserve(pixels.total());
  for (int y = 0; y < pixels.rows; ++y)
    for (int x = 0; x < pixels.cols; ++x) {
      const auto& rgb = pixels.at<cv::Vec3b>(y, x);
      texture.texels.push_back({rgb[0], rgb[1], rgb[2]});
    }
  return texture;
}

/// Image callback of tinygltf. Images in buffer views are read later with bytes_of, since tinygltf does not check their
/// bounds.
bool keep_image(tinygltf::Image* image, int, std::string*, std::string*, int, int, const unsigned char* bytes, int size,
                void*) {
  if (image->bufferView < 0) image->image.assign(bytes, bytes + size);
  return true;
}

/// File callbacks of tinygltf, for the external files of a .gltf.
tinygltf::FsCallbacks files() {
  return {.FileExists = [](const std::string& file,
                           void*) { return std::filesystem::is_regular_file(std::filesystem::path(file)); },
          .ExpandFilePath = [](const std::string& file, void*) { return file; },
          .ReadWholeFile =
              [](std::vector<unsigned char>* bytes, std::string* error, const std::string& file, void*) {
                try {
                  *bytes = read_whole(file, kAnySize);
                  return true;
                } catch (const std::exception& problem) {
                  *error += file + ": " + problem.what() + "\n";
                  return false;
                }
              },
          .WriteWholeFile = nullptr,
          .user_data = nullptr};
}

Mesh part_of(const tinygltf::Model& model, const tinygltf::Primitive& primitive, const Eigen::Affine3d& transform,
             Budget& budget) {
  Mesh mesh;
  const Eigen::Matrix3d normal_transform = transform.linear().inverse().transpose();
  const auto each = [&](const char* name, const auto& take) {
    if (const auto it = primitive.attributes.find(name); it != primitive.attributes.end())
      read_accessor(model, it->second, budget, take);
  };
  each("POSITION", [&](const auto& v) {
    mesh.positions.push_back(turned((transform * Eigen::Vector3d(v[0], v[1], v[2])).template cast<float>()));
  });
  each("NORMAL", [&](const auto& v) {
    mesh.normals.push_back(
        turned((normal_transform * Eigen::Vector3d(v[0], v[1], v[2])).normalized().template cast<float>()));
  });
  each("COLOR_0", [&](const auto& v) { mesh.colors.push_back({srgb(v[0]), srgb(v[1]), srgb(v[2]), 255}); });
  each("TEXCOORD_0", [&](const auto& v) {
    mesh.texture_coordinates.emplace_back(static_cast<float>(v[0]), static_cast<float>(v[1]));
  });
  each(kSigma, [&](const auto& v) { mesh.sigmas.push_back(static_cast<float>(v[0])); });
  const std::size_t count = mesh.positions.size();
  if ((!mesh.normals.empty() && mesh.normals.size() != count) ||
      (!mesh.colors.empty() && mesh.colors.size() != count) ||
      (!mesh.texture_coordinates.empty() && mesh.texture_coordinates.size() != count) ||
      (!mesh.sigmas.empty() && mesh.sigmas.size() != count))
    throw std::runtime_error("the attributes of a mesh have different sizes");
  if (!mesh.texture_coordinates.empty()) mesh.texture = texture_of(model, primitive, budget);
  std::vector<std::uint32_t> indices;
  if (primitive.indices >= 0)
    read_accessor(model, primitive.indices, budget, [&](const auto& v) {
      if (!(v[0] >= 0 && v[0] < static_cast<double>(count)))
        throw std::runtime_error("an index reaches beyond the vertices");
      indices.push_back(static_cast<std::uint32_t>(v[0]));
    });
  else
    for (std::size_t i = 0; i < count; ++i) indices.push_back(static_cast<std::uint32_t>(i));
  for (std::size_t i = 0; i + 2 < indices.size(); i += 3)
    mesh.triangles.push_back({indices[i], indices[i + 1], indices[i + 2]});
  return mesh;
}

/// `visited` holds the visited nodes: a second visit is an error, since cycles would not terminate.
void append(const tinygltf::Model& model, int index, const Eigen::Affine3d& parent, std::vector<Mesh>& parts,
            std::set<int>& visited, Budget& budget, int depth) {
  const auto& node = item(model.nodes, index, "node");
  if (depth > 64) throw std::runtime_error("its nodes are nested too deeply");
  if (!visited.insert(index).second) throw std::runtime_error("node " + std::to_string(index) + " appears twice");
  const Eigen::Affine3d transform = parent * local_transform(node);
  if (node.mesh >= 0)
    for (const auto& primitive : item(model.meshes, node.mesh, "mesh").primitives)
      if (primitive.mode == TINYGLTF_MODE_TRIANGLES && primitive.attributes.contains("POSITION"))
        parts.push_back(part_of(model, primitive, transform, budget));
  for (const int child : node.children) append(model, child, transform, parts, visited, budget, depth + 1);
}

}  // namespace

std::vector<Mesh> read_gltf_parts(const std::filesystem::path& file) {
  tinygltf::Model model;
  tinygltf::TinyGLTF loader;
  loader.SetFsCallbacks(files());
  loader.SetImageLoader(keep_image, nullptr);
  std::string error, warning;
  const std::vector<std::uint8_t> plain = decompressed_gltf(file);
  const bool loaded =
      !plain.empty()                 ? loader.LoadBinaryFromMemory(&model, &error, &warning, plain.data(),
                                                                   static_cast<unsigned>(plain.size()), file.parent_path().string())
      : extension_of(file) == ".glb" ? loader.LoadBinaryFromFile(&model, &error, &warning, file.string())
                                     : loader.LoadASCIIFromFile(&model, &error, &warning, file.string());
  if (!loaded)
    throw std::runtime_error(file.string() + ": cannot be read as glTF: " + shown(error.substr(0, error.find('\n'))));
  std::vector<Mesh> parts;
  try {
    const std::size_t scene = model.defaultScene < 0 ? 0 : static_cast<std::size_t>(model.defaultScene);
    std::set<int> visited;
    Budget budget(model);
    if (scene < model.scenes.size())
      for (const int node : model.scenes[scene].nodes)
        append(model, node, Eigen::Affine3d::Identity(), parts, visited, budget, 0);
  } catch (const std::exception& problem) {
    throw std::runtime_error(file.string() + ": " + problem.what());
  }
  // The file's extras may declare axes other than glTF's.
  const tinygltf::Value& extras = model.asset.extras;
  if (extras.IsObject() && extras.Has("axes") && extras.Get("axes").IsString())
    for (const Axes axes : {Axes::world, Axes::z_up})
      if (extras.Get("axes").Get<std::string>() == to_string(axes))
        for (Mesh& part : parts) {
          turn_from_world(part, Axes::y_up);
          turn_to_world(part, axes);
        }
  return parts;
}

}  // namespace cairn
