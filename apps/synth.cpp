// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>

#include "cairn/recorder.hpp"
#include "cairn/synthetic.hpp"
#include "commands.hpp"
#include "progress.hpp"
#include "sources.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string scene;
  fs::path output, trajectory, camera;
  int frames = 300, width = 640, device = -1;
  std::string noise = "kinect";
  double colour_delay = 0;
  std::uint64_t seed = 1;
};

/// That of a file, or the camera of synthetic recordings with images of another size.
Rig rig_of(const Arguments& a) {
  if (!a.camera.empty()) return read_rig(a.camera);
  const int width = a.width;
  Camera camera = synthetic_camera();
  const double scale = static_cast<double>(width) / camera.width;
  camera.width = width, camera.height = width * 3 / 4;
  camera.fx *= scale, camera.fy *= scale;
  camera.cx = 0.5 * (camera.width - 1), camera.cy = 0.5 * (camera.height - 1);
  return camera;
}

/// Renders everything into `folder`.
void write_sequence(const Arguments& a, const fs::path& folder) {
  const Scene scene = synthetic_scene(a.scene);
  const Rig rig = rig_of(a);
  const SyntheticPath path(scene, a.trajectory.empty() ? Trajectory{} : read_trajectory(a.trajectory), a.frames / 30.0);
  SceneCamera depth_in_scene(scene, rig.depth, a.device);
  std::optional<SceneCamera> beside;
  if (rig.colour) beside.emplace(scene, rig.colour->camera, a.device);
  SceneCamera& colour_in_scene = beside ? *beside : depth_in_scene;
  Recorder writer(folder, rig);
  Mesh truth = scene.surface();
  std::vector<bool> seen(truth.triangles.size());
  Trajectory poses;
  Progress progress(a.frames);
  for (int i = 0; i < a.frames; ++i) {
    const double time = i / 30.0;
    const auto pose = path.pose(time);
    if (!pose) break;
    auto images = depth_in_scene.look(*pose, time);
    const auto later = path.pose(std::max(0.0, time + a.colour_delay));
    if (beside || (a.colour_delay != 0 && later))
      images.colour =
          colour_in_scene.look(later.value_or(*pose) * rig.depth_from_colour(), time + a.colour_delay).colour;
    if (i % 5 == 0) mark_seen(truth, rig.depth, *pose, images.depth, seen);
    if (a.noise == "kinect") add_kinect_noise(images, rig.depth, a.seed, i);
    writer.add(encode({.timestamp = time,
                       .depth = std::move(images.depth),
                       .colour = std::move(images.colour),
                       .world_from_camera = {},
                       .acceleration = path.acceleration(time)},
                      rig));
    poses.push_back({time, *pose});
    progress.step("rendering");
  }
  write_trajectory(folder / "groundtruth.txt", poses);
  write_mesh(folder / "groundtruth_mesh.ply", truth);
  std::erase_if(truth.triangles, [&, i = std::size_t{0}](const auto&) mutable { return !seen[i++]; });
  write_mesh(folder / "groundtruth_seen.ply", truth);
}

void synth(const Arguments& a) {
  if (fs::exists(a.output) && !(fs::is_directory(a.output) && fs::is_empty(a.output)) &&
      !fs::exists(a.output / "groundtruth_mesh.ply"))
    throw std::runtime_error(a.output.string() +
                             ": exists and is no synthetic sequence; choose another folder with -o");
  const fs::path output = tidy(a.output);
  fs::path temporary = output;
  temporary += ".part";
  fs::remove_all(temporary);
  try {
    write_sequence(a, temporary);
    fs::remove_all(output);
    fs::rename(temporary, output);
  } catch (...) {
    std::error_code ignored;
    fs::remove_all(temporary, ignored);
    throw;
  }
  fmt::print("{}: {} frames of '{}' with true poses and surface\n", a.output.string(), a.frames, a.scene);
}

}  // namespace

void add_synth(CLI::App& program) {
  auto* command = program.add_subcommand("synth", "Render a synthetic recording with exact truth, in the TUM layout");
  const auto a = std::make_shared<Arguments>();
  command->add_option("SCENE", a->scene, "room, room-with-mover, flat, twin-rooms, sphere, plane, corridor or loop")
      ->required();
  command->add_option("-o,--output", a->output, "Folder for the recording")->required();
  command
      ->add_option("--trajectory", a->trajectory,
                   "Move along this TUM trajectory, z up, put into the middle of the scene [the scene's own path]")
      ->check(CLI::ExistingFile);
  command->add_option("--frames", a->frames, "Number of frames, 30 a second")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  command->add_option("--width", a->width, "Of the images in pixels; their height is three quarters of it")
      ->capture_default_str()
      ->check(CLI::Range(64, 4096));
  command
      ->add_option("--camera", a->camera,
                   "camera.yaml of the depth camera and perhaps of a colour camera beside it [one camera for both]")
      ->check(CLI::ExistingFile);
  command->add_option("--noise", a->noise, "Depth and colour noise")
      ->capture_default_str()
      ->check(CLI::IsMember({"kinect", "none"}));
  command
      ->add_option("--colour-delay", a->colour_delay,
                   "Seconds that colour images are taken after the depth images with the same stamp")
      ->capture_default_str();
  command->add_option("--seed", a->seed, "Of the noise")->capture_default_str();
  command->add_option("--device", a->device, "Vulkan device; -1 chooses")->capture_default_str();
  command->callback([a] { synth(*a); });
}

}  // namespace cairn::apps
