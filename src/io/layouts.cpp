// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/layouts.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>
#include <stdexcept>

#include "base/atomic_file.hpp"
#include "base/image_file.hpp"
#include "base/words.hpp"
#include "cairn/io/known_cameras.hpp"
#include "geometry/encode_frame.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// Camera properties that a layout's files can store.
enum Stored : unsigned { kLens = 1, kColorCamera = 2, kShutter = 4 };

struct Layout {
  std::string_view name;
  unsigned stores;
  std::function<std::unique_ptr<LayoutWriter>(const fs::path&, const Rig&)> write;
};

template <TumKind kind>
std::unique_ptr<LayoutWriter> tum_of(const fs::path& folder, const Rig& rig) {
  return write_tum(folder, rig, kind);
}

const Layout& layout_of(std::string_view name) {
  static const Layout kWriters[] = {{"tum", kLens | kColorCamera, tum_of<TumKind::cairn>},
                                    {"bonn", kLens, tum_of<TumKind::bonn>},
                                    {"eth3d", 0, tum_of<TumKind::eth3d>},
                                    {"seven-scenes", kShutter, write_seven_scenes},
                                    {"icl-nuim", 0, write_icl_nuim},
                                    {"replica", 0, write_replica},
                                    {"open3d", 0, write_open3d},
                                    {"rtabmap", kLens, write_rtabmap},
                                    {"nerfstudio", kLens, write_nerfstudio},
                                    {"scannet", kColorCamera, write_sens},
                                    {"stray-scanner", 0, write_stray_scanner}};
  const auto* found =
      std::find_if(std::begin(kWriters), std::end(kWriters), [&](const Layout& l) { return l.name == name; });
  if (found == std::end(kWriters))
    throw std::runtime_error(
        fmt::format("unknown layout '{}'; known layouts: {}", shown(name), fmt::join(kLayouts, ", ")));
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
  const auto unsupported = [&](const char* feature, const char* remedy) {
    return std::runtime_error(fmt::format("the layout {} cannot store {}: {}", name, feature, remedy));
  };
  auto fixed = camera_of_layout(name);
  if (fixed && (layout.stores & kShutter) != 0) fixed->readout = rig.depth.readout;
  if (fixed && *fixed != rig.depth)
    throw unsupported("this camera", "its programs assume a fixed camera, see camera_of_layout");
  if (rig.depth.distorted() && (layout.stores & kLens) == 0)
    throw unsupported("lens distortion", "rectify the images, or use tum");
  if (!rig.color) return layout.write(folder, rig);
  if ((layout.stores & kColorCamera) == 0)
    throw unsupported("a separate color camera", "register color to depth, or use tum");
  if (rig.color->camera.distorted() && (layout.stores & kLens) == 0)
    throw unsupported("lens distortion", "rectify the images, or use tum");
  return layout.write(folder, rig);
}

fs::path ImageFolder::path_of(const std::string& name) const {
  fs::path file = folder_ / name;
  std::error_code error;
  fs::create_directories(file.parent_path(), error);
  if (error)
    throw std::runtime_error("cannot create the folder " + file.parent_path().string() + ": " + error.message());
  return file;
}

void ImageFolder::write_depth(const std::string& name, const Frame& frame, double units_per_meter,
                              std::uint16_t none) const {
  write_whole(path_of(name), encode_depth(frame.depth, camera(), units_per_meter, none), Durable::some_time);
}

void ImageFolder::write_color(const std::string& name, const Frame& frame) const {
  if (frame.color.empty()) return;
  const fs::path file = path_of(name);
  write_whole(file, encode_color(frame.color, rig_.color_view(), file.extension().c_str()), Durable::some_time);
}

void ImageFolder::write_text(const std::string& name, std::string_view text) const {
  write_whole(path_of(name), text, Durable::some_time);
}

std::string rows_of(const Eigen::Isometry3d& pose, int rows, std::string_view separator) {
  std::string text;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < 4; ++c) {
      if (!text.empty()) text += separator;
      text += fmt::format("{}", pose.matrix()(r, c));
    }
  return text;
}

}  // namespace cairn
