// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// USDZ (Pixar, usdz file format specification): a stored ZIP archive with a scene as USD text and its textures, each
// file's bytes at a multiple of 64.
#include <fmt/format.h>

#include <bit>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string>

#include "base/atomic_file.hpp"
#include "base/gzip.hpp"
#include "geometry/axes.hpp"
#include "mesh/formats.hpp"

namespace cairn {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::size_t kAlignment = 64;  // bytes
constexpr const char* kPerVertex = " (\n      interpolation = \"vertex\"\n    )\n";

class Archive {
 public:
  void add(const std::string& name, std::string_view bytes) {
    const std::uint64_t at = out_.size();
    const std::size_t unaligned = out_.size() + kLocalBytes + name.size() + kExtraBytes;
    const auto padding = static_cast<std::uint16_t>((kAlignment - unaligned % kAlignment) % kAlignment);
    const std::uint32_t sum = crc32_of(bytes);
    std::string common;                // of both headers
    put(common, std::uint16_t{20});    // version
    put(common, std::uint16_t{0});     // flags
    put(common, std::uint16_t{0});     // stored
    put(common, std::uint16_t{0});     // time
    put(common, std::uint16_t{0x21});  // the first day of 1980
    put(common, sum);
    put(common, static_cast<std::uint32_t>(bytes.size()));
    put(common, static_cast<std::uint32_t>(bytes.size()));
    put(common, static_cast<std::uint16_t>(name.size()));
    put(out_, std::uint32_t{0x04034b50});
    out_ += common;
    put(out_, static_cast<std::uint16_t>(kExtraBytes + padding));
    out_ += name;
    put(out_, std::uint16_t{0x1986});  // padding
    put(out_, padding);
    out_.append(padding, '\0');
    out_ += bytes;
    put(directory_, std::uint32_t{0x02014b50});
    put(directory_, std::uint16_t{20});
    directory_ += common;
    directory_.append(2 + 2 + 2 + 2 + 4, '\0');  // extra field, comment, disk, attributes
    put(directory_, static_cast<std::uint32_t>(at));
    directory_ += name;
    ++count_;
  }
  [[nodiscard]] std::string finish() && {
    const std::size_t at = out_.size();
    out_ += directory_;
    put(out_, std::uint32_t{0x06054b50});
    put(out_, std::uint32_t{0});  // disks
    put(out_, count_);
    put(out_, count_);
    put(out_, static_cast<std::uint32_t>(directory_.size()));
    put(out_, static_cast<std::uint32_t>(at));
    put(out_, std::uint16_t{0});
    return std::move(out_);
  }

