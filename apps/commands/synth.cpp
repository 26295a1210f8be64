// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <future>
#include <nlohmann/json.hpp>
#include <random>
#include <regex>

#include "base/atomic_file.hpp"
#include "cairn/io/layouts.hpp"
#include "cairn/synthetic/synthetic.hpp"
#include "cli/command_tree.hpp"
#include "cli/commands.hpp"
#include "cli/console.hpp"
#include "cli/inputs_and_outputs.hpp"
#include "cli/progress.hpp"
#include "cli/quantity.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string scene;
  fs::path output, trajectory, camera;
  std::optional<int> frames, floors, rooms, recording;
  std::optional<double> meters;
  int width = 640, device = -1;
  std::string noise = "kinect", imu = "none", layout = "tum";
  double color_delay = 0, rate = 30;
  double imu_misalignment = 0, imu_lever = 0, imu_delay = 0;  // rad, m, seconds
  double imu_range = 35;                                      // rad/s
  std::uint64_t seed = 1;
  bool overwrite = false;
};

constexpr const char* kTruthFile = "groundtruth_mesh.ply";  // marks a folder as written by this command

constexpr const char* kBuilding = "building";
constexpr int kDefaultFrames = 300;

/// Name of the scene for synthetic_scene.
std::string scene_name(const Arguments& a) {
  std::vector<std::string> parts;
  const auto add = [&](const char* key, const auto& value) {
    if (value) parts.push_back(fmt::format("{}={}", key, *value));
  };
  add("floors", a.floors), add("rooms", a.rooms), add("recording", a.recording), add("meters", a.meters);
  if (!parts.empty() && a.scene != kBuilding)
    throw std::runtime_error(a.scene + ": has no --floors, --rooms, --recording and --meters, which are for building");
  return parts.empty() ? a.scene : fmt::format("{}?{}", a.scene, fmt::join(parts, "&"));
}

/// Number of frames: as requested; default 300, for a building the length of its path.
int frames_of(const Arguments& a, const Scene& scene) {
  if (a.scene != kBuilding) return a.frames.value_or(kDefaultFrames);
  const int all = static_cast<int>(scene.duration() * a.rate) + 1;
  return std::min(a.frames.value_or(all), all);
}

/// Ground truth surface. For a building, which is mostly planar, with larger triangles and only around the path.
Mesh truth_of(const Scene& scene, const SyntheticPath& path, double seconds) {
  if (scene.name != kBuilding) return scene.surface();
  constexpr double kStep = 0.5, kRadius = 6;  // seconds, meters
  constexpr float kSpacing = 0.04f;           // meters
  std::vector<Eigen::Vector3d> places;
  for (int i = 0; i * kStep < seconds; ++i)
    if (const auto pose = path.pose(i * kStep)) places.emplace_back(pose->translation());
  return scene.around(places, kRadius).surface(kSpacing);
}

/// Rig of a camera file or of the layout, else the camera of synthetic recordings at the requested image size.
Rig rig_of(const Arguments& a) {
  if (!a.camera.empty()) return read_rig(a.camera);
  if (const auto known = camera_of_layout(a.layout)) return *known;
  const int width = a.width;
  Camera camera = synthetic_camera();
  const double scale = static_cast<double>(width) / camera.width;
  camera.width = width, camera.height = width * 3 / 4;
  camera.fx *= scale, camera.fy *= scale;
  camera.cx = 0.5 * (camera.width - 1), camera.cy = 0.5 * (camera.height - 1);
  return camera;
}

/// Errors of a simulated sensor: white noise, and a bias with random walk.
class SensorErrors {
 public:
  /// `density`: 1/sqrt(Hz) of the unit; `walk`: per second.
  SensorErrors(std::uint64_t seed, double density, double walk, const Eigen::Vector3d& bias)
      : random_(seed), density_(density), walk_(walk), bias_(bias) {}
  /// Bias of the last sample.
  [[nodiscard]] const Eigen::Vector3d& bias() const { return bias_; }
  /// Error of the next sample at a rate in Hz.
  [[nodiscard]] Eigen::Vector3d next(double rate) {
    bias_ += walk_ / std::sqrt(rate) * noise();
    return bias_ + density_ * std::sqrt(rate) * noise();
  }

 private:
  /// Noise of variance 1 per axis, as sums of uniform numbers, so that all standard libraries give the same values.
  Eigen::Vector3d noise() {
    Eigen::Vector3d n;
    for (double& v : n) {
      v = -6;
      for (int i = 0; i < 12; ++i) v += static_cast<double>(random_() >> 11) / 9007199254740992.0;
    }
    return n;
  }
  std::mt19937_64 random_;
  double density_, walk_;
  Eigen::Vector3d bias_;
};

