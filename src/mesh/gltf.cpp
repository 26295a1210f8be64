// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// glTF 2.0 through tinygltf. glTF is y-up and right-handed; the world is y-down. A half turn about x converts between
// the two: z forward becomes -z, the viewing direction of glTF cameras.
#include "mesh/gltf.hpp"

#include <draco/compression/encode.h>
#include <draco/mesh/mesh.h>
#include <meshoptimizer.h>
#include <tiny_gltf.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "base/atomic_file.hpp"
#include "base/file_name.hpp"
#include "base/json_text.hpp"
#include "base/read_json.hpp"
#include "base/spool.hpp"
#include "geometry/axes.hpp"
#include "mesh/clean.hpp"
#include "mesh/formats.hpp"
#include "mesh/topology.hpp"

namespace cairn {
namespace {

using Bytes = std::vector<std::uint8_t>;
constexpr int kGridSteps = 65535;  // steps of a quantized position along the longest side
constexpr int kDracoPositionBits = 16, kDracoNormalBits = 10, kDracoTexCoordBits = 14, kDracoColorBits = 12;
constexpr std::array kUnlit{"KHR_materials_unlit"};

Eigen::Vector3f turned(const Eigen::Vector3f& v) { return from_world(v, Axes::y_up); }

/// Prepares a mesh for a writer that rotates it to y up, to obtain other axes.
Mesh before_y_up(Mesh mesh, Axes axes) {
  turn_from_world(mesh, axes);
  turn_to_world(mesh, Axes::y_up);
  return mesh;
}

/// glTF's vertex colors are linear, Cairn's are sRGB (IEC 61966-2-1).
std::uint16_t linear(std::uint8_t srgb) {
  const double c = srgb / 255.0;
  return static_cast<std::uint16_t>(
      std::lround(65535.0 * (c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4))));
}

/// An attribute or the indices in buffer format.
struct Stream {
  Bytes bytes;
  std::size_t count = 0, stride = 0;  // elements; bytes
  int component = 0, type = 0;
  bool normalized = false;
};

template <class T>
Stream stream_of(const std::vector<T>& values, std::size_t per_element, std::size_t padded, int component, int type,
                 bool normalized) {
  Stream s{.count = values.size() / per_element,
           .stride = padded * sizeof(T),
           .component = component,
           .type = type,
           .normalized = normalized};
  s.bytes.resize(s.count * s.stride, 0);
  for (std::size_t i = 0; i < s.count; ++i)
    std::memcpy(&s.bytes[i * s.stride], &values[i * per_element], per_element * sizeof(T));
  return s;
}

Stream floats(const std::vector<float>& values, int type) {
  const auto n = static_cast<std::size_t>(tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(type)));
  return stream_of(values, n, n, TINYGLTF_COMPONENT_TYPE_FLOAT, type, false);
}

std::vector<float> flat(const std::vector<Eigen::Vector3f>& vectors) {
  std::vector<float> values;
  values.reserve(3 * vectors.size());
  for (const auto& v : vectors)
    for (const float f : turned(v)) values.push_back(f);
  return values;
}

Stream colors_of(const Mesh& mesh) {
  std::array<std::uint16_t, 256> table{};
  for (std::size_t i = 0; i < table.size(); ++i) table[i] = linear(static_cast<std::uint8_t>(i));
  std::vector<std::uint16_t> values;
  values.reserve(4 * mesh.colors.size());
  for (const auto& c : mesh.colors) values.insert(values.end(), {table[c[0]], table[c[1]], table[c[2]], 65535});
  return stream_of(values, 4, 4, TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, TINYGLTF_TYPE_VEC4, true);
}

using Attributes = std::vector<std::pair<std::string, Stream>>;

