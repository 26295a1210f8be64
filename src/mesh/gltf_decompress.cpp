// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <draco/compression/decode.h>
#include <draco/mesh/mesh.h>
#include <meshoptimizer.h>

#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "base/file_name.hpp"
#include "base/read_json.hpp"
#include "base/read_whole.hpp"
#include "mesh/gltf.hpp"

namespace cairn {
namespace {

using Json = nlohmann::json;
using Bytes = std::vector<std::uint8_t>;
constexpr const char *kMeshopt = "EXT_meshopt_compression", *kDraco = "KHR_draco_mesh_compression";

constexpr std::size_t kMaxExpansion = 64;  // maximum expansion factor of meshopt's vertex codec

template <class T>
const T& item(const std::vector<T>& list, const Json& index, const char* what) {
  const auto i = index.get<std::size_t>();
  if (i >= list.size()) throw std::runtime_error("there is no " + std::string(what) + " " + std::to_string(i));
  return list[i];
}

std::uint32_t word_at(const Bytes& bytes, std::size_t at) {
  if (at + 4 > bytes.size()) throw std::runtime_error("is cut off");
  std::uint32_t word = 0;
  std::memcpy(&word, &bytes[at], 4);
  return word;
}

Bytes part(const Bytes& bytes, std::size_t offset, std::size_t size) {
  if (offset > bytes.size() || size > bytes.size() - offset)
    throw std::runtime_error("a view reaches beyond its buffer");
  return {bytes.begin() + static_cast<std::ptrdiff_t>(offset),
          bytes.begin() + static_cast<std::ptrdiff_t>(offset + size)};
}

Bytes decode_meshopt(const Json& view, const std::vector<Bytes>& buffers) {
  const Json& e = view.at("extensions").at(kMeshopt);
  const std::size_t count = e.at("count"), stride = e.at("byteStride");
  const std::string mode = e.at("mode");
  const Bytes packed =
      part(item(buffers, e.at("buffer"), "buffer"), e.value("byteOffset", std::size_t{0}), e.at("byteLength"));
  // Validates sizes: the decoders abort on unsupported input, and the output size does not limit their writes.
  const bool attributes = mode == "ATTRIBUTES", triangles = mode == "TRIANGLES";
  if (!attributes && !triangles && mode != "INDICES") throw std::runtime_error("a compressed view has an unknown mode");
  if (attributes ? stride == 0 || stride > 256 || stride % 4 != 0 : stride != 2 && stride != 4)
    throw std::runtime_error("a compressed view has a stride of " + std::to_string(stride) + ", which " + mode +
                             " cannot have");
  if ((triangles && count % 3 != 0) || count > packed.size() * kMaxExpansion / stride)
    throw std::runtime_error("a compressed view has " + std::to_string(count) + " elements, which its " +
                             std::to_string(packed.size()) + " bytes cannot hold");
  if (e.value("filter", "NONE") != "NONE")
    throw std::runtime_error("filters of " + std::string(kMeshopt) + " are not supported");
  Bytes bytes(count * stride);
  const int failed = attributes ? meshopt_decodeVertexBuffer(bytes.data(), count, stride, packed.data(), packed.size())
                     : triangles
                         ? meshopt_decodeIndexBuffer(bytes.data(), count, stride, packed.data(), packed.size())
                         : meshopt_decodeIndexSequence(bytes.data(), count, stride, packed.data(), packed.size());
  if (failed != 0) throw std::runtime_error("a compressed view is damaged");
  return bytes;
}

/// Decodes a draco stream into separate views.
void decode_draco(Json& j, Json& primitive, std::vector<Bytes>& views) {
  const Json e = primitive["extensions"][kDraco];
  const Bytes& packed = item(views, e.at("bufferView"), "view");
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(packed.data()), packed.size());
  auto decoded = draco::Decoder().DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok()) throw std::runtime_error("draco: " + decoded.status().error_msg_string());
  const std::unique_ptr<draco::Mesh> mesh = std::move(decoded).value();
  const auto attach = [&](Json& accessor, Bytes bytes, std::size_t count, int component) {
    accessor["bufferView"] = views.size();
    accessor["byteOffset"] = 0;
    accessor["count"] = count;
    accessor["componentType"] = component;
    accessor["normalized"] = false;
    j["bufferViews"].push_back({{"buffer", 0}, {"byteLength", bytes.size()}});
    views.push_back(std::move(bytes));
  };
  for (const auto& [name, id] : e.at("attributes").items()) {
    const draco::PointAttribute* attribute = mesh->GetAttributeByUniqueId(id.get<std::uint32_t>());
    if (attribute == nullptr) throw std::runtime_error("draco: an attribute is missing");
    const int n = attribute->num_components();
    std::vector<float> values(static_cast<std::size_t>(n) * mesh->num_points());
    for (std::uint32_t i = 0; i < mesh->num_points(); ++i)
      attribute->ConvertValue(attribute->mapped_index(draco::PointIndex(i)), static_cast<std::int8_t>(n),
                              &values[i * static_cast<std::size_t>(n)]);
    Bytes bytes(values.size() * 4);
    std::memcpy(bytes.data(), values.data(), bytes.size());
    attach(j["accessors"].at(primitive["attributes"].at(name).get<std::size_t>()), std::move(bytes), mesh->num_points(),
           5126);
  }
  Bytes indices(12 * std::size_t{mesh->num_faces()});
  for (std::uint32_t f = 0; f < mesh->num_faces(); ++f)
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t v = mesh->face(draco::FaceIndex(f))[static_cast<std::size_t>(k)].value();
      std::memcpy(&indices[12 * std::size_t{f} + 4 * static_cast<std::size_t>(k)], &v, 4);
    }
  attach(j["accessors"].at(primitive.at("indices").get<std::size_t>()), std::move(indices),
         3 * std::size_t{mesh->num_faces()}, 5125);
  primitive.erase("extensions");
}

}  // namespace

