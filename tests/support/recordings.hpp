// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "cairn/io/recorder.hpp"
#include "support/files.hpp"
#include "support/scenes.hpp"

namespace cairn {

/// Contents of a recording for a test.
struct SmallRecording {
  int frames = 40;
  double speed = 1;       // relative to the scene's own path
  double turns_at = 1e9;  // seconds after which the camera returns along the same path
  bool color = true;
  std::string scene = "room";
  std::vector<Scene::Solid> more = {};  // additional solids
};

/// Writes a recording of 160x120 pixels, so that a run takes a second. Writes suitable options beside it, as
/// FOLDER.yaml, for --config: 3 cm voxels and short submaps.
inline void write_small_recording(const std::filesystem::path& folder, const SmallRecording& r = {}) {
  const Camera camera{160, 120, 131.25, 131.25, 79.5, 59.5, {}};
  Scene scene = synthetic_scene(r.scene);
  scene.solids.insert(scene.solids.end(), r.more.begin(), r.more.end());
  SceneRenderer renderer(test_device(), scene, camera);
  Recorder writer(folder, camera);
  for (int i = 0; i < r.frames; ++i) {
    const double time = r.speed * i / 30.0;
    auto images = renderer.render(scene.world_from_camera(time > r.turns_at ? 2 * r.turns_at - time : time));
    if (!r.color) images.color.clear();
    writer.add(
        encode({.index = i, .timestamp = i / 30.0, .depth = std::move(images.depth), .color = std::move(images.color)},
               camera));
  }
  if (!r.color) {  // depth images only
    for (const char* name : {"rgb", "rgb.txt", "depth.txt", "camera.yaml"}) std::filesystem::remove_all(folder / name);
    write_text(
        folder / "intrinsics.json",
        R"({"width": 160, "height": 120, "fx": 131.25, "fy": 131.25, "cx": 79.5, "cy": 59.5, "depth_scale": 5000})");
  }
  std::filesystem::path config = folder;
  config += ".yaml";
  write_text(config,
             "fuse: {voxel_size: 0.03, truncation: 0.12}\ntrack: {finest_level: 0}\n"
             "map: {submap_keyframes: 6}\n");
}

}  // namespace cairn
