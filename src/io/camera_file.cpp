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

#include "base/atomic_file.hpp"
#include "base/words.hpp"
#include "cairn/io/known_cameras.hpp"
#include "io/intrinsics.hpp"
#include "io/recording.hpp"
#include "options/yaml_file.hpp"

namespace cairn {
namespace {

constexpr double kMinUnits = 1, kMaxUnits = 1e6;   // depth image units per meter
constexpr double kMinRate = 1e-3, kMaxRate = 1e5;  // Hz
constexpr const char* kLenses = "brown_conrady or fisheye";
constexpr const char* kWeights = "by_distance or by_noise";
constexpr double kUnitTolerance =
    1e-14;                           // rounding error of a squared norm around 1; keeps written quaternions bit-exact
constexpr double kMaxBaseline = 10;  // meters between the two cameras

/// Returns the node's value. Throws YAML::Exception with the key and the line.
template <class T>
T value_of(const YAML::Node& node, const std::string& key, const char* expected) {
  try {
    return node.as<T>();
  } catch (const YAML::Exception&) {
    throw YAML::Exception(node.Mark(), "`" + key + "` takes " + expected);
  }
}

std::vector<double> numbers(const YAML::Node& y, const char* key, std::size_t count, const char* expected) {
  auto values = value_of<std::vector<double>>(y[key], key, expected);
  if (values.size() != count) throw std::runtime_error(fmt::format("`{}` takes {}", key, expected));
  return values;
}

Camera read_camera(const YAML::Node& y) {
  if (!y.IsMap()) throw std::runtime_error("expected lines such as `fx: 525.0`");
  Camera c;
  for (const auto& [name, field] : {std::pair{"fx", &c.fx}, {"fy", &c.fy}, {"cx", &c.cx}, {"cy", &c.cy}}) {
    if (!y[name]) throw std::runtime_error(std::string("`") + name + "` is missing");
    *field = value_of<double>(y[name], name, "a number");
  }
  for (const auto& [name, field] : {std::pair{"width", &c.width}, {"height", &c.height}})
    if (y[name]) *field = value_of<int>(y[name], name, "an integer");
  if (y["lens"]) {
    const auto lens = value_of<std::string>(y["lens"], "lens", kLenses);
    if (lens != "brown_conrady" && lens != "fisheye") throw std::runtime_error(fmt::format("`lens` takes {}", kLenses));
    c.lens = lens == "fisheye" ? Lens::fisheye : Lens::brown_conrady;
  }
  if (y["distortion"]) {
    const char* expected = c.lens == Lens::fisheye ? "k1 k2 k3 k4" : "k1 k2 p1 p2 k3, optionally followed by k4 k5 k6";
    const auto d = value_of<std::vector<double>>(y["distortion"], "distortion", expected);
    if (c.lens == Lens::fisheye ? d.size() != 4 : d.size() != 5 && d.size() != 8)
      throw std::runtime_error(fmt::format("`distortion` takes {}", expected));
    std::copy(d.begin(), d.end(), c.distortion.begin());
  }
  if (y["readout"]) c.readout = value_of<double>(y["readout"], "readout", "seconds");
  check(c);
  return c;
}

Eigen::Quaterniond read_rotation(const YAML::Node& y) {
  const auto q = numbers(y, "rotation", 4, "qx qy qz qw");
  const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
  if (!(std::abs(rotation.norm() - 1) <= 1e-2)) throw std::runtime_error("`rotation` is not a unit quaternion");
  return std::abs(rotation.squaredNorm() - 1) <= kUnitTolerance ? rotation : rotation.normalized();
}

ColorCamera read_color_camera(const YAML::Node& y) {
  ColorCamera color{.camera = read_camera(y)};
  const auto t = numbers(y, "translation", 3, "x y z, meters");
  for (const double meters : t)
    if (!(std::abs(meters) <= kMaxBaseline))
      throw std::runtime_error(
          fmt::format("`translation` has {}, allowed: -{} to {} meters", meters, kMaxBaseline, kMaxBaseline));
  color.color_from_depth.linear() = read_rotation(y).toRotationMatrix();
  color.color_from_depth.translation() = Eigen::Vector3d(t[0], t[1], t[2]);
  return color;
}

/// `sensor: stereo`, or `sensor: {model: stereo, max_depth: 4}`.
SensorModel read_sensor(const YAML::Node& y) {
  if (y.IsScalar()) return sensor_model(y.as<std::string>());
  if (!y.IsMap()) throw std::runtime_error("`sensor` takes a name or lines such as `max_depth: 4`");
  SensorModel m;
  if (y["model"]) m = sensor_model(value_of<std::string>(y["model"], "model", "a sensor's name"));
  for (const auto& [name, field] : {std::pair{"floor", &m.floor},
                                    {"growth", &m.growth},
                                    {"sharpest", &m.sharpest},
                                    {"min_depth", &m.min_depth},
                                    {"max_depth", &m.max_depth}})
    if (y[name]) *field = value_of<float>(y[name], name, "a number");
  for (const char* key : {"min_confidence", "least_confidence"})  // the second before version 0.2
    if (y[key])
      m.min_confidence = static_cast<std::uint8_t>(std::clamp(value_of<int>(y[key], key, "0 to 255"), 0, 255));
  if (y["weight"]) {
    const auto weight = value_of<std::string>(y["weight"], "weight", kWeights);
    if (weight != "by_distance" && weight != "by_noise")
      throw std::runtime_error(fmt::format("`weight` takes {}", kWeights));
    m.weight = weight == "by_noise" ? SensorModel::Weight::by_noise : SensorModel::Weight::by_distance;
  }
  check(m);
  return m;
}

DepthCorrection read_depth_correction(const YAML::Node& y) {
  if (!y.IsMap()) throw std::runtime_error("`depth_correction` takes lines such as `columns: 40`");
  DepthCorrection c;
  for (const auto& [name, field] : {std::pair{"columns", &c.columns}, {"rows", &c.rows}})
    if (y[name]) *field = value_of<int>(y[name], name, "an integer");
  c.offsets = value_of<std::vector<float>>(y["offsets"], "offsets", "numbers, 1/m");
  check(c);
  return c;
}

std::string text_of(const DepthCorrection& c) {
  if (c.empty()) return "";
  std::string text = fmt::format(
      "depth_correction:  # 1 / depth = 1 / measured depth + offset, 1/m, row by row\n  columns: {}\n  rows: {}\n"
      "  offsets: [",
      c.columns, c.rows);
  for (std::size_t i = 0; i < c.offsets.size(); i += static_cast<std::size_t>(c.columns)) {
    const auto row = c.offsets.begin() + static_cast<std::ptrdiff_t>(i);
    text += fmt::format("{}{}", i > 0 ? ",\n    " : "", fmt::join(row, row + c.columns, ", "));
  }
  return text + "]\n";
}

std::string sensor_text(const SensorModel& m) {
  if (m == SensorModel{}) return "";
  if (to_string(m) != "custom") return fmt::format("sensor: {}\n", to_string(m));
  return fmt::format(
      "sensor:\n  floor: {}\n  growth: {}\n  sharpest: {}\n  min_depth: {}\n  max_depth: {}\n  weight: {}\n"
      "  min_confidence: {}\n",
      m.floor, m.growth, m.sharpest, m.min_depth, m.max_depth,
      m.weight == SensorModel::Weight::by_noise ? "by_noise" : "by_distance", m.min_confidence);
}

}  // namespace

void check_depth_scale(double units) {
  if (!(units >= kMinUnits && units <= kMaxUnits))  // also rejects NaN
    throw std::runtime_error(
        fmt::format("depth_scale is {}, allowed: {} to {} units per meter", units, kMinUnits, kMaxUnits));
}

void check_frame_rate(double hertz) {
  if (!(hertz >= kMinRate && hertz <= kMaxRate))
    throw std::runtime_error(fmt::format("`frame_rate` is {}, allowed: {} to {:.0f} Hz", hertz, kMinRate, kMaxRate));
}

namespace {

CameraFile read_camera_node(const YAML::Node& y) {
  CameraFile read{.rig = read_camera(y)};
  read.has_size = y["width"] || y["height"];
  if (y["depth_scale"]) {
    read.depth_scale = value_of<double>(y["depth_scale"], "depth_scale", "a number");
    check_depth_scale(*read.depth_scale);
  }
  if (y["frame_rate"]) {
    read.frame_rate = value_of<double>(y["frame_rate"], "frame_rate", "a number");
    check_frame_rate(*read.frame_rate);
  }
  for (const char* key : {"color", "colour"})  // `colour` was written before version 0.2
    if (y[key]) read.rig.color = read_color_camera(y[key]);
  if (y["sensor"]) read.rig.sensor = read_sensor(y["sensor"]);
  if (y["depth_correction"]) read.rig.depth_correction = read_depth_correction(y["depth_correction"]);
  if (y["imu"]) read.rig.camera_from_imu = read_rotation(y["imu"]);
  return read;
}

}  // namespace

CameraFile read_camera_file(const std::filesystem::path& file) {
  const std::string name = file.string();
  try {
    return read_camera_node(read_yaml_file(file));
  } catch (const YAML::Exception& error) {
    throw std::runtime_error(name + ":" + std::to_string(error.mark.line + 1) + ": " + shown(error.msg));
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(name + ": " + error.what());
  }
}

CameraFile camera_of_text(const std::string& yaml) try {
  return read_camera_node(read_yaml_text(yaml));
} catch (const YAML::Exception& error) {
  throw std::runtime_error(shown(error.msg));
}

CameraFile camera_named(const std::filesystem::path& file_or_name) {
  std::error_code ignored;
  if (std::filesystem::exists(file_or_name, ignored)) return read_intrinsics(file_or_name).camera;
  const KnownCamera* known = known_camera(file_or_name.string());
  if (known == nullptr) {
    std::vector<std::string_view> names;
    for (const KnownCamera& camera : known_cameras()) names.push_back(camera.name);
    throw std::runtime_error(fmt::format("{}: is neither a file nor a known camera; known cameras: {}",
                                         file_or_name.string(), fmt::join(names, ", ")));
  }
  CameraFile file{.rig = known->camera, .has_size = false};
  if (known->depth_scale > 0) file.depth_scale = known->depth_scale;
  return file;
}

Rig rig_named(const std::filesystem::path& file_or_name, const Rig& images) {
  const CameraFile file = camera_named(file_or_name);
  Rig rig = file.rig;
  const auto fitted = [&](const Camera& camera, const Camera& given, const char* which) {
    if (camera.width == given.width && camera.height == given.height) return camera;
    const double stretch =
        static_cast<double>(given.width) * camera.height / (static_cast<double>(given.height) * camera.width);
    if (known_camera(file_or_name.string()) != nullptr && std::abs(stretch - 1) <= kMaxAspectError)
      return scaled_to(camera, {given.width, given.height});
    throw std::runtime_error(fmt::format("{}: its {} camera has {}x{} pixels, the images have {}x{}",
                                         file_or_name.string(), which, camera.width, camera.height, given.width,
                                         given.height));
  };
  if (!file.has_size && known_camera(file_or_name.string()) == nullptr) {
    rig.depth.width = images.depth.width, rig.depth.height = images.depth.height;
    check(rig.depth);
  }
  rig.depth = fitted(rig.depth, images.depth, "depth");
  if (rig.color)
    rig.color->camera = fitted(rig.color->camera, images.color_view(), "color");
  else
    (void)fitted(rig.depth, images.color_view(), "color");
  return rig;
}

Rig read_rig(const std::filesystem::path& file) { return camera_named(file).rig; }

void write_rig(const std::filesystem::path& file, const Rig& rig) {
  const std::string text = camera_file_text({.rig = rig, .depth_scale = {}});
  write_whole(file, text);
}

std::string camera_file_text(const CameraFile& file) {
  const auto lines = [](const Camera& c, const char* indent) {
    const std::size_t terms = c.lens == Lens::fisheye                                                ? 4
                              : c.distortion[5] == 0 && c.distortion[6] == 0 && c.distortion[7] == 0 ? 5
                                                                                                     : 8;
    return fmt::format(
               "{0}width: {1}\n{0}height: {2}\n{0}fx: {3}\n{0}fy: {4}\n{0}cx: {5}\n{0}cy: {6}\n{0}{7}distortion: "
               "[{8}]\n",
               indent, c.width, c.height, c.fx, c.fy, c.cx, c.cy,
               c.lens == Lens::fisheye ? fmt::format("lens: fisheye\n{}", indent) : "",
               fmt::join(c.distortion.begin(), c.distortion.begin() + static_cast<std::ptrdiff_t>(terms), ", ")) +
           (c.readout > 0 ? fmt::format("{}readout: {}\n", indent, c.readout) : "");
  };
  std::string text = lines(file.rig.depth, "");
  if (file.depth_scale) text += fmt::format("depth_scale: {}\n", *file.depth_scale);
  text += sensor_text(file.rig.sensor) + text_of(file.rig.depth_correction);
  if (const auto& q = file.rig.camera_from_imu)
    text += fmt::format("imu:  # camera_from_imu, [qx, qy, qz, qw]\n  rotation: [{}, {}, {}, {}]\n", q->x(), q->y(),
                        q->z(), q->w());
  if (!file.rig.color) return text;
  const Eigen::Isometry3d& pose = file.rig.color->color_from_depth;
  const Eigen::Quaterniond q(pose.linear());
  return text + "color:  # translation and rotation [qx, qy, qz, qw]: from the depth camera's frame to its own\n" +
         lines(file.rig.color->camera, "  ") +
         fmt::format("  translation: [{}, {}, {}]\n  rotation: [{}, {}, {}, {}]\n", pose.translation().x(),
                     pose.translation().y(), pose.translation().z(), q.x(), q.y(), q.z(), q.w());
}

}  // namespace cairn