Attributes plain_attributes(const Mesh& mesh) {
  Attributes attributes;
  attributes.emplace_back("POSITION", floats(flat(mesh.positions), TINYGLTF_TYPE_VEC3));
  if (!mesh.normals.empty()) attributes.emplace_back("NORMAL", floats(flat(mesh.normals), TINYGLTF_TYPE_VEC3));
  if (!mesh.texture_coordinates.empty()) {
    std::vector<float> texture_coordinates;
    for (const auto& p : mesh.texture_coordinates)
      texture_coordinates.insert(texture_coordinates.end(), {p.x(), p.y()});
    attributes.emplace_back("TEXCOORD_0", floats(texture_coordinates, TINYGLTF_TYPE_VEC2));
  }
  if (!mesh.colors.empty() && mesh.texture_coordinates.empty()) attributes.emplace_back("COLOR_0", colors_of(mesh));
  if (!mesh.sigmas.empty()) attributes.emplace_back(kSigma, floats(mesh.sigmas, TINYGLTF_TYPE_SCALAR));
  return attributes;
}

Attributes quantized_attributes(const Snapped& snapped) {
  const Mesh& mesh = snapped.mesh;
  Attributes attributes;
  std::vector<std::uint16_t> positions, texture_coordinates;
  for (const auto& p : mesh.positions) {
    const Eigen::Vector3f steps = (turned(p) - snapped.low) / snapped.step;
    for (const float f : steps) positions.push_back(static_cast<std::uint16_t>(std::clamp(std::lround(f), 0l, 65535l)));
  }
  attributes.emplace_back(
      "POSITION", stream_of(positions, 3, 4, TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, TINYGLTF_TYPE_VEC3, false));
  if (!mesh.normals.empty()) {
    std::vector<std::int8_t> normals;
    for (const auto& n : mesh.normals)
      for (const float f : turned(n)) normals.push_back(static_cast<std::int8_t>(std::lround(127 * f)));
    attributes.emplace_back("NORMAL", stream_of(normals, 3, 4, TINYGLTF_COMPONENT_TYPE_BYTE, TINYGLTF_TYPE_VEC3, true));
  }
  for (const auto& p : mesh.texture_coordinates)
    for (const float f : p)
      texture_coordinates.push_back(static_cast<std::uint16_t>(std::clamp(std::lround(65535 * f), 0l, 65535l)));
  if (!texture_coordinates.empty())
    attributes.emplace_back("TEXCOORD_0", stream_of(texture_coordinates, 2, 2, TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT,
                                                    TINYGLTF_TYPE_VEC2, true));
  if (!mesh.colors.empty() && texture_coordinates.empty()) attributes.emplace_back("COLOR_0", colors_of(mesh));
  if (!mesh.sigmas.empty()) attributes.emplace_back(kSigma, floats(mesh.sigmas, TINYGLTF_TYPE_SCALAR));
  return attributes;
}

/// Optimizes the order for vertex caches, which also improves compression.
void reorder(Mesh& mesh) {
  std::vector<std::uint32_t> indices;
  for (const auto& t : mesh.triangles) indices.insert(indices.end(), t.begin(), t.end());
  meshopt_optimizeVertexCache(indices.data(), indices.data(), indices.size(), mesh.positions.size());
  std::vector<std::uint32_t> moved(mesh.positions.size());
  const std::size_t used =
      meshopt_optimizeVertexFetchRemap(moved.data(), indices.data(), indices.size(), mesh.positions.size());
  std::vector<std::uint32_t> order(used);
  for (std::uint32_t v = 0; v < moved.size(); ++v)
    if (moved[v] != kNone) order[moved[v]] = v;
  take_vertices(mesh, order);
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k) mesh.triangles[i][k] = moved[indices[3 * i + k]];
}

Stream indices_of(const Mesh& mesh) {
  std::vector<std::uint32_t> indices;
  indices.reserve(3 * mesh.triangles.size());
  for (const auto& t : mesh.triangles) indices.insert(indices.end(), t.begin(), t.end());
  if (mesh.positions.size() < 65535)
    return stream_of(std::vector<std::uint16_t>(indices.begin(), indices.end()), 1, 1,
                     TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, TINYGLTF_TYPE_SCALAR, false);
  return stream_of(indices, 1, 1, TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, TINYGLTF_TYPE_SCALAR, false);
}

