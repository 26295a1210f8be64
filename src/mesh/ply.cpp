// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Stanford PLY. tinygltf's neighbours in Debian have no PLY reader; the format is a header and plain records.
#include <bit>
#include <cstring>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>

#include "io/atomic_file.hpp"
#include "mesh/formats.hpp"

namespace cairn {
namespace {

static_assert(std::endian::native == std::endian::little);

struct Property {
  std::string name, type, count_type;  // count_type: of a list, else empty
};
struct Element {
  std::string name;
  std::size_t count = 0;
  std::vector<Property> properties;
};

/// Reads one number of a PLY type from text or bytes.
double read_number(std::istream& in, const std::string& type, bool ascii) {
  double value = 0;
  if (ascii) {
    in >> value;
  } else {
    const auto as = [&]<class T>(T v) {
      in.read(reinterpret_cast<char*>(&v), sizeof(v));
      return static_cast<double>(v);
    };
    if (type == "float" || type == "float32")
      value = as(float{});
    else if (type == "double" || type == "float64")
      value = as(double{});
    else if (type == "uchar" || type == "uint8")
      value = as(std::uint8_t{});
    else if (type == "char" || type == "int8")
      value = as(std::int8_t{});
    else if (type == "ushort" || type == "uint16")
      value = as(std::uint16_t{});
    else if (type == "short" || type == "int16")
      value = as(std::int16_t{});
    else if (type == "uint" || type == "uint32")
      value = as(std::uint32_t{});
    else if (type == "int" || type == "int32")
      value = as(std::int32_t{});
    else
      throw std::runtime_error("type '" + type + "' is not read");
  }
  if (!in) throw std::runtime_error("the file is cut off or malformed");
  return value;
}

Mesh read(std::istream& in) {
  std::string line, word, format;
  std::getline(in, line);
  if (!line.starts_with("ply")) throw std::runtime_error("is no PLY file");
  std::vector<Element> elements;
  while (std::getline(in, line) && !line.starts_with("end_header")) {
    std::istringstream words(line);
    words >> word;
    if (word == "format") {
      words >> format;
    } else if (word == "element") {
      words >> elements.emplace_back().name >> elements.back().count;
    } else if (word == "property" && !elements.empty()) {
      Property p;
      words >> p.type;
      if (p.type == "list") words >> p.count_type >> p.type;
      words >> p.name;
      elements.back().properties.push_back(p);
    }
  }
  const bool ascii = format == "ascii";
  if (!ascii && format != "binary_little_endian") throw std::runtime_error("format '" + format + "' is not read");
  Mesh mesh;
  for (const auto& element : elements) {
    std::map<std::string, double> v;
    std::vector<std::uint32_t> list;
    for (std::size_t i = 0; i < element.count; ++i) {
      for (const auto& p : element.properties) {
        if (p.count_type.empty()) {
          v[p.name] = read_number(in, p.type, ascii);
          continue;
        }
        list.resize(static_cast<std::size_t>(read_number(in, p.count_type, ascii)));
        for (auto& item : list) item = static_cast<std::uint32_t>(read_number(in, p.type, ascii));
        if (element.name == "face" && p.name.starts_with("vertex_ind"))
          for (std::size_t k = 1; k + 1 < list.size(); ++k) mesh.triangles.push_back({list[0], list[k], list[k + 1]});
      }
      if (element.name != "vertex") continue;
      const auto f = [&](const char* name) { return static_cast<float>(v[name]); };
      mesh.positions.emplace_back(f("x"), f("y"), f("z"));
      if (v.contains("nx")) mesh.normals.emplace_back(f("nx"), f("ny"), f("nz"));
      if (v.contains("red")) {
        const auto c = [&](const char* name) { return static_cast<std::uint8_t>(v[name]); };
        mesh.colours.push_back({c("red"), c("green"), c("blue"), 255});
      }
    }
  }
  for (const auto& t : mesh.triangles)
    for (const auto index : t)
      if (index >= mesh.positions.size()) throw std::runtime_error("an index reaches beyond the vertices");
  return mesh;
}

}  // namespace

Mesh read_ply(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error(file.string() + ": cannot be read");
  try {
    return read(in);
  } catch (const std::exception& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
}

void write_ply(const std::filesystem::path& file, const Mesh& mesh) {
  std::ostringstream header;
  header << "ply\nformat binary_little_endian 1.0\ncomment cairn, metres\nelement vertex " << mesh.positions.size()
         << "\nproperty float x\nproperty float y\nproperty float z\n";
  if (!mesh.normals.empty()) header << "property float nx\nproperty float ny\nproperty float nz\n";
  if (!mesh.colours.empty()) header << "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  header << "element face " << mesh.triangles.size() << "\nproperty list uchar uint vertex_indices\nend_header\n";
  std::string bytes = header.str();
  const auto put = [&](const void* data, std::size_t size) { bytes.append(static_cast<const char*>(data), size); };
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    put(mesh.positions[i].data(), 12);
    if (!mesh.normals.empty()) put(mesh.normals[i].data(), 12);
    if (!mesh.colours.empty()) put(mesh.colours[i].data(), 3);
  }
  for (const auto& t : mesh.triangles) {
    bytes += '\3';
    put(t.data(), 12);
  }
  write_whole(file, bytes);
}

}  // namespace cairn
