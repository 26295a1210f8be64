// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <algorithm>
#include <chrono>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <utility>

#include "base/memory.hpp"
#include "cairn/mapping/splat_training.hpp"
#include "eval/view_comparison.hpp"
#include "export/check_range.hpp"
#include "export/image_rectifier.hpp"
#include "export/map_contents.hpp"
#include "splats/exposure.hpp"
#include "splats/initialize.hpp"
#include "splats/posed_frames.hpp"
#include "splats/splat_renderer.hpp"
#include "splats/trainer.hpp"
#include "splats/training_memory.hpp"

namespace cairn {
namespace {

constexpr double kSurfelShare = 0.6;          // of the maximum count; the rest is for background and refinement
constexpr double kRecentShare = 0.05;         // weight of the newest image in the reported error
constexpr std::size_t kMaxInitialViews = 50;  // for colors and background of the first splats
constexpr std::size_t kMaxCompared = 100;     // held-out images

/// Keyframes for training, and those held out.
struct SplitKeyframes {
  std::vector<TextureKeyframe> training, held_out;
};

SplitKeyframes split_keyframes(const std::vector<TextureKeyframe>& keyframes, int hold_out) {
  SplitKeyframes split;
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    const bool is_held_out = hold_out > 0 && (k + 1) % static_cast<std::size_t>(hold_out) == 0;
    (is_held_out ? split.held_out : split.training).push_back(keyframes[k]);
  }
  return split;
}

/// Rectified image at the size of `camera`, with the depth of the mesh.
TrainingView training_view(Frame frame, const Camera& full, const Camera& camera, const std::vector<Mesh>& surface) {
  TrainingView view{.camera = camera, .world_from_camera = *frame.world_from_camera, .color = {}, .depth = {}};
  view.color.resize(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
  const cv::Mat from(full.height, full.width, CV_8UC4, frame.color.data());
  cv::Mat to(camera.height, camera.width, CV_8UC4, view.color.data());
  cv::resize(from, to, to.size(), 0, 0, cv::INTER_AREA);
  view.depth = render_mesh(surface, camera, view.world_from_camera, 1).depth;
  return view;
}

/// Views spread evenly, at most `max_count`.
std::vector<TrainingView> subset(const std::vector<TrainingView>& views, std::size_t max_count) {
  const std::size_t step = (views.size() + max_count - 1) / max_count;
  std::vector<TrainingView> some;
  for (std::size_t i = 0; i < views.size(); i += step) some.push_back(views[i]);
  return some;
}

/// Comparison of images with the splats, and with a mesh if there is one.
struct Comparisons {
  ViewComparison& splats;
  ViewComparison* mesh;
  int frames = 0;

  void add(Frame frame, const Eigen::Isometry3d& world_from_map, const TextureKeyframe& k) {
    const Eigen::Isometry3d pose = world_from_map * k.world_from_camera;
    if (mesh != nullptr) mesh->compare_color(frame, pose, k.velocity, k.color_delay);
    splats.compare_color(std::move(frame), pose, k.velocity, k.color_delay);
    ++frames;
  }
};

double psnr_of(double squared) { return squared > 0 ? -10 * std::log10(squared) : 0; }

/// Training of a map's splats, step by step.
class Training {
 public:
  Training(Map& map, const SplatOptions& options, const SplatStep& on_step, const OpenRecording& open)
      : map_(map),
        options_(options),
        on_step_(on_step),
        open_(open),
        device_(MapAccess::contents(map).device()),
        input_(MapAccess::contents(map).views()),
        keyframes_(split_keyframes(input_.keyframes, options.hold_out)),
        surface_{map.mesh()},
        max_count_(std::min(options.max_splats, max_splats(device_, options.degree))) {}

  [[nodiscard]] TrainedSplats run() {
    std::vector<TrainingView> views = open_ ? load_recording() : load_keyframes();
    estimate_gains(views, surface_.front());
    SplatTrainer trainer(
        device_, initial_splats(subset(views, kMaxInitialViews)), views,
        {.iterations = options_.iterations, .max_splats = max_count_, .resolution = options_.resolution});
    TrainedSplats trained;
    trained.report.memory = memory_.total();
    trained.report.images = static_cast<int>(views.size());
    train(trainer, trained.report);
    trained.splats = trainer.splats();
    try {
      compare_held_out(trained);
    } catch (const std::exception& error) {  // the splats are kept
      trained.report.problem = error.what();
    }
    return trained;
  }

 private:
  [[nodiscard]] std::vector<TrainingView> load_keyframes() {
    const ImageRectifier rectified(input_.rig);
    const Camera camera = scaled(rectified.camera(), static_cast<double>(options_.resolution));
    std::vector<TrainingView> views;
    plan_memory(keyframes_.training.size(), camera);
    for (const TextureKeyframe& k : keyframes_.training) {
      Frame frame = input_.get_image(k.image);
      if (frame.color.empty()) continue;
      views.push_back(
          training_view(rectified(std::move(frame), input_.world_from_map, k), rectified.camera(), camera, surface_));
      if (!keep_going({.memory = memory_.total()})) break;
    }
    if (views.empty()) throw std::runtime_error("the map has no keyframes with color to train splats from");
    return views;
  }

  void plan_memory(std::size_t images, const Camera& camera) {
    memory_ = training_memory(images, camera, max_count_, options_.degree);
    expect_enough(memory_, available_memory());
  }

  [[nodiscard]] std::vector<TrainingView> load_recording() {
    const ImageRectifier rectified(input_.rig);
    const Camera camera = scaled(rectified.camera(), static_cast<double>(options_.resolution));
    PosedFrames frames(map_, input_, open_(), options_.hold_out);
    std::vector<TrainingView> views;
    plan_memory(std::min(frames.size(), static_cast<std::size_t>(options_.images)), camera);
    visit_sharpest(frames, static_cast<std::size_t>(options_.images), [&](PosedFrame posed) {
      views.push_back(training_view(rectified(std::move(posed.frame), Eigen::Isometry3d::Identity(), posed.keyframe),
                                    rectified.camera(), camera, surface_));
      return keep_going({.memory = memory_.total()});
    });
    if (views.empty())
      throw std::runtime_error(
          "no color image of the recording has the time of a pose of the map: "
          "give the recording of the map");
    return views;
  }

  [[nodiscard]] Splats initial_splats(const std::vector<TrainingView>& views) {
    Splats splats =
        surfels_of(surface_.front(), views, static_cast<std::size_t>(kSurfelShare * static_cast<double>(max_count_)),
                   options_.degree);
    if (splats.size() == 0) throw std::runtime_error("the map has no surface in its keyframes to train splats from");
    SplatRasterizer rasterizer(device_);
    for (const TrainingView& view : views) {
      if (!has_background(view) || splats.size() >= max_count_) continue;
      rasterizer.forward(upload(device_, splats), {.camera = view.camera, .world_from_camera = view.world_from_camera});
      append_background(splats, view, rasterizer.download_image());
      if (!keep_going({.splats = splats.size(), .memory = memory_.total()})) break;
    }
    return splats;
  }

  void train(SplatTrainer& trainer, SplatReport& report) {
    const auto start = std::chrono::steady_clock::now();
    double recent = 0;
    while (report.iterations < options_.iterations) {
      const double share = options_.max_seconds > 0 ? report.seconds / options_.max_seconds : 0;
      const double squared = trainer.step(share).squared;
      ++report.iterations;
      const double weight = std::max(kRecentShare, 1.0 / report.iterations);
      recent += weight * (squared - recent);
      report.psnr = psnr_of(recent);
      report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      if (!keep_going({.iteration = report.iterations,
                       .iterations = options_.iterations,
                       .psnr = report.psnr,
                       .splats = trainer.size(),
                       .seconds = report.seconds}) ||
          (options_.max_seconds > 0 && report.seconds > options_.max_seconds))
        break;
    }
  }

  void compare_held_out(TrainedSplats& trained) const {
    if (is_stopped_ || options_.hold_out == 0 || (!open_ && keyframes_.held_out.empty())) return;
    SplatRenderer renderer(device_, trained.splats);
    ViewComparison of_splats(
        [&](const Camera& camera, const Eigen::Isometry3d& pose, int) { return renderer(camera, pose); }, input_.rig);
    const std::vector<Mesh> parts = options_.mesh.empty() ? std::vector<Mesh>{} : read_mesh_parts(options_.mesh);
    ViewComparison of_mesh(parts, input_.rig);
    Comparisons comparisons{.splats = of_splats, .mesh = parts.empty() ? nullptr : &of_mesh};
    if (open_)
      compare_recording(comparisons);
    else
      compare_keyframes(comparisons);
    if (comparisons.frames == 0) return;
    trained.report.held_out = of_splats.error(comparisons.frames);
    if (!parts.empty()) trained.report.mesh = of_mesh.error(comparisons.frames);
  }

  void compare_keyframes(Comparisons& comparisons) const {
    for (const TextureKeyframe& k : keyframes_.held_out)
      if (Frame frame = input_.get_image(k.image); !frame.color.empty())
        comparisons.add(std::move(frame), input_.world_from_map, k);
  }

  void compare_recording(Comparisons& comparisons) const {
    PosedFrames frames(map_, input_, open_(), options_.hold_out);
    const std::size_t step = frames.size() / (kMaxCompared * static_cast<std::size_t>(options_.hold_out)) + 1;
    for (std::size_t held_out = 0; auto posed = frames.next();)
      if (posed->frame.held_out && held_out++ % step == 0)
        comparisons.add(std::move(posed->frame), Eigen::Isometry3d::Identity(), posed->keyframe);
  }

  [[nodiscard]] bool keep_going(const SplatProgress& progress) {
    is_stopped_ = is_stopped_ || (on_step_ && !on_step_(progress));
    return !is_stopped_;
  }

  Map& map_;
  const SplatOptions& options_;
  const SplatStep& on_step_;
  const OpenRecording& open_;
  gpu::Device& device_;
  ViewsInput input_;
  SplitKeyframes keyframes_;
  std::vector<Mesh> surface_;
  std::size_t max_count_;  // splats
  TrainingMemory memory_;
  bool is_stopped_ = false;  // by on_step_
};

}  // namespace

void check(const SplatOptions& options) {
  check_range("SplatOptions::iterations", options.iterations);
  check_range("SplatOptions::max_seconds", options.max_seconds);
  check_range("SplatOptions::resolution", options.resolution);
  check_range("SplatOptions::max_splats", options.max_splats);
  check_range("SplatOptions::degree", options.degree);
  check_range("SplatOptions::images", options.images);
  check_range("SplatOptions::hold_out", options.hold_out);
}

TrainedSplats train_splats(Map& map, const SplatOptions& options, const SplatStep& on_step, const OpenRecording& open) {
  check(options);
  return Training(map, options, on_step, open).run();
}

ViewError evaluate_views(const Splats& splats, Source& recording, const Eigen::Isometry3d& world_from_recording,
                         int step, int device) {
  gpu::Device on(device);
  SplatRenderer renderer(on, splats);
  ViewComparison views([&](const Camera& camera, const Eigen::Isometry3d& pose, int) { return renderer(camera, pose); },
                       recording.rig());
  return compare_views(views, recording, world_from_recording, step);
}

}  // namespace cairn