/// Bounding box of POSITION in the units of the accessor.
void set_box(const Mesh& mesh, const Snapped* snapped, tinygltf::Accessor& accessor) {
  Eigen::Vector3f low = Eigen::Vector3f::Constant(std::numeric_limits<float>::max()), high = -low;
  for (const auto& p : mesh.positions) low = low.cwiseMin(turned(p)), high = high.cwiseMax(turned(p));
  if (snapped != nullptr) {
    const auto steps = [&](const Eigen::Vector3f& p) {
      return Eigen::Vector3f(((p - snapped->low) / snapped->step).array().round().matrix());
    };
    low = steps(low), high = steps(high);
  }
  accessor.minValues = {low.x(), low.y(), low.z()};
  accessor.maxValues = {high.x(), high.y(), high.z()};
}

/// Rounds to 8 bits, half a percent: compresses well.
float coarse(float value) {
  return std::bit_cast<float>((std::bit_cast<std::uint32_t>(value) + 0x8000u) & 0xffff0000u);
}

std::vector<double> numbers(const Eigen::Vector3f& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

Snapped snap(const Mesh& mesh, bool is_single_mesh) {
  Snapped snapped{.mesh = mesh};
  if (mesh.positions.empty()) return snapped;
  Eigen::AlignedBox3f box;
  for (const auto& p : mesh.positions) box.extend(turned(p));
  snapped.low = box.min();
  // A power of two: multiples are exact, so equal positions remain equal in all parts.
  const float longest = std::max(box.sizes().maxCoeff(), 1e-3f);
  snapped.step = std::exp2(std::ceil(std::log2(longest / static_cast<float>(kGridSteps - 1))));
  snapped.low = ((snapped.low / snapped.step).array().floor() * snapped.step).matrix();
  for (auto& p : snapped.mesh.positions)
    p = turned((((turned(p) - snapped.low) / snapped.step).array().round() * snapped.step).matrix() + snapped.low);
  ManifoldOptions options;
  if (!is_single_mesh) options.fixed = [](std::uint32_t) { return true; };  // any vertex may be shared with other parts
  (void)make_manifold(snapped.mesh, options);
  (void)drop_unused_vertices(snapped.mesh);
  for (float& sigma : snapped.mesh.sigmas) sigma = coarse(sigma);
  return snapped;
}

/// A buffer as a list of chunks: growth copies no data, and the data may be on disk.
struct ChunkedBuffer {
  std::size_t size = 0;  // bytes, including preceding chunks
  std::shared_ptr<Spool> spool;
  std::vector<std::shared_ptr<const Bytes>> chunks;  // used without a spool
  void add(std::shared_ptr<const Bytes> bytes) {
    size += bytes->size();
    if (spool)
      spool->append({reinterpret_cast<const char*>(bytes->data()), bytes->size()});
    else
      chunks.push_back(std::move(bytes));
  }
  void align() {
    if (size % 4 != 0) add(std::make_shared<const Bytes>(4 - size % 4, 0));
  }
  void put(std::ostream& out) const {
    if (spool) spool->copy_to(out);
    for (const auto& chunk : chunks)
      out.write(reinterpret_cast<const char*>(chunk->data()), static_cast<std::streamsize>(chunk->size()));
  }
};

/// Writes a .glb with its JSON and its buffer, given in two parts.
void put_glb(std::ostream& out, std::string json, const ChunkedBuffer& first, ChunkedBuffer last) {
  while (json.size() % 4 != 0) json += ' ';
  const bool is_empty = last.size == 0;
  last.align();
  const std::size_t total = 12 + 8 + json.size() + (is_empty ? 0 : 8 + last.size);
  if (total > std::numeric_limits<std::uint32_t>::max())
    throw std::runtime_error("a .glb cannot exceed 4 GiB: simplify or compress the mesh, or write a tileset.json");
  const auto put = [&](std::size_t word) {
    for (int i = 0; i < 4; ++i) out.put(static_cast<char>(word >> (8 * i)));
  };
  put(0x46546c67), put(2), put(total);
  put(json.size()), put(0x4e4f534a);
  out << json;
  if (is_empty) return;
  put(last.size), put(0x004e4942);
  first.put(out);
  last.put(out);
}

Bytes bytes_of(const std::ostringstream& out) {
  const std::string_view text = out.view();
  return {text.begin(), text.end()};
}

struct GltfWriter::State {
  GltfOptions options;
  tinygltf::Model model;
  ChunkedBuffer buffer;
  std::size_t fallback = 0;  // size of the fallback buffer, bytes
  struct Compressed {        // source of a view of the fallback buffer
    std::size_t view, offset, size, count, stride;
    const char* mode;
  };
  std::vector<Compressed> compressed;
  std::vector<std::shared_ptr<const Bytes>> images;

  void use(const char* extension, bool required = false) {
    const auto note = [&](std::vector<std::string>& list) {
      if (std::find(list.begin(), list.end(), extension) == list.end()) list.emplace_back(extension);
    };
    note(model.extensionsUsed);
    if (required) note(model.extensionsRequired);
  }

  /// Appends to the buffer; returns the index of the view.
  int add_view(std::shared_ptr<const Bytes> bytes) {
    buffer.align();
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = buffer.size;
    view.byteLength = bytes->size();
    buffer.add(std::move(bytes));
    model.bufferViews.push_back(view);
    return static_cast<int>(model.bufferViews.size()) - 1;
  }
  int add_view(Bytes bytes) {
    bytes.shrink_to_fit();
    return add_view(std::make_shared<const Bytes>(std::move(bytes)));
  }

  int add_accessor(const Stream& stream, int view) {
    tinygltf::Accessor accessor;
    accessor.bufferView = view;
    accessor.componentType = stream.component;
    accessor.type = stream.type;
    accessor.count = stream.count;
    accessor.normalized = stream.normalized;
    model.accessors.push_back(accessor);
    return static_cast<int>(model.accessors.size()) - 1;
  }

  int add_stream(Stream stream, bool is_index, bool compress) {
    const std::size_t bytes = stream.bytes.size();
    int number = 0;
    if (compress) {
      Bytes packed;
      if (is_index) {
        meshopt_encodeIndexVersion(1);
        std::vector<std::uint32_t> indices(stream.count);
        for (std::size_t i = 0; i < stream.count; ++i)
          std::memcpy(&indices[i], &stream.bytes[i * stream.stride], stream.stride);
        packed.resize(meshopt_encodeIndexBufferBound(stream.count, stream.count));
        packed.resize(meshopt_encodeIndexBuffer(packed.data(), packed.size(), indices.data(), indices.size()));
      } else {
        meshopt_encodeVertexVersion(0);
        packed.resize(meshopt_encodeVertexBufferBound(stream.count, stream.stride));
        packed.resize(
            meshopt_encodeVertexBuffer(packed.data(), packed.size(), stream.bytes.data(), stream.count, stream.stride));
      }
      number = add_view(std::move(packed));
      tinygltf::BufferView& view = model.bufferViews.back();
      compressed.push_back({.view = static_cast<std::size_t>(number),
                            .offset = view.byteOffset,
                            .size = view.byteLength,
                            .count = stream.count,
                            .stride = stream.stride,
                            .mode = is_index ? "TRIANGLES" : "ATTRIBUTES"});
      view.buffer = 1;
      view.byteOffset = fallback;
      view.byteLength = bytes;
      fallback = (fallback + bytes + 3) & ~std::size_t{3};
    } else {
      number = add_view(std::move(stream.bytes));
    }
    tinygltf::BufferView& view = model.bufferViews.back();
    view.target = is_index ? TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER : TINYGLTF_TARGET_ARRAY_BUFFER;
    if (!is_index) view.byteStride = stream.stride;
    return add_accessor(stream, number);
  }

  int material_of(const Mesh& mesh) {
    tinygltf::Material material;
    material.name = "surface";
    material.pbrMetallicRoughness.metallicFactor = 0.0;
    material.pbrMetallicRoughness.roughnessFactor = 1.0;
    material.doubleSided = true;
    const bool is_textured = !mesh.texture_coordinates.empty();
    if (!options.lit && (is_textured || !mesh.colors.empty())) {  // the colors already include the lighting
      use(kUnlit[0]);
      material.extensions[kUnlit[0]] = tinygltf::Value(tinygltf::Value::Object{});
    }
    if (is_textured) {
      images.push_back(std::make_shared<const Bytes>(encode_image(mesh.texture, options.png, options.jpeg_quality)));
      tinygltf::Image image;
      image.mimeType = options.png ? "image/png" : "image/jpeg";
      image.name = "texture-" + std::to_string(model.images.size());
      if (model.samplers.empty()) {
        tinygltf::Sampler sampler;
        sampler.magFilter = TINYGLTF_TEXTURE_FILTER_LINEAR;
        sampler.minFilter = TINYGLTF_TEXTURE_FILTER_LINEAR_MIPMAP_LINEAR;
        sampler.wrapS = sampler.wrapT = TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE;
        model.samplers.push_back(sampler);
      }
      tinygltf::Texture texture;
      texture.sampler = 0;
      texture.source = static_cast<int>(model.images.size());
      model.images.push_back(image);
      material.pbrMetallicRoughness.baseColorTexture.index = static_cast<int>(model.textures.size());
      model.textures.push_back(texture);
    }
    // All parts without a texture share a material.
    if (!is_textured)
      for (std::size_t i = 0; i < model.materials.size(); ++i)
        if (model.materials[i] == material) return static_cast<int>(i);
    model.materials.push_back(material);
    return static_cast<int>(model.materials.size()) - 1;
  }

  void encode_draco(const Mesh& mesh, tinygltf::Primitive& primitive) {
    draco::Mesh coded;
    coded.set_num_points(static_cast<std::uint32_t>(mesh.positions.size()));
    tinygltf::Value::Object ids;
    for (const auto& [name, stream] : plain_attributes(mesh)) {
      const bool is_short = stream.component == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT;
      draco::GeometryAttribute attribute;
      const auto kind = name == "POSITION"     ? draco::GeometryAttribute::POSITION
                        : name == "NORMAL"     ? draco::GeometryAttribute::NORMAL
                        : name == "TEXCOORD_0" ? draco::GeometryAttribute::TEX_COORD
                        : name == kSigma       ? draco::GeometryAttribute::GENERIC
                                               : draco::GeometryAttribute::COLOR;
      attribute.Init(
          kind, nullptr,
          static_cast<std::int8_t>(tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(stream.type))),
          is_short ? draco::DT_UINT16 : draco::DT_FLOAT32, stream.normalized, static_cast<std::int64_t>(stream.stride),
          0);
      const int id = coded.AddAttribute(attribute, true, static_cast<std::uint32_t>(stream.count));
      for (std::uint32_t i = 0; i < stream.count; ++i)
        coded.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(i), &stream.bytes[i * stream.stride]);
      ids[name] = tinygltf::Value(static_cast<int>(coded.attribute(id)->unique_id()));
      primitive.attributes[name] = add_accessor(stream, -1);
      if (name == "POSITION") set_box(mesh, nullptr, model.accessors.back());
    }
    coded.SetNumFaces(mesh.triangles.size());
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i)
      coded.SetFace(draco::FaceIndex(i),
                    {draco::PointIndex(mesh.triangles[i][0]), draco::PointIndex(mesh.triangles[i][1]),
                     draco::PointIndex(mesh.triangles[i][2])});
    draco::Encoder encoder;
    encoder.SetTrackEncodedProperties(true);
    encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, kDracoPositionBits);
    encoder.SetAttributeQuantization(draco::GeometryAttribute::NORMAL, kDracoNormalBits);
    encoder.SetAttributeQuantization(draco::GeometryAttribute::TEX_COORD, kDracoTexCoordBits);
    encoder.SetAttributeQuantization(draco::GeometryAttribute::COLOR, kDracoColorBits);
    draco::EncoderBuffer out;
    if (const draco::Status status = encoder.EncodeMeshToBuffer(coded, &out); !status.ok())
      throw std::runtime_error("draco cannot encode the mesh: " + status.error_msg_string());
    for (const auto& [name, accessor] : primitive.attributes)
      model.accessors[static_cast<std::size_t>(accessor)].count = encoder.num_encoded_points();
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(out.data());
    const int view = add_view(Bytes(bytes, bytes + out.size()));
    Stream indices = indices_of(mesh);
    indices.count = 3 * encoder.num_encoded_faces();
    indices.component = TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
    primitive.indices = add_accessor(indices, -1);
    tinygltf::Value::Object extension;
    extension["bufferView"] = tinygltf::Value(view);
    extension["attributes"] = tinygltf::Value(ids);
    primitive.extensions["KHR_draco_mesh_compression"] = tinygltf::Value(extension);
    use("KHR_draco_mesh_compression", true);
  }

  /// The JSON; `bin` and `image_files` name the external files, empty: embedded.
  [[nodiscard]] std::string json(const std::string& bin, const std::vector<std::string>& image_files) const {
    tinygltf::Model document = model;
    tinygltf::TinyGLTF writer;
    std::ostringstream text;
    document.images.clear();  // else tinygltf would write the images
    if (!writer.WriteGltfSceneToStream(&document, text, false, false)) throw std::runtime_error("tinygltf failed");
    nlohmann::json j = parsed_json(text.str());
    if (buffer.size > 0) {
      j["buffers"] = {{{"byteLength", buffer.size}}};
      if (!bin.empty()) j["buffers"][0]["uri"] = as_uri(bin);
    }
    for (std::size_t i = 0; i < model.images.size(); ++i) {
      nlohmann::json& image = j["images"][i];
      image = {{"name", model.images[i].name}, {"mimeType", model.images[i].mimeType}};
      if (image_files.empty())
        image["bufferView"] = model.bufferViews.size() - images.size() + i;
      else
        image["uri"] = as_uri(image_files[i]);
    }
    if (!model.cameras.empty()) j["cameras"][0]["perspective"].erase("zfar");  // tinygltf writes 0 for infinity
    if (!compressed.empty()) {
      j["buffers"].push_back(
          {{"byteLength", fallback}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}});
      for (const Compressed& c : compressed)
        j["bufferViews"][c.view]["extensions"]["EXT_meshopt_compression"] = {
            {"buffer", 0},      {"byteOffset", c.offset}, {"byteLength", c.size}, {"byteStride", c.stride},
            {"count", c.count}, {"mode", c.mode}};
    }
    return bin.empty() ? j.dump() : j.dump(1) + '\n';
  }
};