std::vector<std::uint8_t> decompressed_gltf(const std::filesystem::path& file) {
  try {
    const Bytes bytes = read_whole(file, kAnySize);
    Json j;
    Bytes bin;
    if (extension_of(file) == ".glb") {
      const std::size_t size = word_at(bytes, 12);
      j = parsed_json(part(bytes, 20, size));
      if (20 + size + 8 <= bytes.size()) bin = part(bytes, 28 + size, word_at(bytes, 20 + size));
    } else {
      j = parsed_json(bytes);
    }
    bool is_compressed = false;
    for (const auto& e : j.value("extensionsUsed", Json::array())) is_compressed |= e == kMeshopt || e == kDraco;
    if (!is_compressed) return {};
    std::vector<Bytes> buffers;
    for (const auto& b : j.value("buffers", Json::array())) {
      const std::string uri = b.value("uri", "");
      buffers.push_back(!uri.empty()      ? read_whole(file.parent_path() / uri, kAnySize)
                        : buffers.empty() ? bin
                                          : Bytes{});
    }
    std::vector<Bytes> views;
    for (auto& view : j["bufferViews"]) {
      const bool is_packed = view.contains("extensions") && view["extensions"].contains(kMeshopt);
      views.push_back(is_packed ? decode_meshopt(view, buffers)
                                : part(item(buffers, view.at("buffer"), "buffer"),
                                       view.value("byteOffset", std::size_t{0}), view.at("byteLength")));
      view.erase("extensions");
    }
    for (auto& mesh : j["meshes"])
      for (auto& primitive : mesh["primitives"])
        if (primitive.contains("extensions") && primitive["extensions"].contains(kDraco))
          decode_draco(j, primitive, views);
    Bytes buffer;
    for (std::size_t i = 0; i < views.size(); ++i) {
      j["bufferViews"][i]["buffer"] = 0;
      j["bufferViews"][i]["byteOffset"] = buffer.size();
      j["bufferViews"][i]["byteLength"] = views[i].size();
      buffer.insert(buffer.end(), views[i].begin(), views[i].end());
      buffer.resize((buffer.size() + 3) & ~std::size_t{3});
    }
    j["buffers"] = {{{"byteLength", buffer.size()}}};
    j.erase("extensionsRequired");
    return join_glb(j.dump(), std::move(buffer));
  } catch (const Json::parse_error& error) {
    throw std::runtime_error(file.string() + ": cannot be read as glTF: its JSON is malformed at byte " +
                             std::to_string(error.byte));
  } catch (const Json::exception&) {
    throw std::runtime_error(file.string() + ": cannot be read as glTF: its JSON does not follow the glTF format");
  } catch (const std::exception& error) {
    throw std::runtime_error(file.string() + ": cannot be read as glTF: " + error.what());
  }
}

}  // namespace cairn