/// Simulated gyroscope and accelerometer: samples since the last call, at 200 Hz. `mems` models a phone-grade sensor,
/// Bosch BMI270: 0.007 degrees/s/sqrt(Hz), 160 ug/sqrt(Hz), biases of 0.5 degrees/s and 0.09 m/s^2 with random walk. It
/// may be rotated against the camera's axes, and apart from the camera, and its clock may be ahead.
class InertialSensor {
 public:
  InertialSensor(const Arguments& a, const Rig& rig)
      : camera_from_imu_(rig.camera_from_imu.value_or(Eigen::Quaterniond::Identity())),
        is_present_(a.imu != "none"),
        is_noisy_(a.imu == "mems"),
        gyro_(a.seed, 0.007 / 57.29578, 2e-4, {0.006, -0.005, 0.004}),
        acceleration_(a.seed + 1, 1.6e-3, 3e-4, {0.05, -0.04, 0.06}),
        imu_from_camera_(Eigen::AngleAxisd(a.imu_misalignment, Eigen::Vector3d(2, -1, 1).normalized())),
        lever_(a.imu_lever * Eigen::Vector3d(2, -1.5, 1).normalized()),
        delay_(a.imu_delay),
        max_rate_(a.imu_range) {}
  /// Adds the samples up to the frame's time.
  void attach_to(Frame& frame, const SyntheticPath& path) {
    for (; is_present_ && static_cast<double>(next_) / kRate <= frame.timestamp; ++next_) {
      const double at = static_cast<double>(next_) / kRate, moved = std::max(0.0, at - delay_);
      Eigen::Vector3d rate = imu_from_camera_ * path.angular_rate(moved);
      Eigen::Vector3d force = imu_from_camera_ * path.specific_force(moved) + force_by_lever(path, moved, rate);
      if (is_noisy_) rate += gyro_.next(kRate), force += acceleration_.next(kRate);
      frame.gyro.push_back({at, camera_from_imu_.conjugate() * limited(rate, max_rate_)});
      frame.accelerations.push_back({at, limited(force, kMaxForce)});
    }
  }
  /// True state at the last sample, as in report.json.
  [[nodiscard]] nlohmann::json truth() const {
    const auto list = [](const auto& v) { return std::vector<double>(v.begin(), v.end()); };
    const Eigen::Vector3d none = Eigen::Vector3d::Zero();
    return {{"gyroscope_bias", list(is_noisy_ ? gyro_.bias() : none)},
            {"accelerometer_bias", list(is_noisy_ ? acceleration_.bias() : none)},
            {"rotation", list(imu_from_camera_.coeffs())},
            {"lever_m", list(lever_)},
            {"clock_s", delay_}};
  }

 private:
  static constexpr double kRate = 200;            // Hz
  static constexpr double kMaxForce = 16 * 9.81;  // m/s^2
  /// Acceleration of the sensor against the camera, in the sensor's axes.
  [[nodiscard]] Eigen::Vector3d force_by_lever(const SyntheticPath& path, double at,
                                               const Eigen::Vector3d& rate) const {
    if (lever_.isZero()) return Eigen::Vector3d::Zero();
    constexpr double kStep = 0.005;  // seconds
    const double before = std::max(0.0, at - kStep);
    const Eigen::Vector3d turn =
        imu_from_camera_ * (path.angular_rate(at + kStep) - path.angular_rate(before)) / (at + kStep - before);
    return -turn.cross(lever_) - rate.cross(rate.cross(lever_));
  }
  [[nodiscard]] static Eigen::Vector3d limited(const Eigen::Vector3d& v, double max) {
    return v.cwiseMax(-max).cwiseMin(max);
  }
  Eigen::Quaterniond camera_from_imu_;
  bool is_present_, is_noisy_;
  SensorErrors gyro_, acceleration_;
  Eigen::Quaterniond imu_from_camera_;  // against the rig's axes
  Eigen::Vector3d lever_;               // of the camera from the sensor, m, in the sensor's axes
  double delay_;                        // seconds
  double max_rate_;                     // rad/s
  long next_ = 0;
};