GltfWriter::GltfWriter(GltfOptions options) : state_(std::make_unique<State>()) {
  State& s = *state_;
  s.options = std::move(options);
  if (!s.options.file.empty()) s.buffer.spool = std::make_shared<Spool>(s.options.file);
  s.model.asset.version = "2.0";
  s.model.asset.generator = "cairn";
  tinygltf::Value::Object extras;
  const auto& upright = s.options.upright;
  s.options.axes = resolved(s.options.axes, Axes::y_up);
  const char* up = s.options.axes == Axes::y_up ? "y" : s.options.axes == Axes::z_up ? "z" : "-y";
  extras["up_axis"] = tinygltf::Value(std::string(!upright || upright->known ? up : "unknown"));
  extras["axes"] = tinygltf::Value(std::string(to_string(s.options.axes)));
  if (upright) extras["up_source"] = tinygltf::Value(std::string(to_string(upright->source)));
  extras["unit"] = tinygltf::Value(std::string("metre"));
  extras["scale"] = tinygltf::Value(1.0);
  extras["gltf_from_world"] =
      tinygltf::Value(std::string(s.options.axes == Axes::y_up   ? "half turn about x: (x, -y, -z)"
                                  : s.options.axes == Axes::z_up ? "quarter turn about x: (x, z, -y)"
                                                                 : "none: (x, y, z)"));
  if (!s.options.source.empty()) extras["source"] = tinygltf::Value(as_utf8(s.options.source));
  s.model.asset.extras = tinygltf::Value(extras);
  tinygltf::Scene scene;
  scene.name = "map";
  s.model.scenes.push_back(scene);
  s.model.defaultScene = 0;
}
GltfWriter::~GltfWriter() = default;
GltfWriter::GltfWriter(GltfWriter&&) noexcept = default;

