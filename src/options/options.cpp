// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/options.hpp"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "base/words.hpp"
#include "options/option_ranges.hpp"
#include "options/yaml_file.hpp"

namespace cairn {
namespace {

/// Calls `visit(name, field, range, unit)` for every option: the single list of names, ranges and units.
template <class Visit>
void for_each_option(Options& o, Visit&& visit) {
  visit("surface.min_depth", o.surface.min_depth, AllowedRange{0.01, 10.0}, Unit::meters);
  visit("surface.max_depth", o.surface.max_depth, AllowedRange{0.1, 20.0}, Unit::meters);
  visit("surface.filter_sigma_pixels", o.surface.filter_sigma_pixels, AllowedRange{0.1, 10.0}, Unit::pixels);
  visit("surface.filter_range", o.surface.filter_range, AllowedRange{0.1, 100.0}, Unit::none);
  visit("surface.edge_slope", o.surface.edge_slope, AllowedRange{0.1, 1000.0}, Unit::none);
  visit("track.levels", o.track.levels, AllowedRange{1, 5}, Unit::none);
  visit("track.finest_level", o.track.finest_level, AllowedRange{0, 4}, Unit::none);
  visit("track.iterations_finest", o.track.iterations_finest, AllowedRange{1, 100}, Unit::none);
  visit("track.iterations_coarse", o.track.iterations_coarse, AllowedRange{1, 100}, Unit::none);
  visit("track.max_distance", o.track.max_distance, AllowedRange{0.001, 1.0}, Unit::meters);
  visit("track.max_angle", o.track.max_angle, AllowedRange{0.01, 1.57}, Unit::radians);
  visit("track.photometric", o.track.photometric, AllowedRange{0, 1}, Unit::none);
  visit("track.huber", o.track.huber, AllowedRange{0.01, 100.0}, Unit::none);
  visit("track.min_inlier_share", o.track.min_inlier_share, AllowedRange{0.0, 1.0}, Unit::share);
  visit("track.max_rmse", o.track.max_rmse, AllowedRange{0.1, 1000.0}, Unit::none);
  visit("motion.max_speed", o.motion.max_speed, AllowedRange{0.01, 100.0}, Unit::none);
  visit("motion.max_turn", o.motion.max_turn, AllowedRange{0.01, 100.0}, Unit::none);
  visit("fuse.voxel_size", o.fuse.voxel_size, AllowedRange{0.002, 0.2}, Unit::meters);
  visit("fuse.truncation", o.fuse.truncation, AllowedRange{0.004, 1.0}, Unit::meters);
  visit("fuse.max_weight", o.fuse.max_weight, AllowedRange{1.0, 250.0}, Unit::none);
  visit("fuse.min_mesh_weight", o.fuse.min_mesh_weight, AllowedRange{0.0, 250.0}, Unit::none);
  visit("map.submap_radius", o.map.submap_radius, AllowedRange{0.5, 100.0}, Unit::meters);
  visit("map.submap_bricks", o.map.submap_bricks, AllowedRange{1000, 1e9}, Unit::none);
  visit("map.submap_keyframes", o.map.submap_keyframes, AllowedRange{2, 1e6}, Unit::none);
  visit("map.loops", o.map.loops, AllowedRange{0, 1}, Unit::none);
  visit("map.lost_frames", o.map.lost_frames, AllowedRange{1, 1e9}, Unit::none);
  visit("map.host_memory", o.map.host_memory, AllowedRange{0.0, 1e15}, Unit::bytes);
  visit("esdf.live", o.esdf.live, AllowedRange{0, 1}, Unit::none);
  visit("esdf.voxel_size", o.esdf.voxel_size, AllowedRange{0.0, 1.6}, Unit::meters);
  visit("esdf.max_distance", o.esdf.max_distance, AllowedRange{0.01, 20.0}, Unit::meters);
  visit("esdf.robot_radius", o.esdf.robot_radius, AllowedRange{0.0, 5.0}, Unit::meters);
  visit("fuse.device_memory", o.fuse.device_memory, AllowedRange{0.0, 1e15}, Unit::bytes);
}

/// Parses a value and checks the bounds before rounding.
template <class T>
void set(T& field, const YAML::Node& node, const std::string& name, const AllowedRange& range, Unit unit) {
  const std::string text = node.IsScalar() ? node.Scalar() : "";
  std::optional<double> value;
  if constexpr (std::is_same_v<T, bool>) {
    if (bool flag = false; YAML::convert<bool>::decode(node, flag)) value = flag;
  } else if (std::is_integral_v<T> && unit == Unit::none) {
    if (const auto integer = parse_whole(text)) value = static_cast<double>(*integer);
  } else {
    value = parse_quantity(text, unit);
  }
  if (!value || !range.has(*value))
    throw YAML::Exception(node.Mark(), "`" + name + "` has an invalid value; expected " +
                                           (std::is_same_v<T, bool> ? "true or false" : words_of(range, unit)));
  field = static_cast<T>(*value);
}

constexpr float kVoxels = 4, kSigmas = 2.5f, kAtDepth = 2;  // truncation: voxels, noise sigmas at kAtDepth m

}  // namespace

Options options_for(const SensorModel& sensor, float voxel_size) {
  Options options;
  options.surface.min_depth = sensor.min_depth;
  options.surface.max_depth = sensor.max_depth;
  options.fuse.voxel_size = voxel_size;
  options.fuse.truncation = std::max(kVoxels * voxel_size, kSigmas * sensor.sigma(kAtDepth));
  return options;
}

std::string_view to_string(DevicePoses use) {
  switch (use) {
    case DevicePoses::off:
      return "off";
    case DevicePoses::guess:
      return "guess";
    case DevicePoses::prior:
      return "prior";
  }
  return {};
}

DevicePoses device_poses_of(std::string_view name) {
  for (const DevicePoses use : {DevicePoses::off, DevicePoses::guess, DevicePoses::prior})
    if (name == to_string(use)) return use;
  throw std::runtime_error("unknown use of device poses '" + std::string(name) + "'; known: off, guess, prior");
}

MotionOptions motion_of(std::string_view name) {
  if (name == "hand") return {};
  if (name == "robot") return {.max_speed = 3, .max_turn = 4};
  if (name == "drone") return {.max_speed = 15, .max_turn = 12};
  if (name == "unknown") return {.max_speed = 100, .max_turn = 100};
  throw std::runtime_error("unknown motion '" + std::string(name) + "'; known motions: hand, robot, drone, unknown");
}

void read_options(const std::filesystem::path& file, Options& options) {
  std::map<std::string, std::function<void(const YAML::Node&)>> setters;
  for_each_option(options, [&](const char* name, auto& field, const AllowedRange& range, Unit unit) {
    setters[name] = [=, &field](const YAML::Node& node) { set(field, node, name, range, unit); };
  });
  std::set<std::string> set_options;
  const auto take = [&](const YAML::Node& key, const YAML::Node& value, const std::string& section) {
    const std::string name = section + "." + key.Scalar();
    const auto setter = setters.find(name);
    if (setter == setters.end()) throw YAML::Exception(key.Mark(), "there is no option `" + name + "`");
    setter->second(value);
    set_options.insert(name);
  };
  try {
    const YAML::Node root = read_yaml_file(file);
    if (root.IsNull()) return;
    if (!root.IsMap()) throw YAML::Exception(root.Mark(), "expected sections such as `fuse:`");
    for (const auto& section : root) {
      const std::string& name = section.first.Scalar();
      if (!section.second.IsMap())
        throw YAML::Exception(section.first.Mark(), "`" + name + "` is not a section of options");
      for (const auto& option : section.second) take(option.first, option.second, name);
    }
    if (set_options.contains("fuse.voxel_size") && !set_options.contains("fuse.truncation"))
      options.fuse.truncation = kVoxels * options.fuse.voxel_size;
  } catch (const YAML::Exception& error) {
    throw std::runtime_error(file.string() + ":" + std::to_string(error.mark.line + 1) + ": " + shown(error.msg));
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
  check(options);
}

AllowedRange range_of(std::string_view option) {
  Options options;
  std::optional<AllowedRange> found;
  for_each_option(options, [&](const char* name, auto&, const AllowedRange& range, Unit) {
    if (option == name) found = range;
  });
  if (!found) throw std::logic_error("there is no option " + std::string(option));
  return *found;
}

void check(const Options& options) {
  Options copy = options;
  for_each_option(copy, [](const char* name, auto& field, const AllowedRange& range, Unit unit) {
    const auto value = [&] {
      if constexpr (std::is_same_v<std::remove_reference_t<decltype(field)>, float>)
        return field;
      else
        return static_cast<double>(field);
    }();
    if (!range.has(value))
      throw std::runtime_error(fmt::format("option {} is {}, allowed: {}", name, value, words_of(range, unit)));
  });
  if (options.surface.min_depth >= options.surface.max_depth)
    throw std::runtime_error("option surface.min_depth must be less than surface.max_depth");
  if (options.fuse.truncation < 2 * options.fuse.voxel_size)
    throw std::runtime_error("option fuse.truncation must be at least two voxels");
  if (options.track.finest_level >= options.track.levels)
    throw std::runtime_error("option track.finest_level must be less than track.levels");
}

}  // namespace cairn
