// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Stanford PLY: a header and plain records.
#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string_view>

#include "base/atomic_file.hpp"
#include "base/read_whole.hpp"
#include "base/words.hpp"
#include "geometry/axes.hpp"
#include "mesh/formats.hpp"

namespace cairn {
namespace {

static_assert(std::endian::native == std::endian::little);

struct Property {
  std::string name, type, count_type;  // count_type: type of a list's length, else empty
};
struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;
};

/// Unread rest of a file's bytes.
class Rest {
 public:
  explicit Rest(std::string_view bytes) : rest_(bytes) {}
  std::string_view line() {
    const std::string_view line = take(std::min(rest_.find('\n'), rest_.size()));
    rest_.remove_prefix(rest_.empty() ? 0 : 1);
    return line;
  }
  [[nodiscard]] bool at_end() const { return rest_.empty(); }
  /// Reads a number of a PLY type, as text or binary.
  double number(const std::string& type, bool ascii) {
    if (ascii) {
      constexpr const char* kSpace = " \t\r\n";
      take(std::min(rest_.find_first_not_of(kSpace), rest_.size()));
      const auto value = number_in(take(std::min(rest_.find_first_of(kSpace), rest_.size())));
      if (!value) throw std::runtime_error("the file is cut off or malformed");
      return *value;
    }
    if (type == "float" || type == "float32") return as<float>();
    if (type == "double" || type == "float64") return as<double>();
    if (type == "uchar" || type == "uint8") return as<std::uint8_t>();
    if (type == "char" || type == "int8") return as<std::int8_t>();
    if (type == "ushort" || type == "uint16") return as<std::uint16_t>();
    if (type == "short" || type == "int16") return as<std::int16_t>();
    if (type == "uint" || type == "uint32") return as<std::uint32_t>();
    if (type == "int" || type == "int32") return as<std::int32_t>();
    throw std::runtime_error("type '" + shown(type) + "' is not supported");
  }