GltfWriter::Added GltfWriter::add(const std::string& name, const Mesh& in_world) {
  if (in_world.triangles.empty()) return {};  // glTF has no empty meshes
  State& s = *state_;
  const bool is_y_up = s.options.axes == Axes::y_up;
  const Mesh turned_mesh = is_y_up ? Mesh() : before_y_up(in_world, s.options.axes);
  const Mesh& given = is_y_up ? in_world : turned_mesh;
  const Compression compression = s.options.compression;
  std::optional<Snapped> snapped;
  if (compression != Compression::none) {
    snapped = snap(given, s.options.is_single_mesh);
    if (compression == Compression::meshopt) reorder(snapped->mesh);
    if (snapped->mesh.triangles.empty()) return {};
  }
  const Mesh& mesh = snapped ? snapped->mesh : given;
  tinygltf::Primitive primitive;
  primitive.mode = TINYGLTF_MODE_TRIANGLES;
  primitive.material = s.material_of(mesh);
  tinygltf::Node node;
  node.name = name;
  if (compression == Compression::draco) {
    s.encode_draco(mesh, primitive);
  } else {
    const bool compress = compression == Compression::meshopt;
    for (auto& [attribute, stream] : snapped ? quantized_attributes(*snapped) : plain_attributes(mesh)) {
      primitive.attributes[attribute] = s.add_stream(std::move(stream), false, compress);
      if (attribute == "POSITION") set_box(mesh, snapped ? &*snapped : nullptr, s.model.accessors.back());
    }
    primitive.indices = s.add_stream(indices_of(mesh), true, compress);
    if (snapped) {
      node.translation = numbers(snapped->low);
      node.scale = std::vector<double>(3, snapped->step);
      s.use("KHR_mesh_quantization", true);
    }
    if (compress) s.use("EXT_meshopt_compression", true);
  }
  node.mesh = static_cast<int>(s.model.meshes.size());
  tinygltf::Mesh gltf_mesh;
  gltf_mesh.name = name;
  gltf_mesh.primitives.push_back(primitive);
  s.model.meshes.push_back(gltf_mesh);
  s.model.scenes[0].nodes.push_back(static_cast<int>(s.model.nodes.size()));
  s.model.nodes.push_back(node);
  return {mesh.triangles.size(), mesh.positions.size()};
}