/// Renders everything into `folder`. Returns the number of frames.
int write_sequence(const Arguments& a, const fs::path& folder) {
  const Scene scene = synthetic_scene(scene_name(a));
  const int frames = frames_of(a, scene);
  Rig rig = rig_of(a);
  if (a.imu != "none" && !rig.camera_from_imu) rig.camera_from_imu = Eigen::Quaterniond::Identity();
  const SyntheticPath path(scene, a.trajectory.empty() ? Trajectory{} : read_trajectory(a.trajectory), frames / a.rate);
  SceneCamera depth_in_scene(scene, rig.depth, a.device);
  std::optional<SceneCamera> color_camera;
  if (rig.color) color_camera.emplace(scene, rig.color->camera, a.device);
  SceneCamera& color_in_scene = color_camera ? *color_camera : depth_in_scene;
  const auto writer = write_layout(a.layout, folder, rig);
  Mesh truth = truth_of(scene, path, frames / a.rate);
  std::vector<bool> seen(truth.triangles.size());
  InertialSensor inertial(a, rig);
  Progress progress(frames);
  std::future<void> writing;  // adds noise and encodes the previous frame while the next is rendered
  for (int i = 0; i < frames; ++i) {
    const double time = i / a.rate;
    const auto pose = path.pose(time);
    if (!pose) break;
    const auto depth_pose = [&](double t) { return path.pose(std::max(0.0, t)).value_or(*pose); };
    const auto color_pose = [&](double t) -> Eigen::Isometry3d { return depth_pose(t) * rig.depth_from_color(); };
    auto images = depth_in_scene.render(depth_pose, time);
    auto color = color_camera || a.color_delay != 0 ? color_in_scene.render(color_pose, time + a.color_delay).color
                                                    : images.color;
    if (i % 5 == 0 && rig.depth.readout == 0) mark_seen(truth, rig.depth, *pose, images.depth, seen);
    Frame frame{.index = i, .timestamp = time, .world_from_camera = *pose, .acceleration = path.acceleration(time)};
    inertial.attach_to(frame, path);
    if (writing.valid()) writing.get();
    writing = std::async(std::launch::async, [&, i, frame = std::move(frame), images = std::move(images),
                                              color = std::move(color)]() mutable {
      add_noise(images, rig.depth, a.noise, a.seed, i, &color);
      frame.depth = std::move(images.depth);
      frame.confidence = std::move(images.confidence);
      frame.color = std::move(color);
      writer->add(frame);
    });
    progress.step("rendering");
  }
  if (writing.valid()) writing.get();
  writer->finish();
  if (a.imu != "none") write_whole(folder / "groundtruth_imu.json", inertial.truth().dump(1) + '\n');
  write_mesh(folder / kTruthFile, truth);
  std::erase_if(truth.triangles, [&, i = std::size_t{0}](const auto&) mutable { return !seen[i++]; });
  write_mesh(folder / "groundtruth_seen.ply", truth);
  return frames;
}

/// Returns true if a recording of any layout has a file of this name.
bool is_recording_file(const std::string& name) {
  static const std::regex names(
      "(accelerometer|associated|associations|calibration|depth|groundtruth|gyroscope|poses|rgb|traj)\\.txt|"
      "(calib|camera)\\.yaml|(cam_params|camera_intrinsic|groundtruth_imu|transforms)\\.json|(camera_matrix|imu|"
      "odometry)\\.csv|"
      "(groundtruth_mesh|groundtruth_seen|points)\\.ply|recording\\.sens|rgb\\.mp4|"
      "frame-[0-9]{6}\\.(depth\\.png|color\\.png|pose\\.txt)|"
      "(color|confidence|depth|depths|images|results|rgb)/[a-z_]*[0-9][0-9.]*\\.(png|jpg)");
  return std::regex_match(name, names);
}

/// Links or copies foreign files of a replaced recording into the new recording.
void keep_other_files(const fs::path& before, const fs::path& folder) {
  if (!fs::exists(before)) return;
  for (const auto& entry : fs::recursive_directory_iterator(before)) {
    const fs::path name = entry.path().lexically_relative(before), kept = folder / name;
    if (fs::is_directory(entry.symlink_status()) || is_recording_file(name.generic_string()) ||
        fs::exists(fs::symlink_status(kept)))
      continue;
    fs::create_directories(kept.parent_path());
    std::error_code error;
    if (fs::is_regular_file(entry.symlink_status())) fs::create_hard_link(entry.path(), kept, error);
    if (!fs::exists(fs::symlink_status(kept))) fs::copy(entry.path(), kept, fs::copy_options::copy_symlinks);
  }
}

