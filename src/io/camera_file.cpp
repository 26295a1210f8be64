// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/camera_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

namespace cairn {
namespace {

std::vector<double> numbers(const YAML::Node& node, std::size_t count, const char* what) {
  const auto values = node.as<std::vector<double>>();
  if (values.size() != count) throw std::runtime_error(what);
  return values;
}

Camera read_camera(const YAML::Node& y) {
  Camera c;
  for (const auto& [name, field] : {std::pair{"fx", &c.fx}, {"fy", &c.fy}, {"cx", &c.cx}, {"cy", &c.cy}}) {
    if (!y[name]) throw std::runtime_error(std::string("`") + name + "` is missing");
    *field = y[name].as<double>();
  }
  c.width = y["width"].as<int>(640);
  c.height = y["height"].as<int>(480);
  if (y["distortion"]) {
    const auto d = numbers(y["distortion"], 5, "`distortion` takes k1 k2 p1 p2 k3");
    std::copy(d.begin(), d.end(), c.distortion.begin());
  }
  if (!(c.fx > 0 && c.fy > 0 && c.width > 0 && c.height > 0))
    throw std::runtime_error("focal lengths and size must be positive");
  return c;
}

ColourCamera read_colour_camera(const YAML::Node& y) {
  ColourCamera colour{.camera = read_camera(y)};
  const auto t = numbers(y["translation"], 3, "`translation` takes x y z, metres");
  const auto q = numbers(y["rotation"], 4, "`rotation` takes qx qy qz qw");
  const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
  if (std::abs(rotation.norm() - 1) > 1e-2) throw std::runtime_error("`rotation` is no unit quaternion");
  colour.colour_from_depth.linear() = rotation.normalized().toRotationMatrix();
  colour.colour_from_depth.translation() = Eigen::Vector3d(t[0], t[1], t[2]);
  return colour;
}

}  // namespace

CameraFile read_camera_file(const std::filesystem::path& file) {
  try {
    const YAML::Node y = YAML::LoadFile(file.string());
    CameraFile read{.camera = read_camera(y), .depth_scale = y["depth_scale"].as<double>(5000.0), .colour = {}};
    if (!(read.depth_scale > 0)) throw std::runtime_error("depth_scale must be positive");
    if (y["colour"]) read.colour = read_colour_camera(y["colour"]);
    return read;
  } catch (const YAML::BadFile&) {
    throw std::runtime_error(file.string() + ": cannot be read");
  } catch (const YAML::Exception& error) {
    throw std::runtime_error(file.string() + ":" + std::to_string(error.mark.line + 1) + ": " + error.msg);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
}

std::string camera_file_text(const Camera& c, double depth_scale) {
  return fmt::format("width: {}\nheight: {}\nfx: {}\nfy: {}\ncx: {}\ncy: {}\ndistortion: [{}]\ndepth_scale: {}\n",
                     c.width, c.height, c.fx, c.fy, c.cx, c.cy, fmt::join(c.distortion, ", "), depth_scale);
}

}  // namespace cairn