void GltfWriter::add_cameras(const Camera& camera, const Trajectory& path,
                             const std::vector<Eigen::Isometry3d>& cameras) {
  State& s = *state_;
  const auto add_node = [&](const tinygltf::Node& node) {
    s.model.scenes[0].nodes.push_back(static_cast<int>(s.model.nodes.size()));
    s.model.nodes.push_back(node);
  };
  if (path.size() > 1) {
    Mesh line;
    for (const StampedPose& pose : path)
      line.positions.emplace_back(pose.world_from_camera.translation().cast<float>());
    line = before_y_up(std::move(line), s.options.axes);
    tinygltf::Primitive primitive;
    primitive.mode = TINYGLTF_MODE_LINE_STRIP;
    primitive.attributes["POSITION"] = s.add_stream(floats(flat(line.positions), TINYGLTF_TYPE_VEC3), false, false);
    set_box(line, nullptr, s.model.accessors.back());
    tinygltf::Material material;
    material.name = "path";
    material.pbrMetallicRoughness.baseColorFactor = {0.07, 0.26, 1.0, 1.0};
    s.use(kUnlit[0]);
    material.extensions[kUnlit[0]] = tinygltf::Value(tinygltf::Value::Object{});
    primitive.material = static_cast<int>(s.model.materials.size());
    s.model.materials.push_back(material);
    tinygltf::Node node;
    node.name = "path";
    node.mesh = static_cast<int>(s.model.meshes.size());
    tinygltf::Mesh mesh;
    mesh.name = "path";
    mesh.primitives.push_back(primitive);
    s.model.meshes.push_back(mesh);
    add_node(node);
  }
  if (cameras.empty()) return;
  tinygltf::Camera lens;
  lens.type = "perspective";
  lens.name = "depth camera";
  lens.perspective.yfov = 2 * std::atan(0.5 * camera.height / camera.fy);
  lens.perspective.aspectRatio = camera.width * camera.fy / (camera.height * camera.fx);
  lens.perspective.znear = 0.05;
  s.model.cameras.push_back(lens);
  const Eigen::Matrix3d turn = matrix_from_world(s.options.axes), lens_turn = matrix_from_world(Axes::y_up);
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    tinygltf::Node node;
    node.name = "camera-" + std::to_string(i);
    node.camera = 0;
    const Eigen::Quaterniond q(turn * cameras[i].linear() * lens_turn);
    const Eigen::Vector3d t = turn * cameras[i].translation();
    node.rotation = {q.x(), q.y(), q.z(), q.w()};
    node.translation = {t.x(), t.y(), t.z()};
    add_node(node);
  }
}