void synth(const Arguments& a) {
  Inputs().add(a.trajectory).add(a.camera).check_output_folder(a.output);
  if (!a.overwrite && fs::exists(a.output / kTruthFile))
    throw std::runtime_error(
        a.output.string() +
        ": already contains a synthetic recording: use --overwrite to replace it, or choose another folder");
  int frames = 0;
  write_folder(
      a.output,
      [&](const fs::path& folder) {
        frames = write_sequence(a, folder);
        keep_other_files(a.output, folder);
      },
      kTruthFile);
  print_result("{}: {} frames of '{}' with true poses and surface\n", a.output.string(), frames, a.scene);
}

/// Adds options for the size of the rendered recording.
void add_size_options(CLI::App& command, Arguments& a) {
  add_number(command, "--frames", a.frames, {1, 1e7}, "Number of frames [300; building: all]");
  add_number(command, "--floors", a.floors, {1, 100}, "Building: number of storeys [3]");
  add_number(command, "--rooms", a.rooms, {1, 10000}, "Building: number of rooms in all storeys [40]");
  add_number(command, "--recording", a.recording, {0, 1e9},
             "Building: number of the recording; each has its own path, hand motion and open doors [0]");
  add_number(command, "--meters", a.meters, {1, 100000}, Unit::meters, "Building: length of the path [30]");
  add_number(command, "--rate", a.rate, {1, 240}, Unit::hertz, "Frames per second")->capture_default_str();
  add_number(command, "--width", a.width, {64, 4096}, Unit::pixels,
             "Width of the images; their height is three quarters of it")
      ->capture_default_str();
}

}  // namespace

void add_synth(CLI::App& program) {
  auto* command = program.add_subcommand("synth", "Render a synthetic recording with exact truth");
  const auto a = std::make_shared<Arguments>();
  command->add_option("SCENE", a->scene, "Scene to render")
      ->required()
      ->check(one_of(
          {"room", "room-with-mover", "flat", "twin-rooms", "sphere", "plane", "corridor", "loop", "door", kBuilding}));
  command->add_option("-o,--output", a->output, "Folder for the recording")->required()->type_name(kFolder);
  command->add_flag("--overwrite", a->overwrite, "Replace an existing synthetic recording");
  command
      ->add_option("--trajectory", a->trajectory,
                   "Move along this TUM trajectory, z up, centered in the scene [the scene's own path]")
      ->check(CLI::ExistingFile);
  add_size_options(*command, *a);
  command
      ->add_option("--camera", a->camera,
                   "camera.yaml of the depth camera, optionally with a color camera [one camera for both]")
      ->check(CLI::ExistingFile);
  command
      ->add_option(
          "--noise", a->noise,
          "Depth and color noise: that of a Kinect, of time of flight (Azure Kinect), of stereo (RealSense), of "
          "a phone's lidar, or none")
      ->capture_default_str()
      ->check(one_of({"kinect", "tof", "stereo", "lidar", "none"}));
  command
      ->add_option("--layout", a->layout,
                   fmt::format("{}; some have their own camera, which replaces --width", fmt::join(kLayouts, ", ")))
      ->capture_default_str()
      ->check(one_of(std::vector<std::string>(std::begin(kLayouts), std::end(kLayouts))));
  command
      ->add_option(
          "--imu", a->imu,
          "Gyroscope and accelerometer at 200 Hz, ideal or of a phone's grade: gyroscope.txt, accelerometer.txt "
          "(stray-scanner: imu.csv) [none]")
      ->check(one_of({"none", "ideal", "mems"}));
  add_number(*command, "--imu-misalignment", a->imu_misalignment, {0, 0.2}, Unit::radians,
             "Rotation of the inertial sensor against the camera's axes, unknown to the recording")
      ->capture_default_str();
  add_number(*command, "--imu-lever", a->imu_lever, {0, 1}, Unit::meters,
             "Distance of the camera from the inertial sensor")
      ->capture_default_str();
  add_number(*command, "--imu-delay", a->imu_delay, {-1, 1}, Unit::seconds,
             "Seconds by which the inertial sensor's clock is ahead of the camera's")
      ->capture_default_str();
  add_number(*command, "--imu-range", a->imu_range, {0.1, 100}, Unit::none,
             "Rate in rad/s at which the gyroscope saturates")
      ->capture_default_str();
  add_number(*command, "--color-delay", a->color_delay, {-10, 10}, Unit::seconds,
             "Delay of color images after depth images with the same timestamp")
      ->capture_default_str();
  add_number(*command, "--seed", a->seed, {0, 1e15}, "Seed of the noise")->capture_default_str();
  add_device(*command, a->device);
  command->callback([a] { synth(*a); });
}

}  // namespace cairn::apps
