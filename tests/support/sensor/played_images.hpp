// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Images of the virtual sensors, and the words of the environment variable that configures a sensor.
#pragma once
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

namespace virtual_sensor {

/// Value of a word in an environment variable; "1" for a word without a value, empty if absent.
inline std::string setting(const char* variable, const std::string& name) {
  const char* all = std::getenv(variable);
  std::istringstream words(all != nullptr ? all : "");
  for (std::string word; words >> word;) {
    if (word == name) return "1";
    if (word.rfind(name + "=", 0) == 0) return word.substr(name.size() + 1);
  }
  return {};
}
inline double number(const char* variable, const std::string& name, double otherwise) {
  const std::string value = setting(variable, name);
  return value.empty() ? otherwise : std::stod(value);
}

struct ImageSize {
  int width, height;
  [[nodiscard]] int pixels() const { return width * height; }
};

/// Images repeated by a sensor: FOLDER/depth-N.raw (16 bit) and color-N.raw (RGB); default: a slanted wall.
struct PlayedImages {
  std::vector<std::vector<char>> depth, color;

  PlayedImages(const std::string& folder, ImageSize depth_size, ImageSize color_size) {
    for (int i = 0; !folder.empty(); ++i) {
      auto d = read(folder + "/depth-" + std::to_string(i) + ".raw"),
           c = read(folder + "/color-" + std::to_string(i) + ".raw");
      if (d.empty()) break;
      depth.push_back(std::move(d)), color.push_back(std::move(c));
    }
    if (depth.empty()) wall(depth_size, color_size);
  }

 private:
  static std::vector<char> read(const std::string& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  /// Depth with a sensor's noise and texture, so that recording costs as much.
  void wall(ImageSize depth_size, ImageSize color_size) {
    std::uint32_t random = 1;
    const auto next = [&random] { return random = random * 1664525u + 1013904223u; };
    for (int i = 0; i < 8; ++i) {
      auto& d = depth.emplace_back(2 * depth_size.pixels());
      auto& c = color.emplace_back(3 * color_size.pixels());
      for (int p = 0; p < depth_size.pixels(); ++p) {
        const auto z = static_cast<std::uint16_t>(1000 + p % depth_size.width + (next() >> 24) % 5);
        std::memcpy(&d[static_cast<std::size_t>(2 * p)], &z, 2);
      }
      for (int p = 0; p < color_size.pixels(); ++p) {
        const double grain = (next() >> 20) % 8;
        for (int k = 0; k < 3; ++k)
          c[static_cast<std::size_t>(3 * p + k)] = static_cast<char>(128 + 100 * std::sin(p * 0.01 * (k + 1)) + grain);
      }
    }
  }
};

}  // namespace virtual_sensor
