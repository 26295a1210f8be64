// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/options.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <set>
#include <stdexcept>
#include <string>

#include "base/read_whole.hpp"
#include "base/words.hpp"

namespace cairn {
namespace {

/// Calls `visit(name, field, least, most)` for every option: the one list of names and ranges.
template <class Visit>
void for_each_option(Options& o, Visit&& visit) {
  visit("surface.min_depth", o.surface.min_depth, 0.01, 10.0);
  visit("surface.max_depth", o.surface.max_depth, 0.1, 20.0);
  visit("surface.filter_sigma_pixels", o.surface.filter_sigma_pixels, 0.1, 10.0);
  visit("surface.filter_range", o.surface.filter_range, 0.1, 100.0);
  visit("surface.edge_slope", o.surface.edge_slope, 0.1, 1000.0);
  visit("track.levels", o.track.levels, 1, 5);
  visit("track.finest_level", o.track.finest_level, 0, 4);
  visit("track.iterations_finest", o.track.iterations_finest, 1, 100);
  visit("track.iterations_coarse", o.track.iterations_coarse, 1, 100);
  visit("track.max_distance", o.track.max_distance, 0.001, 1.0);
  visit("track.max_angle", o.track.max_angle, 0.01, 1.57);
  visit("track.photometric", o.track.photometric, 0, 1);
  visit("track.huber", o.track.huber, 0.01, 100.0);
  visit("track.min_inlier_share", o.track.min_inlier_share, 0.0, 1.0);
  visit("track.max_rmse", o.track.max_rmse, 0.1, 1000.0);
  visit("motion.max_speed", o.motion.max_speed, 0.01, 100.0);
  visit("motion.max_turn", o.motion.max_turn, 0.01, 100.0);
  visit("fuse.voxel_size", o.fuse.voxel_size, 0.002, 0.2);
  visit("fuse.truncation", o.fuse.truncation, 0.004, 1.0);
  visit("fuse.max_weight", o.fuse.max_weight, 1.0, 250.0);
  visit("fuse.min_mesh_weight", o.fuse.min_mesh_weight, 0.0, 250.0);
  visit("map.submap_radius", o.map.submap_radius, 0.5, 100.0);
  visit("map.submap_bricks", o.map.submap_bricks, 1000, 1e9);
  visit("map.submap_keyframes", o.map.submap_keyframes, 2, 1e6);
  visit("map.loops", o.map.loops, 0, 1);
  visit("map.lost_frames", o.map.lost_frames, 1, 1e9);
  visit("map.host_memory", o.map.host_memory, 0.0, 1e15);
  visit("esdf.live", o.esdf.live, 0, 1);
  visit("esdf.voxel_size", o.esdf.voxel_size, 0.0, 1.6);
  visit("esdf.max_distance", o.esdf.max_distance, 0.01, 20.0);
  visit("esdf.robot_radius", o.esdf.robot_radius, 0.0, 5.0);
  visit("fuse.device_memory", o.fuse.device_memory, 0.0, 1e15);
}

constexpr float kVoxels = 4, kSigmas = 2.5f, kAtDepth = 2;  // of the truncation; metres

}  // namespace

Options options_for(const SensorModel& sensor, float voxel_size) {
  Options options;
  options.surface.min_depth = sensor.min_depth;
  options.surface.max_depth = sensor.max_depth;
  options.fuse.voxel_size = voxel_size;
  options.fuse.truncation = std::max(kVoxels * voxel_size, kSigmas * sensor.sigma(kAtDepth));
  return options;
}

MotionOptions motion_of(std::string_view name) {
  if (name == "hand") return {};
  if (name == "robot") return {.max_speed = 3, .max_turn = 4};
  if (name == "drone") return {.max_speed = 15, .max_turn = 12};
  throw std::runtime_error("there is no motion '" + std::string(name) + "'; there are hand, robot, drone");
}

void read_options(const std::filesystem::path& file, Options& options) {
  std::map<std::string, std::function<void(const YAML::Node&)>> setters;
  for_each_option(options, [&](const char* name, auto& field, auto, auto) {
    setters[name] = [&field](const YAML::Node& node) { field = node.as<std::remove_reference_t<decltype(field)>>(); };
  });
  std::set<std::string> given;
  const auto set = [&](const YAML::Node& key, const YAML::Node& value, const std::string& section) {
    const std::string name = section + "." + key.Scalar();
    const auto setter = setters.find(name);
    if (setter == setters.end()) throw YAML::Exception(key.Mark(), "there is no option `" + name + "`");
    try {
      setter->second(value);
      given.insert(name);
    } catch (const YAML::Exception&) {
      throw YAML::Exception(value.Mark(), "`" + name + "` does not take this value");
    }
  };
  try {
    const auto bytes = read_whole(file);
    const YAML::Node root = YAML::Load(std::string(bytes.begin(), bytes.end()));
    if (root.IsNull()) return;
    if (!root.IsMap()) throw YAML::Exception(root.Mark(), "expected sections such as `fuse:`");
    for (const auto& section : root) {
      const std::string& name = section.first.Scalar();
      if (!section.second.IsMap())
        throw YAML::Exception(section.first.Mark(), "`" + name + "` is no section of options");
      for (const auto& option : section.second) set(option.first, option.second, name);
    }
    if (given.contains("fuse.voxel_size") && !given.contains("fuse.truncation"))
      options.fuse.truncation = kVoxels * options.fuse.voxel_size;
  } catch (const YAML::Exception& error) {
    throw std::runtime_error(file.string() + ":" + std::to_string(error.mark.line + 1) + ": " + shown(error.msg));
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(file.string() + ": " + error.what());
  }
  check(options);
}

void check(const Options& options) {
  Options copy = options;
  for_each_option(copy, [](const char* name, auto& field, auto least, auto most) {
    const auto value = static_cast<double>(field);
    if (!(value >= static_cast<double>(least) && value <= static_cast<double>(most)))
      throw std::runtime_error("option " + std::string(name) + " is " + std::to_string(value) + ", allowed is " +
                               std::to_string(least) + " to " + std::to_string(most));
  });
  if (options.surface.min_depth >= options.surface.max_depth)
    throw std::runtime_error("option surface.min_depth must be less than surface.max_depth");
  if (options.fuse.truncation < 2 * options.fuse.voxel_size)
    throw std::runtime_error("option fuse.truncation must be at least two voxels");
  if (options.track.finest_level >= options.track.levels)
    throw std::runtime_error("option track.finest_level must be less than track.levels");
}

}  // namespace cairn
