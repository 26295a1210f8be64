// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Layout of the program of Kerbl et al. 2023: little-endian floats per vertex; harmonics by channel, then by index.
#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <sstream>
#include <stdexcept>
#include <string_view>

#include "base/atomic_file.hpp"
#include "base/words.hpp"
#include "splats/formats.hpp"

namespace cairn {
namespace {

static_assert(std::endian::native == std::endian::little);

/// Names of the properties, in the file's order.
std::vector<std::string> properties_of(int degree) {
  std::vector<std::string> names{"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"};
  for (std::size_t k = 0; k < 3 * harmonics_per_splat(degree); ++k) names.push_back("f_rest_" + std::to_string(k));
  for (const char* name : {"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
    names.emplace_back(name);
  return names;
}

struct Header {
  std::size_t vertices = 0, bytes = 0;  // bytes: of the header
  std::vector<std::string> names;
};

Header read_header(std::string_view text) {
  Header header;
  bool is_vertex = false;
  for (std::size_t number = 0;; ++number) {
    const std::size_t end = text.find('\n', header.bytes);
    if (end == std::string_view::npos) throw std::runtime_error("its header has no end_header: the file is cut off");
    std::string line(text.substr(header.bytes, end - header.bytes));
    if (line.ends_with('\r')) line.pop_back();
    header.bytes = end + 1;
    if (number == 0 && line != "ply") throw std::runtime_error("is not a PLY file");
    if (line == "end_header") break;
    std::istringstream words(line);
    std::string word, type, name;
    words >> word >> type >> name;
    if (word == "format" && type != "binary_little_endian")
      throw std::runtime_error("format '" + shown(type) + "' is not supported for splats: use binary_little_endian");
    if (word == "element") {
      const auto count = number_in<std::uint64_t>(name);
      if (!count) throw std::runtime_error("'" + shown(name) + "' is not a number of elements");
      is_vertex = type == "vertex";
      if (!is_vertex && *count > 0)
        throw std::runtime_error("element '" + shown(type) + "' is not supported for splats");
      if (is_vertex) header.vertices = static_cast<std::size_t>(*count);
    } else if (word == "property" && is_vertex) {
      if (type != "float" && type != "float32")
        throw std::runtime_error("property '" + shown(name) + "' is of type '" + shown(type) +
                                 "', but splats are read from float alone");
      header.names.push_back(name);
    }
  }
  return header;
}

int degree_of(const std::vector<std::string>& names) {
  const auto count = static_cast<std::size_t>(
      std::count_if(names.begin(), names.end(), [](const std::string& name) { return name.starts_with("f_rest_"); }));
  for (int degree = 0; degree <= 3; ++degree)
    if (count == 3 * harmonics_per_splat(degree)) return degree;
  throw std::runtime_error(std::to_string(count) + " properties f_rest_ are not those of a degree from 0 to 3");
}

}  // namespace

void write_splat_ply(const std::filesystem::path& file, const Splats& splats) {
  std::ostringstream header;
  header << "ply\nformat binary_little_endian 1.0\nelement vertex " << splats.size() << '\n';
  for (const std::string& name : properties_of(splats.degree)) header << "property float " << name << '\n';
  header << "end_header\n";
  const std::size_t harmonics = harmonics_per_splat(splats.degree);
  write_whole(file, [&](std::ostream& out) {
    out << header.str();
    std::vector<float> values;
    for (std::size_t i = 0; i < splats.size(); ++i) {
      values.clear();
      const auto put = [&](const auto& vector) {
        values.insert(values.end(), vector.data(), vector.data() + vector.size());
      };
      put(splats.positions[i]);
      put(Eigen::Vector3f::Zero().eval());
      put(splats.colors[i]);
      for (int channel = 0; channel < 3; ++channel)
        for (std::size_t k = 0; k < harmonics; ++k) values.push_back(splats.harmonics[i * harmonics + k][channel]);
      values.push_back(splats.opacities[i]);
      put(splats.log_scales[i]);
      put(splats.rotations[i]);
      out.write(reinterpret_cast<const char*>(values.data()),
                static_cast<std::streamsize>(sizeof(float) * values.size()));
    }
  });
}

Splats read_splat_ply(std::span<const std::uint8_t> bytes) {
  const Header header = read_header({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  Splats splats;
  splats.degree = degree_of(header.names);
  std::vector<std::size_t> columns;
  for (const std::string& name : properties_of(splats.degree)) {
    const auto found = std::find(header.names.begin(), header.names.end(), name);
    if (found == header.names.end() && !name.starts_with('n'))
      throw std::runtime_error("its vertices have no property " + name + ": it has no Gaussian splats");
    columns.push_back(static_cast<std::size_t>(found - header.names.begin()));
  }
  const std::size_t size = sizeof(float) * header.names.size(), harmonics = harmonics_per_splat(splats.degree);
  if (header.vertices > (bytes.size() - header.bytes) / size) throw std::runtime_error("the file is cut off");
  std::vector<float> row(header.names.size() + 1);  // the last for absent normals
  for (std::size_t i = 0; i < header.vertices; ++i) {
    std::memcpy(row.data(), bytes.data() + header.bytes + i * size, size);
    const auto at = [&](std::size_t column) { return row[columns[column]]; };
    splats.positions.emplace_back(at(0), at(1), at(2));
    splats.colors.emplace_back(at(6), at(7), at(8));
    for (std::size_t k = 0; k < harmonics; ++k)
      splats.harmonics.emplace_back(at(9 + k), at(9 + harmonics + k), at(9 + 2 * harmonics + k));
    const std::size_t next = 9 + 3 * harmonics;
    splats.opacities.push_back(at(next));
    splats.log_scales.emplace_back(at(next + 1), at(next + 2), at(next + 3));
    splats.rotations.emplace_back(at(next + 4), at(next + 5), at(next + 6), at(next + 7));
  }
  return splats;
}

}  // namespace cairn