Bytes join_glb(std::string json, Bytes buffer) {
  ChunkedBuffer buffered;
  buffered.add(std::make_shared<const Bytes>(std::move(buffer)));
  std::ostringstream out;
  put_glb(out, std::move(json), {}, std::move(buffered));
  return bytes_of(out);
}

void GltfWriter::put(std::ostream& out) const {
  // Images are at the end of the buffer.
  State copy = *state_;
  copy.buffer = {.size = state_->buffer.size, .spool = {}, .chunks = {}};
  for (const auto& image : copy.images) (void)copy.add_view(image);
  put_glb(out, copy.json({}, {}), state_->buffer, std::move(copy.buffer));
}

std::vector<std::filesystem::path> GltfWriter::write(const std::filesystem::path& file) const {
  std::vector<std::filesystem::path> written{file};
  if (extension_of(file) == ".glb") {
    write_whole(file, [&](std::ostream& out) { put(out); });
    return written;
  }
  // External files first: a visible .gltf is then complete.
  const std::string stem = as_utf8(file.stem().string());  // the names appear in the JSON
  std::vector<std::string> names;
  for (std::size_t i = 0; i < state_->images.size(); ++i) {
    names.push_back(stem + "-" + std::to_string(i) + (state_->options.png ? ".png" : ".jpg"));
    written.push_back(file.parent_path() / names.back());
    write_whole(written.back(), *state_->images[i]);
  }
  const std::string bin = stem + ".bin";
  if (state_->buffer.size > 0) {
    written.push_back(file.parent_path() / bin);
    write_whole(written.back(), [&](std::ostream& out) { state_->buffer.put(out); });
  }
  write_whole(file, state_->json(bin, names));
  return written;
}

void write_gltf(const std::filesystem::path& file, const Mesh& mesh) {
  GltfWriter writer;
  writer.add("map", mesh);
  writer.write(file);
}

}  // namespace cairn
