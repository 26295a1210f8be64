// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/layouts.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>
#include <stdexcept>

#include "base/image_file.hpp"
#include "base/words.hpp"
#include "cairn/atomic_file.hpp"
#include "cairn/known_cameras.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// Camera properties that a layout's files can store.
enum Tells : unsigned { kLens = 1, kColourCamera = 2, kShutter = 4 };

struct Layout {
  std::string_view name;
  unsigned tells;
  std::function<std::unique_ptr<LayoutWriter>(const fs::path&, const Rig&)> write;
};

template <TumKind kind>
std::unique_ptr<LayoutWriter> tum_of(const fs::path& folder, const Rig& rig) {
  return write_tum(folder, rig, kind);
}

const Layout& layout_of(std::string_view name) {
  static const Layout kAll[] = {{"tum", kLens | kColourCamera, tum_of<TumKind::cairn>},
                                {"bonn", kLens, tum_of<TumKind::bonn>},
                                {"eth3d", 0, tum_of<TumKind::eth3d>},
                                {"seven-scenes", kShutter, write_seven_scenes},
                                {"icl-nuim", 0, write_icl_nuim},
                                {"replica", 0, write_replica},
                                {"open3d", 0, write_open3d},
                                {"rtabmap", kLens, write_rtabmap},
                                {"nerfstudio", kLens, write_nerfstudio},
                                {"scannet", kColourCamera, write_sens},
                                {"stray-scanner", 0, write_stray_scanner}};
  const auto* found = std::find_if(std::begin(kAll), std::end(kAll), [&](const Layout& l) { return l.name == name; });
  if (found == std::end(kAll))
    throw std::runtime_error(
        fmt::format("there is no layout '{}'; there are {}", shown(name), fmt::join(kLayouts, ", ")));
  return *found;
}

}  // namespace

std::optional<Camera> camera_of_layout(std::string_view layout) {
  const KnownCamera* known = known_camera(layout);
  if (known == nullptr) return std::nullopt;
  Camera camera = known->camera;
  camera.readout = 0;
  return camera;
}

std::unique_ptr<LayoutWriter> write_layout(std::string_view name, const fs::path& folder, const Rig& rig) {
  const Layout& layout = layout_of(name);
  const auto cannot = [&](const char* what, const char* remedy) {
    return std::runtime_error(fmt::format("the layout {} cannot tell {}: {}", name, what, remedy));
  };
  auto its = camera_of_layout(name);
  if (its && (layout.tells & kShutter) != 0) its->readout = rig.depth.readout;
  if (its && *its != rig.depth) throw cannot("cameras", "its programs know one alone, see camera_of_layout");
  if (rig.depth.distorted() && (layout.tells & kLens) == 0) throw cannot("a lens", "rectify the images, or take tum");
  if (!rig.colour) return layout.write(folder, rig);
  if ((layout.tells & kColourCamera) == 0)
    throw cannot("a colour camera beside the depth camera", "bring colour to depth, or take tum");
  if (rig.colour->camera.distorted() && (layout.tells & kLens) == 0)
    throw cannot("a lens", "rectify the images, or take tum");
  return layout.write(folder, rig);
}

fs::path ImageFolder::place(const std::string& name) const {
  fs::path file = folder_ / name;
  std::error_code error;
  fs::create_directories(file.parent_path(), error);
  if (error) throw std::runtime_error("cannot make the folder " + file.parent_path().string() + ": " + error.message());
  return file;
}

void ImageFolder::write_depth(const std::string& name, const Frame& frame, double units_per_metre,
                              std::uint16_t none) const {
  write_whole(place(name), encode_depth(frame.depth, camera(), units_per_metre, none), Durable::some_time);
}

void ImageFolder::write_colour(const std::string& name, const Frame& frame) const {
  if (frame.colour.empty()) return;
  const fs::path file = place(name);
  write_whole(file, encode_colour(frame.colour, rig_.colour_view(), file.extension().c_str()), Durable::some_time);
}

void ImageFolder::write_text(const std::string& name, std::string_view text) const {
  write_whole(place(name), text, Durable::some_time);
}

std::string rows_of(const Eigen::Isometry3d& pose, int rows, std::string_view between) {
  std::string text;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < 4; ++c) {
      if (!text.empty()) text += between;
      text += fmt::format("{}", pose.matrix()(r, c));
    }
  return text;
}

}  // namespace cairn