 private:
  std::string_view take(std::size_t count) {
    if (count > rest_.size()) throw std::runtime_error("the file is cut off or malformed");
    const std::string_view taken = rest_.substr(0, count);
    rest_.remove_prefix(count);
    return taken;
  }
  template <class T>
  double as() {
    T value;
    std::memcpy(&value, take(sizeof(T)).data(), sizeof(T));
    return static_cast<double>(value);
  }
  std::string_view rest_;
};

struct Header {
  bool ascii = false;
  Axes axes = Axes::world;
  std::vector<Element> elements;
};

Header read_header(Rest& rest) {
  if (!rest.line().starts_with("ply")) throw std::runtime_error("is not a PLY file");
  Header header;
  std::string format;
  while (true) {
    if (rest.at_end()) throw std::runtime_error("its header has no end_header: the file is cut off");
    const std::string line(rest.line());
    std::istringstream words(line);
    std::string word;
    words >> word;
    if (word == "end_header") break;
    if (word == "format") {
      words >> format;
    } else if (word == "comment") {
      header.axes = axes_in(line).value_or(header.axes);
    } else if (word == "element") {
      Element& element = header.elements.emplace_back();
      std::string text;
      words >> element.name >> text;
      const auto count = number_in<std::uint64_t>(text);
      if (!count) throw std::runtime_error("'" + shown(text) + "' is not a number of elements");
      element.count = *count;
    } else if (word == "property" && !header.elements.empty()) {
      Property p;
      words >> p.type;
      if (p.type == "list") words >> p.count_type >> p.type;
      words >> p.name;
      header.elements.back().properties.push_back(p);
    }
  }
  header.ascii = format == "ascii";
  if (!header.ascii && format != "binary_little_endian")
    throw std::runtime_error("format '" + shown(format) + "' is not supported");
  if (std::count_if(header.elements.begin(), header.elements.end(),
                    [](const Element& e) { return e.name == "vertex"; }) > 1)
    throw std::runtime_error("has more than one list of vertices");  // their properties might differ
  for (const Element& element : header.elements) {
    if (element.properties.empty() && element.count > 0)
      throw std::runtime_error("element '" + shown(element.name) + "' has no properties");
    const auto has = [&](const char* name) {
      return std::any_of(element.properties.begin(), element.properties.end(),
                         [&](const Property& p) { return p.name == name && p.count_type.empty(); });
    };
    if (element.name == "vertex" && !(has("x") && has("y") && has("z")))
      throw std::runtime_error("its vertices have no x, y and z");
  }
  return header;
}

/// Checks a list's index or length.
std::uint32_t to_index(double value) {
  if (!(value >= 0 && value <= std::numeric_limits<std::uint32_t>::max()))
    throw std::runtime_error("a face has an index or a length that is negative or too large");
  return static_cast<std::uint32_t>(value);
}

std::uint8_t channel(double value) { return static_cast<std::uint8_t>(value > 0 ? std::min(value, 255.0) : 0.0); }

Mesh read(Rest rest) {
  const auto [ascii, axes, elements] = read_header(rest);
  Mesh mesh;
  for (const auto& element : elements) {
    std::map<std::string, double> v;
    std::vector<std::uint32_t> list;
    // Reserves no memory for the counts in the header, which are untrusted.
    for (std::uint64_t i = 0; i < element.count; ++i) {
      for (const auto& p : element.properties) {
        if (p.count_type.empty()) {
          v[p.name] = rest.number(p.type, ascii);
          continue;
        }
        const bool is_face = element.name == "face" && p.name.starts_with("vertex_ind");
        list.clear();
        for (std::uint32_t left = to_index(rest.number(p.count_type, ascii)); left > 0; --left) {
          const double item = rest.number(p.type, ascii);
          if (is_face) list.push_back(to_index(item));
        }
        for (std::size_t k = 1; k + 1 < list.size(); ++k) mesh.triangles.push_back({list[0], list[k], list[k + 1]});
      }
      if (element.name != "vertex") continue;
      const auto f = [&](const char* name) { return static_cast<float>(v[name]); };
      mesh.positions.emplace_back(f("x"), f("y"), f("z"));
      if (v.contains("nx")) mesh.normals.emplace_back(f("nx"), f("ny"), f("nz"));
      if (v.contains("sigma")) mesh.sigmas.push_back(f("sigma"));
      if (v.contains("red")) mesh.colors.push_back({channel(v["red"]), channel(v["green"]), channel(v["blue"]), 255});
    }
  }
  for (const auto& t : mesh.triangles)
    for (const auto index : t)
      if (index >= mesh.positions.size()) throw std::runtime_error("an index reaches beyond the vertices");
  turn_to_world(mesh, axes);
  return mesh;
}

}  // namespace

Mesh read_ply(const std::filesystem::path& file) {
  try {
    const auto bytes = read_whole(file, kAnySize);
    return read(Rest({reinterpret_cast<const char*>(bytes.data()), bytes.size()}));
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
}

void write_ply(const std::filesystem::path& file, Mesh mesh, Axes axes) {
  axes = resolved(axes, Axes::world);
  turn_from_world(mesh, axes);
  std::ostringstream header;
  header << "ply\nformat binary_little_endian 1.0\ncomment cairn, metres, " << described(axes) << "\nelement vertex "
         << mesh.positions.size() << "\nproperty float x\nproperty float y\nproperty float z\n";
  if (!mesh.normals.empty()) header << "property float nx\nproperty float ny\nproperty float nz\n";
  if (!mesh.colors.empty()) header << "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  if (!mesh.sigmas.empty()) header << "property float sigma\n";
  header << "element face " << mesh.triangles.size() << "\nproperty list uchar uint vertex_indices\nend_header\n";
  std::string bytes = header.str();
  const auto put = [&](const void* data, std::size_t size) { bytes.append(static_cast<const char*>(data), size); };
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    put(mesh.positions[i].data(), 12);
    if (!mesh.normals.empty()) put(mesh.normals[i].data(), 12);
    if (!mesh.colors.empty()) put(mesh.colors[i].data(), 3);
    if (!mesh.sigmas.empty()) put(&mesh.sigmas[i], 4);
  }
  for (const auto& t : mesh.triangles) {
    bytes += '\3';
    put(t.data(), 12);
  }
  write_whole(file, bytes);
}

}  // namespace cairn