 private:
  static constexpr std::size_t kLocalBytes = 30, kExtraBytes = 4;
  template <class T>
  static void put(std::string& out, const T& value) {
    out.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  std::string out_, directory_;
  std::uint16_t count_ = 0;
};

template <class Values, class Write>
void put_array(std::string& out, const char* declared, const Values& values, const Write& write) {
  fmt::format_to(std::back_inserter(out), "    {} = [", declared);
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (i > 0) out += ',';
    write(values[i]);
  }
  out += ']';
}

void put_mesh(std::string& out, const Mesh& mesh, std::size_t number) {
  auto to = std::back_inserter(out);
  const auto vector = [&](const Eigen::Vector3f& v) {
    const Eigen::Vector3f p = from_world(v, Axes::y_up);
    fmt::format_to(to, "({:.5g},{:.5g},{:.5g})", p.x(), p.y(), p.z());
  };
  const bool is_textured = !mesh.texture_coordinates.empty();
  fmt::format_to(to, "  def Mesh \"part_{}\" (\n    prepend apiSchemas = [\"MaterialBindingAPI\"]\n  )\n  {{\n",
                 number);
  fmt::format_to(to, "    uniform token subdivisionScheme = \"none\"\n    bool doubleSided = 1\n");
  fmt::format_to(to, "    rel material:binding = </map/surface_{}>\n", is_textured ? std::to_string(number) : "colors");
  put_array(out, "int[] faceVertexCounts", mesh.triangles, [&](const auto&) { out += '3'; });
  out += '\n';
  put_array(out, "int[] faceVertexIndices", mesh.triangles,
            [&](const auto& t) { fmt::format_to(to, "{},{},{}", t[0], t[1], t[2]); });
  out += '\n';
  put_array(out, "point3f[] points", mesh.positions, [&](const Eigen::Vector3f& p) {
    const Eigen::Vector3f q = from_world(p, Axes::y_up);
    fmt::format_to(to, "({:.4f},{:.4f},{:.4f})", q.x(), q.y(), q.z());
  });
  out += '\n';
  if (!mesh.normals.empty()) {
    put_array(out, "normal3f[] normals", mesh.normals, vector);
    out += kPerVertex;
  }
  if (is_textured) {
    put_array(out, "texCoord2f[] primvars:st", mesh.texture_coordinates,
              [&](const auto& p) { fmt::format_to(to, "({:.6f},{:.6f})", p.x(), 1 - p.y()); });
    out += kPerVertex;
  } else if (!mesh.colors.empty()) {
    put_array(out, "color3f[] primvars:displayColor", mesh.colors, [&](const auto& c) {
      fmt::format_to(to, "({:.4f},{:.4f},{:.4f})", c[0] / 255.0, c[1] / 255.0, c[2] / 255.0);
    });
    out += kPerVertex;
  }
  out += "  }\n";
}

/// Material without reflections: with the texture of a part, or with the vertices' colors.
void put_material(std::string& out, const std::string& name, const std::string& image) {
  const bool is_textured = !image.empty();
  const std::string path = "/map/surface_" + name;
  auto to = std::back_inserter(out);
  fmt::format_to(
      to,
      "  def Material \"surface_{}\"\n  {{\n    token outputs:surface.connect = <{}/shader.outputs:surface>\n"
      "    def Shader \"shader\"\n    {{\n      uniform token info:id = \"UsdPreviewSurface\"\n"
      "      color3f inputs:diffuseColor.connect = <{}/color.outputs:{}>\n"
      "      float inputs:roughness = 1\n      float inputs:metallic = 0\n      token outputs:surface\n    }}\n",
      name, path, path, is_textured ? "rgb" : "result");
  if (is_textured)
    fmt::format_to(to,
                   "    def Shader \"coordinates\"\n    {{\n      uniform token info:id = \"UsdPrimvarReader_float2\"\n"
                   "      string inputs:varname = \"st\"\n      float2 outputs:result\n    }}\n"
                   "    def Shader \"color\"\n    {{\n      uniform token info:id = \"UsdUVTexture\"\n"
                   "      asset inputs:file = @{}@\n      token inputs:sourceColorSpace = \"sRGB\"\n"
                   "      float2 inputs:st.connect = <{}/coordinates.outputs:result>\n"
                   "      float3 outputs:rgb\n    }}\n",
                   image, path);
  else
    out +=
        "    def Shader \"color\"\n    {\n      uniform token info:id = \"UsdPrimvarReader_float3\"\n"
        "      string inputs:varname = \"displayColor\"\n      float3 outputs:result\n    }\n";
  out += "  }\n";
}

}  // namespace

void write_usdz(const std::filesystem::path& file, const std::vector<Mesh>& parts, int jpeg_quality) {
  std::string scene =
      "#usda 1.0\n(\n  defaultPrim = \"map\"\n  metersPerUnit = 1\n  upAxis = \"Y\"\n)\n\ndef Xform \"map\"\n{\n";
  std::vector<std::pair<std::string, std::vector<std::uint8_t>>> images;
  bool has_colors = false;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    put_mesh(scene, parts[i], i);
    if (parts[i].texture_coordinates.empty()) {
      has_colors = true;
      continue;
    }
    images.emplace_back(fmt::format("texture-{}.jpg", i), encode_image(parts[i].texture, false, jpeg_quality));
    put_material(scene, std::to_string(i), images.back().first);
  }
  if (has_colors) put_material(scene, "colors", "");
  scene += "}\n";
  std::size_t bytes = scene.size();
  for (const auto& [name, image] : images) bytes += image.size();
  if (bytes > std::numeric_limits<std::uint32_t>::max())
    throw std::runtime_error(file.string() + ": USDZ is limited to 4 GB; simplify the mesh");
  Archive archive;
  archive.add("map.usda", scene);
  for (const auto& [name, image] : images)
    archive.add(name, {reinterpret_cast<const char*>(image.data()), image.size()});
  write_whole(file, std::move(archive).finish());
}

}  // namespace cairn
